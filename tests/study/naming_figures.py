"""The figures of names, sizes, clean gloves and causes outside the catalogue."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from diagnosis_answer import NOTHING
from glove_choices import NUISANCES
from glove_jobs import Row
from study_figure import StudyFigure

JUDGED_SIZE = 1.3
"""Floors at which the first name has to be right."""
SMALL_SIZE = 0.65
"""Floors at which the truth has to be in the confidence set."""
FEWEST_HEALTHY = 300
"""Gloves without which 1 % false names in few short takes are not said to be kept."""
RIGHT, RIGHT_SET_ASIDE = 0.97, 0.92
EACH_REACHES = 0.85
"""An effect's interval has to reach so far."""

SAME_IN_TAKES = {"clock_offset", "glove_latency"}
"""One delay of all takes: only taps on a key tell which of them it is, so that a set with both is right."""


def right_first(row: Row) -> bool:
    glove, answer = row
    if glove.truth in SAME_IN_TAKES and glove.truth in answer["confidence_set"]:
        return answer["first"] in SAME_IN_TAKES
    return answer["first"] in answer["right"] and (
        answer["first"] == glove.truth or "context:" in answer["first"]
    )


def names_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """The right effect first, open and set-aside forms apart."""
    found = []
    for forms, mine in _by_forms(rows):
        for size in sorted({glove.size for glove, _ in mine}):
            some = [row for row in mine if row[0].size == size]
            label = f"right effect first at {size:g} x floor{forms}"
            found += _judged(some, label) if size == JUDGED_SIZE else _first(some, label, {}, {})
    return found


def _judged(rows: Sequence[Row], label: str) -> list[StudyFigure]:
    """All, whether the interval of any effect is too low, and each effect."""
    least = RIGHT_SET_ASIDE if rows[0][0].set_aside else RIGHT
    every, *effects = _first(
        rows, label, {"at_least": least, "headline": "right effect first"}, {"reaches": EACH_REACHES}
    )
    low = StudyFigure.share(
        f"effects whose interval lies wholly below {100 * EACH_REACHES:g} %",
        [not each.is_met for each in effects],
        at_most=0.0,
        unit="effects",
        headline=f"effects wholly below {100 * EACH_REACHES:g} %",
    )
    return [every, low, *effects]


def _first(
    rows: Sequence[Row], label: str, of_all: dict[str, Any], of_each: dict[str, Any]
) -> list[StudyFigure]:
    found = [StudyFigure.share(f"{label}, all", [right_first(row) for row in rows], **of_all)]
    for effect in dict.fromkeys(glove.truth for glove, _ in rows):
        hits = [right_first(row) for row in rows if row[0].truth == effect]
        found.append(StudyFigure.share(f"{label}, {effect}", hits, **of_each))
    return found


def sizes_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """First names at other sizes, and confidence sets of weak effects."""
    found = []
    for forms, mine in _by_forms(rows):
        small = [row for row in mine if row[0].size == SMALL_SIZE]
        inside = [_is_inside(row) for row in small]
        sizes = [len(answer["confidence_set"]) for _, answer in small if answer["confidence_set"]]
        label = f"at {SMALL_SIZE:g} x floor{forms}"
        found.append(
            StudyFigure.share(
                f"truth inside the confidence set {label}",
                inside,
                at_least=0.92,
                headline="truth in the set",
            )
        )
        found.append(
            StudyFigure.mean(
                f"members of a confidence set {label}", sizes, at_most=2.0, headline="mean members of a set"
            )
        )
        for effect in dict.fromkeys(glove.truth for glove, _ in small):
            hits = [_is_inside(row) for row in small if row[0].truth == effect]
            found.append(StudyFigure.share(f"truth inside the set {label}, {effect}", hits))
    return [*found, *names_figures(rows)]


def clean_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Effects that the diagnosis of untouched takes names on healthy gloves."""
    found = [StudyFigure.share("diagnosis names an effect on a clean glove", _false(rows))]
    for linear in (False, True):
        some = [row for row in rows if row[0].linear is linear]
        label = "linear base (its own curve may be named)" if linear else "flexible base"
        found.append(StudyFigure.share(f"diagnosis names an effect on a clean glove, {label}", _false(some)))
    straight = [row for row in rows if row[0].linear]
    others = [bool(set(answer["ranked"]) - set(answer["right"])) for _, answer in straight]
    found.append(StudyFigure.share("linear base: another effect beyond chance beside the curve", others))
    for nuisance in NUISANCES:
        some = [row for row in rows if row[0].nuisance == nuisance]
        found.append(
            StudyFigure.share(
                f"diagnosis names an effect on a clean glove, {nuisance} nuisance", _false(some)
            )
        )
    return found


def few_takes_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """What is told of healthy gloves in few short takes, by rate and by motion."""
    found = [
        StudyFigure.share(
            "few short takes: an effect is named on a healthy glove",
            _false(rows),
            at_most=0.01,
            fewest=FEWEST_HEALTHY,
            headline="an effect named",
        )
    ]
    for what in ("findings", "reference_problems", "unexplained_residual"):
        label = f"few short takes: {what.replace('_', ' ')} on a healthy glove"
        found.append(StudyFigure.share(label, [bool(answer[what]) for _, answer in rows]))
    for name, unit in (("rate_hz", " Hz"), ("motion", "")):
        for value in dict.fromkeys(getattr(glove, name) for glove, _ in rows):
            some = [row for row in rows if getattr(row[0], name) == value]
            shown = f"{value:g}{unit}" if isinstance(value, float) else value
            found.append(StudyFigure.share(f"few short takes: an effect is named, {shown}", _false(some)))
    return found


def unknown_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Catalogue names given to causes that are not in it; the alarm's part comes from ``walk_figures``."""
    found = [StudyFigure.share("outside the catalogue: a name of the catalogue", _false(rows))]
    for cause in dict.fromkeys(glove.truth for glove, _ in rows):
        some = [row for row in rows if row[0].truth == cause]
        found.append(
            StudyFigure.share(f"outside the catalogue: a name of the catalogue, {cause}", _false(some))
        )
    recorded = [right_first(row) for row in rows if row[0].truth == "unknown:context"]
    found.append(StudyFigure.share("recorded but unfamiliar: its column is named first", recorded))
    return found


def _is_inside(row: Row) -> bool:
    return row[0].truth in row[1]["confidence_set"]


def _false(rows: Sequence[Row]) -> list[bool]:
    return [answer["first"] != NOTHING and answer["first"] not in answer["right"] for _, answer in rows]


def _by_forms(rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    """Open and set-aside forms are never counted together."""
    parts = ((", set-aside forms", True), ("", False))
    found = [(label, [row for row in rows if row[0].set_aside is aside]) for label, aside in parts]
    return [(label, mine) for label, mine in found if mine]
