"""The figures of walks: alarms on causes without a name and on healthy gloves, pairs, and next takes."""

from __future__ import annotations

from collections.abc import Sequence

from glove_jobs import Row
from study_figure import StudyFigure


def alarm_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of gloves with a cause outside the catalogue."""
    found = [
        StudyFigure.share(
            "outside the catalogue: improve adds a wrong name without qualification",
            [_unqualified(row) for row in rows],
            at_most=0.0,
        ),
        StudyFigure.share(
            'outside the catalogue: "unexplained residual"', [_alarmed(row) for row in rows], at_least=0.95
        ),
    ]
    for cause in dict.fromkeys(glove.truth for glove, _ in rows):
        some = [row for row in rows if row[0].truth == cause]
        label = f'outside the catalogue: "unexplained residual", {cause}'
        found.append(StudyFigure.share(label, [_alarmed(row) for row in some]))
    return found


def false_alarm_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of healthy gloves."""
    wrong = [bool(_wrong(row)) for row in rows]
    alarms = [answer["walk"]["unexplained_residual"] for _, answer in rows]
    found = [
        StudyFigure.share("improve adds an effect to a clean glove", wrong, at_most=0.02),
        StudyFigure.share('"unexplained residual" on a clean glove', alarms, at_most=0.03),
    ]
    for nuisance in ("white", "drift", "posture"):
        some = [
            answer["walk"]["unexplained_residual"] for glove, answer in rows if glove.nuisance == nuisance
        ]
        found.append(StudyFigure.share(f'"unexplained residual" on a clean glove, {nuisance} nuisance', some))
    return found


def pairs_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of gloves with two effects, by size and together."""
    found = _pairs(rows, "two effects", judged=True)
    for size in sorted({glove.size for glove, _ in rows}):
        some = [row for row in rows if row[0].size == size]
        found += _pairs(some, f"two effects at {size:g} x floor", judged=False)
    for effect in sorted({name for glove, _ in rows for name in glove.truth.split("+")}):
        some = [answer for glove, answer in rows if effect in glove.truth.split("+")]
        hits = [effect in answer["walk"]["added"] for answer in some]
        found.append(StudyFigure.share(f"one of two effects found, {effect}", hits))
    return found


def next_take_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of gloves whose first diagnosis left two members."""
    two = [row for row in rows if len(row[1]["confidence_sets"][0]) == 2]
    settled = [answer["confidence_sets"][-1] == [glove.truth] for glove, answer in two]
    wrongly = [
        len(answer["confidence_sets"][-1]) == 1 and glove.truth not in answer["confidence_sets"][-1]
        for glove, answer in two
    ]
    label = "two-member sets settled rightly with at most two proposed takes"
    return [
        StudyFigure.share("gloves whose first set has two members", [row in two for row in rows]),
        StudyFigure.share(label, settled, at_least=0.8),
        StudyFigure.share("two-member sets settled wrongly", wrongly),
    ]


def _pairs(rows: Sequence[Row], label: str, *, judged: bool) -> list[StudyFigure]:
    both = [set(glove.truth.split("+")) <= set(answer["walk"]["added"]) for glove, answer in rows]
    exact = [set(glove.truth.split("+")) == set(answer["walk"]["added"]) for glove, answer in rows]
    ratios = [answer["walk"]["rmse_deg"][-1] / answer["twin_deg"] for _, answer in rows]
    return [
        StudyFigure.share(f"{label}: both found", both, at_least=0.9 if judged else None),
        StudyFigure.share(f"{label}: exactly these", exact, at_least=0.85 if judged else None),
        StudyFigure.mean(f"{label}: last error / clean twin", ratios),
    ]


def _wrong(row: Row) -> list[int]:
    """Places of effects that were added and are not there."""
    _, answer = row
    return [place for place, name in enumerate(answer["walk"]["added"]) if name not in answer["right"]]


def _unqualified(row: Row) -> bool:
    """A wrong name said plainly: neither ambiguous nor with the alarm beside it."""
    walk = row[1]["walk"]
    return (
        any(walk["verdicts"][place] == "named" for place in _wrong(row)) and not walk["unexplained_residual"]
    )


def _alarmed(row: Row) -> bool:
    """Where the cause's own column was named and added, nothing need be left."""
    walk = row[1]["walk"]
    return walk["unexplained_residual"] or any(name in row[1]["right"] for name in walk["added"])
