"""Figure 11 of Wang & Neff 2013: the gap between index and middle finger, held while the fingers bend freely.

0 degrees are among the widgets of training, 25 are not. The paper draws curves and gives no numbers but says
that raw and linear are unstable and that at 25 degrees the predicted values are slightly too small. A single
frame has the noise of three sensors, about a degree; ``offline_sd_deg`` is of the same angles cleaned over
half a second, what the calibration itself leaves.

    python tests/paper/figure_11.py [PICTURE.png]
"""

# pyright: reportMissingImports=false

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from paper_session import CALIBRATIONS, EVALUATION_HZ, PaperSession, offline, paper_session

from glovecal_models.calibration.methods import Method
from glovecal_models.hand.rotations import HAND_ROTATIONS

ANGLES_DEG = (0.0, 25.0)
SEEDS, WEARINGS = (1, 2, 3), (0, 1)
BLEND_S = 0.4
"""The hand starts and ends flat, its gaps not yet at the widget."""
COLUMN = HAND_ROTATIONS.index("IM_ABD")


@dataclass(frozen=True)
class Figure11Row:
    """Of the calibrated angle IM_ABD, degrees."""

    seed: int
    wearing: int
    """0 is that of training."""
    fixed_deg: float
    calibration: Method
    bias_deg: float
    sd_deg: float
    """Frame by frame."""
    offline_sd_deg: float


def figure_11(sessions: Sequence[PaperSession], wearings: Sequence[int] = WEARINGS) -> list[Figure11Row]:
    return [
        _row(session, wearing, angle, method)
        for session in sessions
        for wearing in wearings
        for angle in ANGLES_DEG
        for method in CALIBRATIONS
    ]


def curve(session: PaperSession, wearing: int, fixed_deg: float, method: Method) -> np.ndarray:
    """(N,) degrees while the widget holds, frame by frame."""
    taken = session.fixed_abduction(fixed_deg, wearing)
    found = session.angles(method, taken.take.readings)[:, COLUMN]
    return found[_held()]


def _held() -> slice:
    blend = round(BLEND_S * EVALUATION_HZ)
    return slice(blend, -blend)


def _row(session: PaperSession, wearing: int, fixed_deg: float, method: Method) -> Figure11Row:
    error = curve(session, wearing, fixed_deg, method) - fixed_deg
    clean = offline(error[:, None])
    return Figure11Row(
        session.seed, wearing, fixed_deg, method, float(error.mean()), float(error.std()), float(clean.std())
    )


def picture(session: PaperSession, path: Path, wearing: int = 1) -> None:
    """Four curves for each angle, as PNG."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(ANGLES_DEG), figsize=(11, 4), sharey=True, constrained_layout=True)
    for axis, angle in zip(axes, ANGLES_DEG, strict=True):
        for method in CALIBRATIONS:
            angles = curve(session, wearing, angle, method)
            axis.plot(np.arange(len(angles)) / EVALUATION_HZ, angles, label=method, linewidth=1)
        axis.axhline(angle, color="black", linewidth=0.8, linestyle="--", label="held by the widget")
        axis.set(title=f"index to middle held at {angle:g} degrees", xlabel="time, s")
    axes[0].set_ylabel("calibrated IM_ABD, degrees")
    axes[0].legend()
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(arguments: Sequence[str]) -> None:
    sessions = [paper_session(seed) for seed in SEEDS]
    print("Figure 11: IM_ABD held while fingers bend, degrees (simulated glove; must: bias and sd up to 1)")
    head = f"{'subject':>7} {'wearing':>8} {'held':>5} {'calibration':<12}"
    print(f"{head} {'bias':>6} {'sd':>5} {'offline sd':>10}")
    for row in figure_11(sessions):
        wearing = "same" if row.wearing == 0 else "other"
        print(
            f"{row.seed:>7} {wearing:>8} {row.fixed_deg:>5g} {row.calibration:<12} {row.bias_deg:>6.2f} "
            f"{row.sd_deg:>5.2f} {row.offline_sd_deg:>10.2f}"
        )
    if arguments:
        picture(sessions[0], Path(arguments[0]))


if __name__ == "__main__":
    main(sys.argv[1:])
