"""Table 4 and Figure 14 of Wang & Neff 2013: time and accuracy of SPGP by its number of pseudo-inputs M.

One simulated glove, trained as the paper trains (key poses, widgets, thumb and wrist, then touches with
angles from inverse kinematics), tried in another wearing: the nine poses of Table 3, and thumb and each
finger touching. Times are CPU seconds of one thread. Of Figure 14 the paper prints curves without numbers. A
rotation that is read from one sensor has at most as many pseudo-inputs as this sensor has readings, so from
M = 300 on only rotations of several sensors grow. The noise guard decides for each rotation whether its
trained pseudo-inputs are kept (``noise_guard``).

    python tests/paper/table_4.py
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import Report, TrainingSettings
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.inverse_kinematics.contact import Touch
from glovecal_models.inverse_kinematics.ik_samples import ik_samples
from glovecal_models.inverse_kinematics.predicted_hand import predicted_hand
from glovecal_models.inverse_kinematics.tip_chains import TipChains
from glovecal_models.simulation.protocol import evaluation_segment, sampling_protocol
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.simulation.simulated_take import SimulatedTake, simulate_take
from glovecal_models.simulation.touching import touching_segment
from glovecal_models.takes.take import Take
from glovecal_models.threads import pin_blas_to_one_thread

SIZES = (20, 50, 100, 300, 500, 1000)
PAPER: dict[int, tuple[float, float]] = {
    1000: (657.572, 0.745),
    500: (67.439, 0.187),
    300: (32.027, 0.078),
    100: (9.721, 0.018),
    50: (7.557, 0.016),
    20: (6.224, 0.016),
}
"""Training time of a glove and prediction time of a frame, seconds; 0.016 stands for "at most 0.016"."""
QUICK_SAMPLES, SAMPLES = 120, 2000
HAND_MM = 182.0
RATE_HZ, TOUCH_S = 60.0, 176 / 60.0
TIMED_FRAMES = 300
FINGERS = "IMRP"
"""That the thumb touches."""


@dataclass(frozen=True)
class Table4Row:
    size: int | None
    """M; None for the exact process that SPGP approximates."""
    paper_train_s: float | None
    train_s: float
    """CPU seconds of a whole glove."""
    paper_frame_s: float | None
    frame_s: float
    """CPU seconds of one frame of a whole glove, with standard deviations."""
    fk_deg: float
    """RMSE over all rotations in the nine poses."""
    ik_cm: float
    """Mean distance of thumb and fingertip while they touch, over four fingers."""
    rotations: int
    kept: int
    """Rotations whose trained pseudo-inputs the noise guard kept."""


@dataclass(frozen=True)
class Trial:
    """What is trained on, and what is tried."""

    takes: Sequence[Take]
    poses: SimulatedTake
    touches: dict[str, SimulatedTake]
    glove: SimulatedGlove
    hand: Skeleton


def table_4(seed: int = 1, quick: bool = False, report: Report | None = None) -> list[Table4Row]:
    """The paper's rows, smallest M first, and the exact process."""
    sizes: tuple[int | None, ...] = (*SIZES, None)
    rows = []
    for done, size in enumerate(sizes):
        if report:
            report("LMC-GPR" if size is None else f"M = {size}", done / len(sizes))
        rows.append(size_row(trial(seed), size, QUICK_SAMPLES if quick else SAMPLES))
    return rows


@cache
def trial(seed: int, fingers: str = FINGERS) -> Trial:
    first, second = SimulatedGlove(seed), SimulatedGlove(seed, wearing=1)
    hand = hand_skeleton(HandDimensions.from_measured({"hand_length": HAND_MM}))
    segments = sampling_protocol(seed)
    fk = [_measured(simulate_take(first, segment, seed=seed, rate_hz=RATE_HZ).take) for segment in segments]
    before = train(fk, first.layout, "subject", TrainingSettings(samples=300, folds=0))
    ik = [
        ik_samples(_touching(first, hand, finger, seed).take, before, hand, Touch(("T", finger))).take
        for finger in fingers
    ]
    poses = simulate_take(second, evaluation_segment(seed), seed=seed, rate_hz=RATE_HZ)
    touches = {finger: _touching(second, hand, finger, seed + 1) for finger in fingers}
    return Trial((*fk, *ik), poses, touches, second, hand)


def size_row(
    made: Trial, size: int | None, samples: int = SAMPLES, report: Report | None = None
) -> Table4Row:
    """Train with ``size`` pseudo-inputs (None: exactly) and try."""
    settings = TrainingSettings(method="lmc_gpr", samples=samples, folds=0)
    if size is not None:
        settings = replace(settings, method="spgp", pseudo_inputs=size)
    begin = time.process_time()
    model = train(made.takes, made.glove.layout, "subject", settings, report=report)
    train_s = time.process_time() - begin
    paper = (None, None) if size is None else PAPER[size]
    guarded = [
        rotation.regressor.settings()["evidence"]["guard"]["accepted"]
        for rotation in model.rotations
        if rotation.regressor.method == "spgp"
    ]
    return Table4Row(
        size=size,
        paper_train_s=paper[0],
        train_s=train_s,
        paper_frame_s=paper[1],
        frame_s=_frame_s(model, made.poses.take.readings),
        fk_deg=_fk_deg(model, made),
        ik_cm=float(np.mean([_apart_cm(model, made, finger) for finger in made.touches])),
        rotations=len(model.rotations),
        kept=sum(guarded),
    )


def _measured(take: Take) -> Take:
    """Without the joints that have no sensor: nobody measures these before the touches."""
    names = [name for name in take.rotations if not name.endswith(("DIP", "VIR"))]
    columns = [take.rotations.index(name) for name in names]
    return replace(take, rotations=tuple(names), reference=take.reference[:, columns])


def _touching(glove: SimulatedGlove, hand: Skeleton, finger: str, seed: int) -> SimulatedTake:
    segment = touching_segment(glove.hand, hand, finger, seed, TOUCH_S)
    return simulate_take(glove, segment, seed=seed, rate_hz=RATE_HZ)


def _frame_s(model: CalibrationModel, readings: np.ndarray) -> float:
    predictor = GlovePredictor(model)
    predictor.predict(readings[:1])
    begin = time.process_time()
    for frame in range(TIMED_FRAMES):
        predictor.predict(readings[frame : frame + 1])
    return (time.process_time() - begin) / TIMED_FRAMES


def _fk_deg(model: CalibrationModel, made: Trial) -> float:
    names = [name for name in model.rotation_names if name in made.glove.rotations]
    predicted = GlovePredictor(model).predict(made.poses.take.readings).mean
    found = predicted[:, [model.rotation_names.index(name) for name in names]]
    true = made.poses.truth[:, [made.glove.rotations.index(name) for name in names]]
    return float(np.sqrt(np.mean((found - true) ** 2)))


def _apart_cm(model: CalibrationModel, made: Trial, finger: str) -> float:
    chains = TipChains(made.hand, ("T", finger))
    angles = predicted_hand(made.touches[finger].take, model).mean_deg[:, chains.columns]
    tips = chains.tips_mm(angles)
    return float(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1).mean()) / 10


def main() -> None:
    pin_blas_to_one_thread()
    print("Table 4 and Figure 14: paper (Core 2 Duo) | ours (simulated glove, CPU seconds of this machine)")
    print(f"{'M':>7} {'training s':>16} {'frame ms':>16} {'FK degrees':>11} {'IK cm':>6} {'kept':>9}")
    for row in table_4():
        training = f"{row.paper_train_s:.1f}" if row.paper_train_s else "-"
        frame = f"{1e3 * row.paper_frame_s:.0f}" if row.paper_frame_s else "-"
        print(
            f"{row.size or 'LMC-GPR':>7} {training + f' | {row.train_s:.1f}':>16} "
            f"{frame + f' | {1e3 * row.frame_s:.2f}':>16} {row.fk_deg:>11.2f} {row.ik_cm:>6.2f} "
            f"{row.kept:>3} of {row.rotations}"
        )


if __name__ == "__main__":
    main()
