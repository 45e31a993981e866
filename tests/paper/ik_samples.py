"""IK sampling: samples of rotations from a motion in which fingertips touch (Wang & Neff 2013, section 5.2).

A sample's angles are the likeliest hand whose tips touch, given what the calibration reads. In what the touch
does not tell they repeat the calibration: ``told`` says how much of each angle is news.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.errors import BadInput
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.sampling.inverse_kinematics.contact import Rod, TipChains, Touch
from glovecal_models.sampling.inverse_kinematics.follow import HandShape, follow, predicted_hand, steadied
from glovecal_models.sampling.inverse_kinematics.touch_check import judged, require_happened, require_possible
from glovecal_models.takes.take import Take

SINGULAR = 1e-9


@dataclass(frozen=True)
class IkSamples:
    """N samples (readings, observed rotations) of the K rotations that move the touching tips."""

    contact: Touch | Rod
    rotations: tuple[str, ...]
    frames: np.ndarray
    """(N,), of the take: those in which the tips are believed to touch."""
    readings: np.ndarray
    """(N, S), raw counts, sensors in the take's order."""
    angles_deg: np.ndarray
    """(N, K), within the joints' limits."""
    sd_deg: np.ndarray
    """(N, K), standard deviations once the touch is known, if the tips met exactly."""
    told: np.ndarray
    """(N, K), 0 to 1: the share of the calibration's variance that the touch takes away. At 0 the angle only
    repeats the calibration and should not count in training."""
    apart_mm: np.ndarray
    """(N,), how far the calibration read the tips from where they were."""
    take: Take
    """The recorded take with these rotations as its reference, NaN in other frames: ready for training."""
    sentence: str


def ik_samples(take: Take, model: CalibrationModel, skeleton: Skeleton, contact: Touch | Rod) -> IkSamples:
    """Samples of a ``take`` throughout which the subject keeps ``contact``.

    ``model``: the calibration so far, even a linear one of key poses. ``skeleton``: the subject's hand.
    Frames in which the tips cannot have touched are left out. Raises BadInput with the reason where that is
    most of them or the hand cannot touch at all, LayoutMismatch where the take is of another glove.
    """
    chains = TipChains(skeleton, contact.fingers)
    require_possible(chains, contact, skeleton)
    hand = predicted_hand(take, model, skeleton.rotations).frames(slice(take.pre_roll_frames, None))
    hand = replace(hand, mean_deg=steadied(take.time_s[take.pre_roll_frames :], hand.mean_deg))
    shape = hand.shape(chains)
    if not len(shape):
        raise BadInput(f"take {take.name!r} has no frames to find a touch in")
    found = follow(chains, contact, shape)
    verdict = judged(chains, contact, shape, found)
    require_happened(verdict, contact, hand, skeleton)
    kept = verdict.believable & ~hand.is_faulty[:, chains.columns].any(axis=1)
    told = _told(chains, contact, shape, found.angles_deg)
    frames = np.flatnonzero(kept) + take.pre_roll_frames
    return IkSamples(
        contact=contact,
        rotations=chains.rotations,
        frames=frames,
        readings=take.readings[frames],
        angles_deg=found.angles_deg[kept],
        sd_deg=(shape.sd_deg * np.sqrt(1 - told))[kept],
        told=told[kept],
        apart_mm=verdict.apart_mm[kept],
        take=_with_reference(take, chains.rotations, frames, found.angles_deg[kept]),
        sentence=_sentence(len(kept), verdict.apart_mm[kept], told[kept], chains.rotations),
    )


def _told(chains: TipChains, contact: Touch | Rod, shape: HandShape, angles_deg: np.ndarray) -> np.ndarray:
    """The share of each joint's variance that goes when the tips are known to touch, (N, K).

    Conditioning a normal density on a contact that is linear nearby: the diagonal of J^+ J, counted in
    standard deviations.
    """
    tips, slopes = chains.tips_and_slopes(angles_deg)
    rows = np.stack([contact.missing(each, frame)[1] for frame, each in enumerate(tips)])
    by_angle = np.einsum("ngcfx,nfxk->ngck", rows, slopes).reshape(len(tips), -1, len(chains.rotations))
    by_sd = by_angle * shape.sd_deg[:, None]
    onto = np.linalg.pinv(by_sd, rcond=SINGULAR) @ by_sd
    return np.clip(np.diagonal(onto, axis1=1, axis2=2), 0.0, 1.0)


def _with_reference(take: Take, rotations: tuple[str, ...], frames: np.ndarray, angles: np.ndarray) -> Take:
    reference = np.full((len(take.time_s), len(rotations)), np.nan)
    reference[frames] = angles
    return replace(take, rotations=rotations, reference_time_s=take.time_s, reference=reference)


def _sentence(frames: int, apart_mm: np.ndarray, told: np.ndarray, rotations: tuple[str, ...]) -> str:
    share = told.mean(axis=0)
    most = rotations[int(share.argmax())]
    left_out = frames - len(apart_mm)
    said = (
        f"{len(apart_mm)} samples of {len(rotations)} rotations: the calibration read the tips "
        f"{np.median(apart_mm):.1f} mm off (median), and the touch tells most about {most} "
        f"({100 * share.max():.0f} % of what was not known of it)"
    )
    return (
        f"{said}; {left_out} of {frames} frames do not fit a touch, or a sensor fails, and are left out."
        if left_out
        else f"{said}."
    )
