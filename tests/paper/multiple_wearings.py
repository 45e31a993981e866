"""Multiple wearings (Wang & Neff 2013, section 8.2): one training, the glove put on again and again.

The paper says that the calibration of one session serves others and gives no number. Here: the mean absolute
error over the nine poses of Table 3 and all 22 rotations, by wearing, with the calibration of wearing 0; and
after the quick check of four held poses (half a minute). The poses are the subject's own, 2.5 degrees off
each time; a wearing of this glove moves readings by 0.6 degrees: poses can correct little of that.

    python tests/paper/multiple_wearings.py
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from asked_session import RECORDING, asked_session
from paper_session import LAYOUT, SKELETON, PaperSession, paper_session
from table_3 import PAPER_DEG, SETTLED

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.samples import sensor_sensitivity
from glovecal_models.hand.rotations import completed
from glovecal_models.quick_check.held_poses import own_poses
from glovecal_models.quick_check.quick_check import quick_check
from glovecal_models.sampling.catalogue import make_protocol
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.takes.take import Take

WEARINGS = (0, 1, 2, 3, 4, 5)
SEEDS = (1, 2, 3)
CHECK_HZ = 60.0


@dataclass(frozen=True)
class WearingRow:
    """Mean absolute errors, degrees."""

    seed: int
    wearing: int
    """0 is that of training."""
    mean_deg: float
    checked_deg: float | None
    """After the quick check; None in the wearing of training, which needs none, and where no pose was held
    steadily enough for the protocol to accept it."""


def multiple_wearings(
    session: PaperSession, wearings: Sequence[int] = WEARINGS, visits: int = 2
) -> list[WearingRow]:
    """By LMC-GPR."""
    model = session.model("lmc_gpr")
    return [
        WearingRow(
            session.seed,
            wearing,
            mean_error_deg(session, model, wearing, visits),
            _checked_deg(session, model, wearing, visits) if wearing else None,
        )
        for wearing in wearings
    ]


def _checked_deg(session: PaperSession, model: CalibrationModel, wearing: int, visits: int) -> float | None:
    after = checked(session, model, wearing)
    return None if after is None else mean_error_deg(session, after, wearing, visits)


def checked(session: PaperSession, model: CalibrationModel, wearing: int) -> CalibrationModel | None:
    """After the protocol of a second wearing; None where it accepted no pose."""
    held = asked_session(
        make_protocol("second_wearing", LAYOUT),
        session.glove(wearing),
        seed=100 * session.seed + wearing,
        rate_hz=CHECK_HZ,
        skeleton=SKELETON,
    )
    cut = sampled_takes(held.state, {RECORDING: held.take}, name="check")
    takes = [each.take for each in cut if each.kind == "verification"]
    if not takes:
        return None
    sensitivity = sensor_sensitivity(model)
    ranges = dict(zip(sensitivity.sensors, sensitivity.range.tolist(), strict=True))
    known = own_poses([each.take for each in session.takes], ranges)
    return quick_check(model, takes, known=known).model


def mean_error_deg(session: PaperSession, model: CalibrationModel, wearing: int, visits: int) -> float:
    """Over poses, visits and rotations, of the means over each hold."""
    errors = []
    for visit in range(visits):
        taken = session.held_poses(wearing, visit)
        found, truth = _angles(model, taken.take), session.truth(taken)
        for pose in PAPER_DEG:
            named = enumerate(taken.take.poses or ())
            held = [frame for frame, name in named if name == pose][SETTLED:]
            errors.append(np.abs(found[held].mean(axis=0) - truth[held].mean(axis=0)))
    return float(np.mean(errors))


def _angles(model: CalibrationModel, take: Take) -> np.ndarray:
    """(N, 22), effects included."""
    predictor = GlovePredictor(model)
    angles = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing)
    return completed(predictor.rotations, angles.mean)


def main() -> None:
    print("Multiple wearings: mean |error| in degrees over nine poses and 22 rotations, LMC-GPR of wearing 0")
    print(f"{'subject':>7} {'wearing':>8} {'as it is':>9} {'quick check':>12}")
    for seed in SEEDS:
        for row in multiple_wearings(paper_session(seed)):
            after = "" if row.checked_deg is None else f"{row.checked_deg:.2f}"
            print(f"{row.seed:>7} {row.wearing:>8} {row.mean_deg:>9.2f} {after:>12}")


if __name__ == "__main__":
    main()
