"""Gloves of the camera's study: simulated, measured once by their usual reference and once by a camera."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from blind_glove import BlindGlove, Nuisance
from simulated_camera import ON_OTHER_HANDS, SimulatedCamera, lasting_noise

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.protocol import evaluation_segment, sampling_protocol
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.camera_estimates import CameraEstimates, covered_ranges
from glovecal_models.takes.camera_reference import camera_clock, reference_from_camera
from glovecal_models.takes.take import Take

MEASURED = ON_OTHER_HANDS
TRUE_SIZE, CAMERA_SIZE = 1.3, 2.6
"""Strength of the hidden effect in noise floors: of the glove's usual reference, and twice that."""
NUISANCES: tuple[Nuisance, ...] = ("drift", "white", "posture")
FEWEST_SAMPLES = 15
"""Effective ones of a rotation that is trained by the camera."""
FIRST_SEED = 5000
"""Gloves of smaller seeds were looked at while the limits were chosen."""


@dataclass(frozen=True)
class CameraGlove:
    """One glove, with one hidden effect or none."""

    effect: str
    number: int
    camera: SimulatedCamera = MEASURED

    def glove(self, size: float) -> BlindGlove:
        clean = BlindGlove(
            part="camera", truth=self.effect, number=self.number, size=size, seed=FIRST_SEED + self.number,
            rate_hz=100.0, nuisance=NUISANCES[self.number % len(NUISANCES)],
        )  # fmt: skip
        if self.effect == "none":
            return clean
        return replace(clean, causes=(Cause(self.effect, strength_deg=size * clean.floor_deg),))

    def named(self) -> dict[str, Any]:
        """What is named by the usual reference at one size, and by the camera at twice that."""
        usual, twice = self.glove(TRUE_SIZE), self.glove(CAMERA_SIZE)
        true = diagnose(usual.takes, usual.layout)
        seen = diagnose(seen_takes(twice, self.camera), twice.layout)
        return {
            "effect": self.effect,
            "number": self.number,
            "true": None if true.named is None else true.named.effect,
            "camera": None if seen.named is None else seen.named.effect,
            "camera_set": [] if seen.named is None else list(seen.named.confidence_set),
            "camera_finding": [] if seen.camera is None else list(seen.camera.joints),
            "alarm_true": true.residual.is_significant,
            "alarm_camera": seen.residual.is_significant,
        }


def seen_takes(glove: BlindGlove, camera: SimulatedCamera) -> list[Take]:
    """The glove's takes with the camera as their reference, clocks found anew in each; one whose clock is not
    found is refused, and left out."""
    found = []
    for number, (take, truth) in enumerate(zip(glove.session.takes, glove.session.truth, strict=True)):
        seed = 100 * glove.seed + number
        with suppress(BadInput):
            found.append(with_camera(take, truth, glove.plan.rotations, camera, glove.seed, seed))
    return found


def with_camera(
    take: Take, truth: np.ndarray, rotations: Sequence[str], camera: SimulatedCamera, hand: int, seed: int
) -> Take:
    """``hand``: whose it is; the part of the camera's errors that stays is the same in all its takes."""
    columns = [rotations.index(name) for name in take.rotations]
    seen = replace(camera, hand=hand).see(take.time_s, truth[:, columns], take.rotations, seed)
    return reference_from_camera(take, seen).take


@dataclass(frozen=True)
class CalibratedGlove:
    """Trained on the first wearing, by true angles and by the camera; judged on the second."""

    number: int
    camera: SimulatedCamera = MEASURED

    def of_cyberglove(self, method: Method) -> dict[str, Any]:
        """18 sensors, cloth that couples them, another fit in the second wearing; 40 s of the protocol."""
        seed = FIRST_SEED + 500 + self.number
        first = simulate_take(
            SimulatedGlove(seed=seed),
            sampling_protocol(seed),
            seed=seed,
            rate_hz=100.0,
            reference_noise_deg=0.0,
        ).take
        again = SimulatedGlove(seed=seed, wearing=1)
        test = simulate_take(
            again, evaluation_segment(seed), seed=seed, rate_hz=100.0, reference_noise_deg=0.0
        ).take
        fingers = [name for name in first.rotations if not name.startswith("WRIST")]
        kept = [first.rotations.index(name) for name in fingers]
        estimates = replace(self.camera, hand=seed).see(
            first.time_s, first.reference[:, kept], tuple(fingers), seed
        )
        seen = _teachable(reference_from_camera(first, estimates).take)
        layout = Layout.built_in("cyberglove18")
        return {"glove": "cyberglove", **self._errors([first], [seen], [test], layout, method)}

    def of_steady(self, method: Method) -> dict[str, Any]:
        """Five sensors that fit the same in both wearings; 160 s of the first."""
        nuisance = NUISANCES[self.number % len(NUISANCES)]
        assert nuisance != "reference"
        plan = SessionPlan(seed=FIRST_SEED + 500 + self.number, wearings=2, rate_hz=100.0, nuisance=nuisance)
        session = record_session(plan)
        true = [
            replace(take, reference=truth) for take, truth in zip(session.takes, session.truth, strict=True)
        ]
        first = [take for take in true if take.wearing == "wearing-1"]
        seen = [
            with_camera(
                take, take.reference, plan.rotations, self.camera, plan.seed, 1000 * plan.seed + number
            )
            for number, take in enumerate(first)
        ]
        layout = Layout.from_columns("five", plan.sensors, plan.rotations)
        return {"glove": "steady", **self._errors(first, seen, true[len(first) :], layout, method)}

    def _errors(
        self, true: list[Take], seen: list[Take], test: list[Take], layout: Layout, method: Method
    ) -> dict[str, Any]:
        """RMSE against the true angles of ``test``, inside the ranges that the camera accepted."""
        ranges = {item.rotation: item for item in covered_ranges(seen, seen[0].rotations)}
        settings = TrainingSettings(method=method, folds=0, samples=1000)
        rmse = {}
        for kind, takes in (("true", true), ("camera", seen)):
            try:
                model = train(takes, layout, "anna", settings)
            except NotTrainable:
                return {"number": self.number, "method": method, "true": None, "camera": None, "ratio": None}
            predictor, squares = GlovePredictor(model), []
            for take in test:
                mean = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing).mean
                for name in set(ranges) & set(predictor.rotations):
                    angle = take.reference[:, take.rotations.index(name)]
                    inside = ranges[name].holds(angle)
                    squares.append((mean[inside, predictor.rotations.index(name)] - angle[inside]) ** 2)
            rmse[kind] = float(np.sqrt(np.concatenate(squares).mean()))
        return {"number": self.number, "method": method, **rmse, "ratio": rmse["camera"] / rmse["true"]}


def _teachable(take: Take) -> Take:
    """Without rotations of which the camera accepted too little to train on: some DIP joints."""
    found = {item.rotation: item.effective_samples for item in covered_ranges([take], take.rotations)}
    kept = [number for number, name in enumerate(take.rotations) if found.get(name, 0) >= FEWEST_SAMPLES]
    assert take.reference_sd is not None
    return replace(
        take,
        rotations=tuple(take.rotations[number] for number in kept),
        reference=take.reference[:, kept],
        reference_sd=take.reference_sd[:, kept],
    )


def clock_error(number: int, motion: str) -> dict[str, Any]:
    """30 s: all accepted at 30 Hz with 6 degrees of noise that lasts 0.3 s, against a glove at 100 Hz."""
    seed = FIRST_SEED + number
    assert motion in ("natural", "fast")
    session = record_session(
        SessionPlan(seed=seed, wearings=1, takes_per_wearing=1, take_s=30.0, rate_hz=100.0, motions=(motion,))
    )
    take, truth = session.takes[0], session.truth[0]
    random = np.random.default_rng([seed, 9])
    offset = random.uniform(-1.0, 1.0)
    at = np.arange(random.uniform(0.0, 1 / 30.0), 30.0, 1 / 30.0)
    angles = np.column_stack([np.interp(at, take.time_s, column) for column in truth.T])
    angles += 6.0 * lasting_noise(at, angles.shape[1], 0.15, random)
    clock = camera_clock(
        take,
        CameraEstimates(
            at + offset, take.sensors, angles, np.full_like(angles, 6.0), np.ones(angles.shape, dtype=bool),
            np.full(len(at), -1), simulated=True,
        ),
    )  # fmt: skip
    return {"number": number, "motion": motion, "error_s": clock.offset_s - offset, "sd_s": clock.sd_s}
