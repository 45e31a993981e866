"""Table 4 and Figure 14 of Wang & Neff 2013: time and accuracy of SPGP by its number of pseudo-inputs M.

The subject of ``paper_session``, tried in another wearing: the nine poses of Table 3, and thumb and each
finger touching. Times are CPU seconds of one thread. Of Figure 14 the paper prints curves without numbers. A
rotation that is read from one sensor has at most as many pseudo-inputs as this sensor has readings, so from
M = 300 on only rotations of several sensors grow. All searches start from the exact process, whose training
counts in each of them, and take at most 100 steps. The noise guard decides for each rotation whether its
trained pseudo-inputs are kept (``fitc.judge``).

    python tests/paper/table_4.py
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from paper_session import PaperSession, paper_session

from glovecal_models.calibration.fit_task import FitResult
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.sample_weight import Recorded, Weighted, fit_weighted
from glovecal_models.calibration.training import assemble
from glovecal_models.calibration.training_plan import TrainingPlan, plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.progress import Report
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.spgp import fit_spgp
from glovecal_models.worker_processes import pin_blas_to_one_thread

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
STEPS = 100
SIZES_HZ, SIZES_SAMPLES = 60.0, 2000
"""Of the sampling: what M = 1000 can still be trained on in minutes."""
WEARING = 1
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
class Started:
    """The exact processes of all rotations, from which the searches start."""

    session: PaperSession
    plan: TrainingPlan
    processes: Mapping[str, Weighted]
    train_s: float
    """CPU seconds."""


def table_4(seed: int = 1, report: Report | None = None) -> list[Table4Row]:
    """The paper's rows, smallest M first, and the exact process."""
    sizes: tuple[int | None, ...] = (*SIZES, None)
    rows = []
    for done, size in enumerate(sizes):
        if report:
            report("LMC-GPR" if size is None else f"M = {size}", done / len(sizes))
        rows.append(size_row(started(paper_session(seed, rate_hz=SIZES_HZ, samples=SIZES_SAMPLES)), size))
    return rows


@cache
def started(session: PaperSession) -> Started:
    """Trained exactly."""
    settings = TrainingSettings(method="spgp", samples=session.samples, folds=0)
    begin = time.process_time()
    plan = plan_training(session.taught.takes, session.taught.layout, "anna", settings)
    processes = {
        task.rotation: fit_weighted(Recorded(task.inputs, task.target, task.take, task.position), seed=0)
        for task in plan.tasks
    }
    return Started(session, plan, processes, time.process_time() - begin)


def size_row(
    begun: Started, size: int | None, report: Report | None = None, fingers: str = FINGERS
) -> Table4Row:
    """Train with ``size`` pseudo-inputs (None: exactly) and try."""
    begin = time.process_time()
    trained = _exact(begun) if size is None else _sparse(begun, size, report)
    train_s = begun.train_s + time.process_time() - begin
    results = [
        FitResult(name, None, regressor.arrays(), regressor.settings(), 0.0, 0)
        for name, regressor in trained.items()
    ]
    model = begun.session.taught.finished(assemble(begun.plan, results, take_hashes=()))
    paper = (None, None) if size is None else PAPER[size]
    poses = begun.session.held_poses(WEARING, visit=0)
    found = begun.session.angles("spgp", poses.take.readings, model)
    return Table4Row(
        size=size,
        paper_train_s=paper[0],
        train_s=train_s,
        paper_frame_s=paper[1],
        frame_s=_frame_s(model, poses.take.readings),
        fk_deg=float(np.sqrt(np.mean((found - begun.session.truth(poses)) ** 2))),
        ik_cm=float(np.mean([_apart_cm(begun.session, model, finger) for finger in fingers])),
        rotations=len(trained),
        kept=sum(_is_kept(regressor) for regressor in trained.values()),
    )


def _exact(begun: Started) -> dict[str, ProcessRegressor]:
    return {name: process.regressor for name, process in begun.processes.items()}


def _sparse(begun: Started, size: int, report: Report | None) -> dict[str, ProcessRegressor]:
    trained = {}
    for done, task in enumerate(begun.plan.tasks):
        if report:
            report(f"M = {size}: {task.rotation}", done / len(begun.plan.tasks))
        start = begun.processes[task.rotation]
        trained[task.rotation] = fit_spgp(
            task.inputs,
            task.target,
            pseudo_inputs=size,
            iterations=STEPS,
            start=start.regressor,
            sample_weight=start.weight,
        )
    return trained


def _is_kept(regressor: ProcessRegressor) -> bool:
    return bool(regressor.evidence.get("guard", {}).get("accepted"))


def _frame_s(model: CalibrationModel, readings: np.ndarray) -> float:
    predictor = GlovePredictor(model)
    predictor.predict(readings[:1])
    begin = time.process_time()
    for frame in range(TIMED_FRAMES):
        predictor.predict(readings[frame : frame + 1])
    return (time.process_time() - begin) / TIMED_FRAMES


def _apart_cm(session: PaperSession, model: CalibrationModel, finger: str) -> float:
    readings = session.touching(finger, WEARING).take.readings
    return float(session.tip_distance_cm(finger, session.angles("spgp", readings, model)).mean())


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
