"""The subject of the paper's results: one simulated person, sampled once by the guided protocol.

Stable interface for the tables and pictures: ``paper_session(seed)``, and on it ``angles`` by name of the
calibration, ``model``, ``fit`` for other settings, ``tuples`` of one rotation, ``glove`` of a wearing,
``held_poses``, ``fixed_abduction`` and ``touching`` for evaluation.

As in the paper: samples of poses, widgets and touches, once (section 5; five minutes at most), trained once;
evaluated in other wearings and motions (section 8.2). The key poses' angles were measured once; taken again
they are 2.5 degrees off. ``raw`` is the glove's own scale, ``linear`` a line for each sensor through the key
poses (section 7.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from asked_session import AT_ONCE_S, RECORDING, asked_session

from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import Samples, gather_samples
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HAND_ROTATIONS, completed
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.layout import Layout
from glovecal_models.sampling.catalogue import Equipment, make_protocol
from glovecal_models.sampling.guided.guided_calibration import GuidedSamples, guided_samples
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.inverse_kinematics.contact import TipChains
from glovecal_models.sampling.inverse_kinematics.follow import steadied
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.simulation.protocol import Segment, cross_couple_segment, evaluation_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, SimulatedTake, simulate_take
from glovecal_models.simulation.simulated_hand import KEY_POSES, POSTURES
from glovecal_models.simulation.touching import touching_segment
from glovecal_models.typical_counts import raw_angles

CALIBRATIONS: tuple[Method, ...] = ("raw", "linear", "lmc_gpr", "spgp")
LAYOUT = Layout.built_in("cyberglove18")
SKELETON = hand_skeleton(HandDimensions.from_measured({"hand_length": 182}))
SAMPLING_HZ = 120.0
SAMPLES = 2500
"""At most, for one rotation; the paper has 2000 and more for a coupled one."""
EVALUATION_HZ = 60.0
TOUCHING_FRAMES = 176
OFFLINE_S = 0.5
"""An offline calibration may look ahead: each angle is the middle of a parabola over so long."""
EQUIPMENT = Equipment(pose_deg={pose: POSTURES[pose] for pose in KEY_POSES})


@dataclass(frozen=True, eq=False)
class PaperSession:
    seed: int
    layout: Layout
    skeleton: Skeleton
    takes: tuple[LabelledTake, ...]
    """As the sampling recorded them."""
    capture_s: float
    """What the sampling took, in the protocol's own clock."""
    taught: GuidedSamples
    """What they teach."""
    samples: int
    """At most, for one rotation, in training."""
    models: dict[tuple[str, int], CalibrationModel] = field(default_factory=dict)
    """Trained so far."""
    recorded: dict[tuple[Any, ...], SimulatedTake] = field(default_factory=dict)
    """For evaluation, so far."""

    def glove(self, wearing: int = 0) -> SimulatedGlove:
        """The subject's glove; it was sampled in wearing 0."""
        return SimulatedGlove(self.seed, self.layout, wearing=wearing)

    def fit(self, settings: TrainingSettings) -> CalibrationModel:
        """Trained on all samples, with the paper's two passes; ``linear`` on the key poses alone."""
        if settings.method == "linear":
            key_poses = [each.take for each in self.takes if each.kind == "fk_independent"]
            return train(key_poses, self.layout, "anna", settings)
        return self.taught.finished(train(self.taught.takes, self.taught.layout, "anna", settings))

    def model(self, method: Method, pseudo_inputs: int = 100) -> CalibrationModel:
        """Trained when it is first asked for. ``raw`` has none."""
        key = (method, pseudo_inputs if method == "spgp" else 0)
        if key not in self.models:
            self.models[key] = self.fit(
                TrainingSettings(method, samples=self.samples, folds=0, pseudo_inputs=pseudo_inputs)
            )
        return self.models[key]

    def angles(
        self, method: Method, readings: np.ndarray, model: CalibrationModel | None = None
    ) -> np.ndarray:
        """(N, 22) degrees in the order of ``HAND_ROTATIONS``, frame by frame; by ``model`` where given."""
        if method == "raw":
            return completed(self.layout.rotations, raw_angles(self.layout, readings))
        predictor = GlovePredictor(model or self.model(method))
        return completed(predictor.rotations, predictor.predict(readings).mean)

    def tuples(self, rotation: str) -> Samples:
        """The paper's (readings, observed rotation) of one rotation, all there are."""
        return gather_samples(self.taught.takes, self.taught.layout.correspondence(rotation))

    def truth(self, taken: SimulatedTake) -> np.ndarray:
        """(N, 22), what the hand really did."""
        return taken.truth[:, [self.layout.rotations.index(name) for name in HAND_ROTATIONS]]

    def held_poses(self, wearing: int, visit: int) -> SimulatedTake:
        """The nine poses of Table 3, each held for a second, never quite as before."""
        seed = 1000 * (self.seed + 1) + visit
        return self._recorded(lambda: evaluation_segment(seed), wearing, seed)

    def fixed_abduction(self, angle_deg: float, wearing: int) -> SimulatedTake:
        """Fingers bending freely while all gaps between them are held; four seconds (Figure 11)."""
        seed = 5000 + self.seed
        return self._recorded(lambda: cross_couple_segment(seed, angle_deg), wearing, seed, angle_deg)

    def touching(self, finger: str, wearing: int) -> SimulatedTake:
        """176 frames in which thumb and ``finger`` touch, other than any in training (Figure 12)."""
        seed, seconds = 9000 + self.seed, TOUCHING_FRAMES / EVALUATION_HZ
        hand = self.glove(wearing).hand
        return self._recorded(
            lambda: touching_segment(hand, self.skeleton, finger, seed, seconds), wearing, seed, finger
        )

    def _recorded(
        self, motion: Callable[[], Segment], wearing: int, seed: int, what: object = None
    ) -> SimulatedTake:
        key = (wearing, seed, what)
        if key not in self.recorded:
            glove = self.glove(wearing)
            self.recorded[key] = simulate_take(glove, motion(), seed=seed, rate_hz=EVALUATION_HZ)
        return self.recorded[key]

    def tip_distance_cm(self, finger: str, angles_deg: np.ndarray) -> np.ndarray:
        """(N,) between the tips of thumb and ``finger``, from angles (N, 22)."""
        chains = TipChains(self.skeleton, ("T", finger))
        tips = chains.tips_mm(angles_deg[:, chains.columns])
        return np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1) / 10


@cache
def paper_session(
    seed: int = 1, *, rate_hz: float = SAMPLING_HZ, samples: int = SAMPLES, at_once_s: float = AT_ONCE_S
) -> PaperSession:
    """The subject of ``seed``, sampled and taught; models are trained when they are asked for.

    The full session takes about a minute; ``rate_hz=30``, few ``samples`` and a person who listens less often
    (``at_once_s``) make a cheap one for tests.
    """
    protocol = make_protocol("new_subject", LAYOUT, EQUIPMENT)
    session = asked_session(
        protocol,
        SimulatedGlove(seed, LAYOUT),
        seed=seed,
        rate_hz=rate_hz,
        skeleton=SKELETON,
        at_once_s=at_once_s,
    )
    cut = sampled_takes(session.state, {RECORDING: session.take}, name="sampling")
    takes = tuple(LabelledTake.of(each) for each in cut)
    taught = guided_samples(takes, LAYOUT, SKELETON)
    return PaperSession(seed, LAYOUT, SKELETON, takes, session.state.capture_s, taught, samples)


def offline(angles_deg: np.ndarray, rate_hz: float = EVALUATION_HZ) -> np.ndarray:
    """Angles (N, R) without the sensors' noise, as a recording may be cleaned afterwards."""
    return steadied(np.arange(len(angles_deg)) / rate_hz, angles_deg, OFFLINE_S)
