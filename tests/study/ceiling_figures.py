"""The figures of the black-box ceiling: its own verdicts, and what ``improve`` saves of what it sees."""

from __future__ import annotations

from collections.abc import Sequence

from glove_jobs import Row
from study_figure import StudyFigure

LONG_S = 360.0
"""A session that is longer has to be decided."""
SAVED = 0.7
"""Of what the ceiling says could be saved."""


def ceiling_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of unrepaired bases; gloves with an effect and clean ones apart."""
    hidden = [row for row in rows if row[0].causes]
    clean = [_verdict(row) == "gain" for row in rows if not row[0].causes]
    long = [_verdict(row) == "undecided" for row in rows if row[0].duration_s > LONG_S]
    found = [
        StudyFigure.share(
            'an effect with recorded inputs, not repaired: ceiling "none"',
            [_verdict(row) == "none" for row in hidden],
            at_most=0.03,
            headline='hidden and not repaired: "none"',
        ),
        StudyFigure.share('ceiling "gain" on a clean glove', clean, at_most=0.03, headline='clean: "gain"'),
        StudyFigure.share(
            f"undecided, sessions longer than {LONG_S / 60:g} minutes",
            long,
            at_most=0.2,
            headline=f"undecided, over {LONG_S / 60:g} minutes",
        ),
    ]
    for effect in dict.fromkeys(glove.truth for glove, _ in rows):
        some = [_verdict(row) for row in rows if row[0].truth == effect]
        for verdict in ("none", "gain", "undecided"):
            label = f'{effect}: ceiling "{verdict}"'
            found.append(StudyFigure.share(label, [each == verdict for each in some]))
    return found


def recorded_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Of gloves with a recorded cause without a name, where the ceiling sees a gain."""
    gains = [row for row in rows if _verdict(row) == "gain"]
    found = [
        StudyFigure.share(
            f"an action that saves {100 * SAVED:g} % or more of what the ceiling says",
            [_is_saved(row) for row in gains],
            at_least=0.95,
            headline=f"an action saves >= {100 * SAVED:g} % of the ceiling's gain",
        ),
        StudyFigure.share(
            "any effect added, where the ceiling sees a gain", [bool(row[1]["added"]) for row in gains]
        ),
        StudyFigure.share("the ceiling sees a gain", [row in gains for row in rows]),
    ]
    for cause, form in dict.fromkeys((row[0].truth, row[0].causes[0].form) for row in rows):
        some = [row for row in gains if (row[0].truth, row[0].causes[0].form) == (cause, form)]
        label = f"{cause} {form}"
        found.append(StudyFigure.share(f"{label}: such an action", [_is_saved(row) for row in some]))
        shares = [saved(row) / row[1]["ceiling"]["share"] for row in some]
        found.append(StudyFigure.mean(f"{label}: saved, of what the ceiling says", shares))
    return found


def saved(row: Row) -> float:
    """Share of the RMSE that ``improve`` took off."""
    return 1.0 - row[1]["rmse_deg"][-1] / row[1]["rmse_deg"][0]


def _is_saved(row: Row) -> bool:
    return bool(row[1]["added"]) and saved(row) >= SAVED * row[1]["ceiling"]["share"]


def _verdict(row: Row) -> str:
    return row[1]["ceiling"]["verdict"]
