"""The figures of repair: the error after adding against the clean twin's."""

from __future__ import annotations

from collections.abc import Sequence

from glove_jobs import Row
from study_figure import StudyFigure

MOST = 1.15
MOST_OF = {"hysteresis": 1.3, "creep": 1.25, "lag": 1.25}
NO_RATIO = ("saturation",)
"""The angle is lost; the interval has to say so instead."""
COVERED = {"saturation": 0.9, "garment_slip": None}
"""Effects that widen the interval, and the share of gloves on which that must suffice."""


def repair_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Ratios by effect; open and set-aside forms come in runs of their own."""
    found = []
    for effect, lead_s in dict.fromkeys((glove.truth, glove.lead_s) for glove, _ in rows):
        some = [answer for glove, answer in rows if (glove.truth, glove.lead_s) == (effect, lead_s)]
        led = f" (frames from {lead_s:g} s before the reference)" if lead_s else ""
        learned = [answer for answer in some if "after_deg" in answer]
        if effect in COVERED:
            covers = [answer["covered"] >= 0.9 for answer in learned]
            label = f"{effect}: the 95 % interval covers 90 % or more of a new take"
            found.append(StudyFigure.share(label, covers, at_least=COVERED[effect]))
        if effect in NO_RATIO:
            continue
        ratios = [error_after(answer) / answer["twin_deg"] for answer in learned]
        label = f"{effect}: error after adding / clean twin{led}"
        found.append(StudyFigure.mean(label, ratios, at_most=MOST_OF.get(effect, MOST)))
        found.append(
            StudyFigure.share(f"{effect}: kept, not undone{led}", [answer["added"] for answer in some])
        )
    return found


def error_after(answer: dict) -> float:
    """Degrees; an effect that was undone leaves the error as it was."""
    return answer["after_deg"] if answer["added"] else answer["before_deg"]
