"""What is computed of one subject: Table 3, Figures 11 and 12 and the wearings share its training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from figure_11 import ANGLES_DEG, curve, figure_11
from figure_12 import figure_12
from multiple_wearings import WEARINGS, multiple_wearings
from paper_session import CALIBRATIONS, EVALUATION_HZ, PaperSession, paper_session
from table_3 import table_3

from glovecal_models.calibration.methods import Method
from glovecal_models.progress import Report

QUICK_HZ, QUICK_SAMPLES = 30.0, 120
QUICK_WEARINGS = (0, 1)
OTHER_WEARING = 1


@dataclass(frozen=True)
class Curve:
    """Of Figure 11."""

    seed: int
    fixed_deg: float
    calibration: Method
    rate_hz: float
    angles_deg: list[float]


def subject_session(seed: int, quick: bool) -> PaperSession:
    return paper_session(seed, rate_hz=QUICK_HZ, samples=QUICK_SAMPLES) if quick else paper_session(seed)


def subject_rows(number: int, seed: int, quick: bool, report: Report) -> Mapping[str, Sequence[Any]]:
    """Of the ``number``-th subject after ``seed``, by part."""
    report("sampling the subject", 0.0)
    session = subject_session(seed + number, quick)
    for place, method in enumerate(CALIBRATIONS[1:]):
        report(f"training {method}", 0.05 + 0.25 * place)
        session.model(method)
    report("evaluating", 0.8)
    rows = {
        "table-3": table_3([session]),
        "figure-11": figure_11([session]),
        "figure-11-curves": _curves(session),
        "figure-12": figure_12([session]),
    }
    report("wearings", 0.9)
    return rows | {"wearings": multiple_wearings(session, QUICK_WEARINGS if quick else WEARINGS)}


def _curves(session: PaperSession) -> list[Curve]:
    return [
        Curve(
            session.seed,
            angle,
            method,
            EVALUATION_HZ,
            np.round(curve(session, OTHER_WEARING, angle, method), 2).tolist(),
        )
        for angle in ANGLES_DEG
        for method in CALIBRATIONS
    ]
