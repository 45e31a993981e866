"""The figures of repair: the error after adding against the clean twin's, by effect and by form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from glove_jobs import Row
from repair_answer import CLOSE_TO_TWIN, COVERAGE, error_after, is_judged_by_ceiling
from study_figure import StudyFigure

MEDIAN, WORST = CLOSE_TO_TWIN, 1.25
WORST_SHARE = 0.95
"""Quantile of the ratios that ``WORST`` limits, and share of gloves of which the ceiling has to hold."""
COVERS = 0.9
"""Share of a new take's measurements inside the 95 % interval, and of gloves of which it has to hold."""
LEFT = 0.1
"""Share of the RMSE that the black-box ceiling may leave to gain."""


def repair_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """What judges the part first, then effects, then forms."""
    effects = _ratios(rows, lambda row: _led(row, row[0].truth))
    forms = _ratios(rows, lambda row: _led(row, f"{row[0].truth} {row[0].causes[0].form}"))
    judged = [ratio_of(row) for row in rows if _by_ratio(row)]
    coverage = [
        StudyFigure.share(
            f"{effect}: the 95 % interval covers {100 * COVERS:g} % or more of a new take",
            [answer["covered"] >= COVERS for glove, answer in rows if glove.truth == effect],
            at_least=COVERS,
        )
        for effect in COVERAGE
        if any(glove.truth == effect for glove, _ in rows)
    ]
    return [
        _median("error after adding / clean twin: median", judged, headline="median ratio"),
        _worst("error after adding / clean twin: 95th percentile", judged, headline="95th percentile"),
        _all("effects with median and 95th percentile as demanded", _by_group(effects), "effects"),
        _all("forms with the median as demanded", _by_group(forms[::2]), "forms"),
        _all(
            "effects judged by the coverage of the interval",
            [bool(item.is_met) for item in coverage],
            "effects",
        ),
        *_ceilings(rows),
        *coverage,
        *effects,
        *forms[::2],
        *_kept(rows),
    ]


def ratio_of(row: Row) -> float:
    return error_after(row[1]) / row[1]["twin_deg"]


def _by_ratio(row: Row) -> bool:
    return row[0].truth not in COVERAGE and not is_judged_by_ceiling(row[0])


def _led(row: Row, name: str) -> str:
    return f"{name} (pre-roll of {row[0].lead_s:g} s)" if row[0].lead_s else name


def _ratios(rows: Sequence[Row], group: Any) -> list[StudyFigure]:
    """Median and 95th percentile of each group in turn; demanded where the ratio judges."""
    found = []
    for name in dict.fromkeys(map(group, rows)):
        some = [row for row in rows if group(row) == name]
        ratios, judged = [ratio_of(row) for row in some], _by_ratio(some[0])
        label = f"{name}: error after adding / clean twin"
        found.append(_median(f"{label}, median", ratios, judged=judged))
        found.append(_worst(f"{label}, 95th percentile", ratios, judged=judged))
    return found


def _by_group(figures: Sequence[StudyFigure]) -> list[bool]:
    """Whether all figures of a group are met, of groups of which anything is demanded."""
    groups: dict[str, list[bool]] = {}
    for figure in figures:
        if figure.is_met is not None:
            groups.setdefault(figure.name.partition(":")[0], []).append(figure.is_met)
    return [all(each) for each in groups.values()]


def _all(name: str, hits: Sequence[bool], unit: str) -> StudyFigure:
    return StudyFigure.share(name, hits, at_least=1.0, unit=unit, headline=name)


def _median(name: str, ratios: Sequence[float], *, judged: bool = True, headline: str = "") -> StudyFigure:
    most = MEDIAN if judged else None
    return StudyFigure.quantile(name, ratios, 0.5, at_most=most, headline=headline)


def _worst(name: str, ratios: Sequence[float], *, judged: bool = True, headline: str = "") -> StudyFigure:
    most = WORST if judged else None
    return StudyFigure.quantile(name, ratios, WORST_SHARE, at_most=most, headline=headline)


def _ceilings(rows: Sequence[Row]) -> list[StudyFigure]:
    some = [(glove, answer["ceiling"]) for glove, answer in rows if is_judged_by_ceiling(glove)]
    label = f"repaired without pre-roll: ceiling none, or at most {100 * LEFT:g} % left"
    every = [_little_left(found) for _, found in some]
    found = [
        StudyFigure.share(
            label, every, at_least=WORST_SHARE, headline="without pre-roll: ceiling none or <= 10 %"
        ),
        _nothing_left(rows),
    ]
    for effect in dict.fromkeys(glove.truth for glove, _ in some):
        mine = [answer for glove, answer in some if glove.truth == effect]
        found.append(StudyFigure.share(f"{label}, {effect}", [_little_left(each) for each in mine]))
        shares = [max(each["share"], 0.0) for each in mine]
        found.append(StudyFigure.mean(f"{effect}: share of the RMSE that the ceiling leaves", shares))
    return found


def _nothing_left(rows: Sequence[Row]) -> StudyFigure:
    """Of the gloves that stay above their twin, by how many nothing was left to gain."""
    above = [
        answer["ceiling"] for glove, answer in rows if _by_ratio((glove, answer)) and "ceiling" in answer
    ]
    return StudyFigure.share(
        f"above {MEDIAN:g} x the clean twin: ceiling none, or at most {100 * LEFT:g} % left",
        [_little_left(found) for found in above],
        headline=f"above {MEDIAN:g} x: ceiling none or <= 10 %",
    )


def _little_left(ceiling: dict[str, Any]) -> bool:
    return ceiling["verdict"] == "none" or ceiling["share"] <= LEFT


def _kept(rows: Sequence[Row]) -> list[StudyFigure]:
    found = []
    for name in dict.fromkeys(_led(row, row[0].truth) for row in rows):
        some = [row[1]["added"] for row in rows if _led(row, row[0].truth) == name]
        found.append(StudyFigure.share(f"{name}: kept, not undone", some))
    return found
