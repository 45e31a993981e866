"""The figures of walks: alarms without a cause or a name, second names, pairs, and next takes."""

from __future__ import annotations

from collections.abc import Sequence

from delay_gloves import true_names
from glove_choices import NUISANCES
from glove_jobs import Row
from naming_figures import SAME_IN_TAKES
from study_figure import StudyFigure

FEWEST_SECOND, FEWEST_PAIRS, FEWEST_SETTLED = 200, 120, 60
"""Gloves without which a part is not judged as good enough."""


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
    """Of healthy gloves, each base by itself; beside a straight line its own curve is no wrong name."""
    found = []
    for linear in (False, True):
        base = "linear base" if linear else "flexible base"
        some = [row for row in rows if row[0].linear is linear]
        found.append(
            StudyFigure.share(
                f"improve adds an effect to a clean glove, {base}",
                [bool(_wrong(row)) for row in some],
                at_most=0.01,
                headline=f"{base}: effect added",
            )
        )
        found.append(
            StudyFigure.share(
                f'"unexplained residual" on a clean glove, {base}',
                [row[1]["walk"]["unexplained_residual"] for row in some],
                at_most=0.03,
                headline=f"{base}: alarm",
            )
        )
    for nuisance in NUISANCES:
        some = [row for row in rows if row[0].nuisance == nuisance]
        alarms = [answer["walk"]["unexplained_residual"] for _, answer in some]
        wrong = [bool(_wrong(row)) for row in some]
        found.append(
            StudyFigure.share(f"improve adds an effect to a clean glove, {nuisance} nuisance", wrong)
        )
        found.append(
            StudyFigure.share(f'"unexplained residual" on a clean glove, {nuisance} nuisance', alarms)
        )
    return found


def second_name_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of gloves with one effect, to which ``improve`` has added a right one: what else it added."""
    found = [row for row in rows if len(_wrong(row)) < len(row[1]["walk"]["added"])]
    claimed = [
        any(row[1]["walk"]["verdicts"][place] != "associated" for place in _wrong(row)) for row in found
    ]
    figures = [
        StudyFigure.share(
            "a second name that is not there",
            [bool(_wrong(row)) for row in found],
            at_most=0.02,
            fewest=FEWEST_SECOND,
            headline="a further effect that is not there",
        ),
        StudyFigure.share("the same, without effects marked as associated", claimed),
        StudyFigure.share("a right effect added", [row in found for row in rows]),
    ]
    for effect in dict.fromkeys(glove.truth for glove, _ in rows):
        some = [bool(_wrong(row)) for row in found if row[0].truth == effect]
        figures.append(StudyFigure.share(f"a second name that is not there, {effect}", some))
    return figures


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
    """Of gloves whose first diagnosis was ambiguous, and named what to record."""
    every = [row for row in rows if len(row[1]["confidence_sets"][0]) > 1]
    many = [row for row in every if row[1]["motions"]]
    two = [row for row in many if len(row[1]["confidence_sets"][0]) == 2]
    wrongly = [
        len(answer["confidence_sets"][-1]) == 1 and not true_names(glove) & set(answer["confidence_sets"][-1])
        for glove, answer in many
    ]
    label = "sets settled rightly with at most two proposed takes"
    return [
        StudyFigure.share(
            f"ambiguous {label}",
            [_settled(row) for row in many],
            at_least=0.8,
            fewest=FEWEST_SETTLED,
            headline="settled rightly with at most two takes",
        ),
        StudyFigure.share(f"two-member {label}", [_settled(row) for row in two]),
        StudyFigure.share("ambiguous sets settled wrongly", wrongly),
        StudyFigure.share("ambiguous sets for which a take is proposed", [row in many for row in every]),
        StudyFigure.share("gloves whose first set is ambiguous", [row in every for row in rows]),
    ]


def _settled(row: Row) -> bool:
    last = set(row[1]["confidence_sets"][-1])
    return bool(last) and last <= true_names(row[0])


def _pairs(rows: Sequence[Row], label: str, *, judged: bool) -> list[StudyFigure]:
    both = [set(glove.truth.split("+")) <= set(answer["walk"]["added"]) for glove, answer in rows]
    exact = [set(glove.truth.split("+")) == set(answer["walk"]["added"]) for glove, answer in rows]
    ratios = [answer["walk"]["rmse_deg"][-1] / answer["twin_deg"] for _, answer in rows]
    found, exactly = (
        ({"at_least": least, "fewest": FEWEST_PAIRS, "headline": name} if judged else {})
        for least, name in ((0.92, "both found"), (0.88, "exactly these"))
    )
    return [
        StudyFigure.share(f"{label}: both found", both, **found),
        StudyFigure.share(f"{label}: exactly these", exact, **exactly),
        StudyFigure.mean(f"{label}: last error / clean twin", ratios),
    ]


def _wrong(row: Row) -> list[int]:
    """Places of effects that were added and are not there.

    One delay of all takes is the clock's or the glove's: either is right as long as the other is in its set.
    """
    glove, answer = row
    walk = answer["walk"]
    return [
        place
        for place, name in enumerate(walk["added"])
        if name not in answer["right"]
        and not ({name, glove.truth} <= SAME_IN_TAKES and glove.truth in walk["confidence_sets"][place])
    ]


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
