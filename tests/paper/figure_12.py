"""Figure 12 of Wang & Neff 2013: how far apart fingertips are read that touch, in 176 frames of motion.

Another touching motion of the same person than any in training. The paper gives thumb and index: 7.53 cm raw,
5.25 linear, 0.08 LMC-GPR, 1.75 SPGP; it does not say whether that motion was among the samples. Frame by
frame the noise of ten sensors alone puts tips 0.25 cm apart; ``offline_cm`` is of the same angles cleaned
over half a second, as the paper calibrates anew with full LMC-GPR offline.

    python tests/paper/figure_12.py [PICTURE.png]
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from paper_session import CALIBRATIONS, PaperSession, offline, paper_session

from glovecal_models.calibration.methods import Method
from glovecal_models.hand.rotations import FINGERS

PAPER_CM: dict[str, tuple[float, float, float, float]] = {"I": (7.53, 5.25, 0.08, 1.75)}
"""Means by finger in the order of ``CALIBRATIONS``; of the others the paper draws boxes only."""
TOUCHED = "IMRP"
SEEDS, WEARINGS = (1, 2, 3), (0, 1)


@dataclass(frozen=True)
class Figure12Row:
    """Distance of the tips of thumb and one finger, cm."""

    seed: int
    wearing: int
    """0 is that of training."""
    finger: str
    calibration: Method
    paper_cm: float | None
    mean_cm: float
    quartiles_cm: tuple[float, float, float]
    """25, 50 and 75 %."""
    offline_cm: float
    """Mean of the cleaned angles'."""


def figure_12(sessions: Sequence[PaperSession], wearings: Sequence[int] = WEARINGS) -> list[Figure12Row]:
    return [
        _row(session, wearing, finger, method)
        for session in sessions
        for wearing in wearings
        for finger in TOUCHED
        for method in CALIBRATIONS
    ]


def distances(session: PaperSession, wearing: int, finger: str, method: Method) -> tuple[np.ndarray, ...]:
    """Two of (176,), cm: frame by frame, and offline."""
    angles = session.angles(method, session.touching(finger, wearing).take.readings)
    return tuple(session.tip_distance_cm(finger, each) for each in (angles, offline(angles)))


def _row(session: PaperSession, wearing: int, finger: str, method: Method) -> Figure12Row:
    apart, cleaned = distances(session, wearing, finger, method)
    low, middle, high = np.quantile(apart, (0.25, 0.5, 0.75)).tolist()
    paper = PAPER_CM[finger][CALIBRATIONS.index(method)] if finger in PAPER_CM else None
    return Figure12Row(
        session.seed,
        wearing,
        finger,
        method,
        paper,
        float(apart.mean()),
        (low, middle, high),
        float(cleaned.mean()),
    )


def picture(session: PaperSession, path: Path, wearing: int = 0) -> None:
    """Box plots like the paper's, one panel a finger, as PNG."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(TOUCHED), figsize=(12, 4), sharey=True, constrained_layout=True)
    for axis, finger in zip(axes, TOUCHED, strict=True):
        boxes = [distances(session, wearing, finger, method)[0] for method in CALIBRATIONS]
        axis.boxplot(boxes, whis=(0, 100))
        axis.set_xticks(range(1, len(CALIBRATIONS) + 1), CALIBRATIONS)
        axis.set(title=f"thumb and {FINGERS[finger]}", yscale="log")
    axes[0].set_ylabel("distance of the tips, cm (ideal: 0)")
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: Sequence[str]) -> None:
    sessions = [paper_session(seed) for seed in SEEDS]
    rows = figure_12(sessions)
    print(f"Figure 12: tips that touch, mean distance in cm over {len(SEEDS)} simulated subjects")
    print("frame by frame | offline (must: LMC-GPR up to 0.1, SPGP up to 0.5)")
    head = f"{'wearing':<8} {'thumb and':<10} {'calibration':<12} {'paper':>6}"
    print(f"{head} {'mean':>6} {'offline':>8} {'worst':>6}")
    for wearing in WEARINGS:
        for finger in TOUCHED:
            for method in CALIBRATIONS:
                own = [r for r in rows if (r.wearing, r.finger, r.calibration) == (wearing, finger, method)]
                paper = "" if own[0].paper_cm is None else f"{own[0].paper_cm:.2f}"
                mean = float(np.mean([row.mean_cm for row in own]))
                clean = [row.offline_cm for row in own]
                print(
                    f"{'other' if wearing else 'same':<8} {FINGERS[finger]:<10} {method:<12} {paper:>6} "
                    f"{mean:>6.2f} {np.mean(clean):>8.3f} {max(clean):>6.3f}"
                )
    if arguments:
        picture(sessions[0], Path(arguments[0]))


if __name__ == "__main__":
    main(sys.argv[1:])
