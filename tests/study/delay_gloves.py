"""Gloves with one delay of nine kinds, and whether they are told apart as far as takes can.

Clocks that are off by one time in all takes cannot be told from a glove that is late: a set with both is
right. A name is right if it is true of a glove: a moving average of all sensors is a lag and a latency.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

from blind_glove import BlindGlove
from glove_choices import BITS, FLOOR_DEG, NUISANCES, RATES_HZ, dealt
from glove_jobs import Row
from study_figure import StudyFigure

from glovecal_models.simulation.causes.form import Cause

SIZES = (1.3, 2.6, 4.0)
"""Noise floors: delays of about 25, 50 and 80 ms."""
PER_TAKE = "clock per take"
KINDS: dict[str, tuple[str, str, set[str]]] = {
    "clock constant": ("clock_offset", "constant", {"clock_offset"}),
    PER_TAKE: ("clock_offset", "per_take", {"clock_offset"}),
    "transport": ("glove_latency", "transport", {"glove_latency"}),
    "play-out buffer": ("glove_latency", "buffered", {"glove_latency"}),
    "linear-phase filter": ("glove_latency", "linear_phase", {"glove_latency", "lag"}),
    "moving average, all alike": ("glove_latency", "common_average", {"glove_latency", "lag"}),
    "moving average": ("lag", "moving_average", {"lag", "glove_latency"}),
    "one pole": ("lag", "one_pole", {"lag"}),
    "two poles": ("lag", "two_poles", {"lag"}),
}
"""Cause, form and names that are true."""
FEWEST = 60
"""Constant delays without which "none is named wrongly" is not said."""


def delay_gloves(each: int) -> list[BlindGlove]:
    """So many of each kind, in turn."""
    return [_glove(kind, number) for number in range(each) for kind in KINDS]


def delay_figures(rows: Sequence[Row]) -> list[StudyFigure]:
    """Single names that are wrong, and truths that are named or in the set."""
    constant = [row for row in rows if _kind(row) != PER_TAKE]
    changing = [_is_single(row) and _is_inside(row) for row in rows if _kind(row) == PER_TAKE]
    found = [
        StudyFigure.share(
            "a constant delay: a single name, and it is wrong",
            [_is_wrong(row) for row in constant],
            at_most=0.0,
            fewest=FEWEST,
            headline="constant: one name, wrong",
        ),
        StudyFigure.share(
            "clocks that differ from take to take: named singly and right",
            changing,
            at_least=0.9,
            headline="clocks that differ by take: named alone",
        ),
        StudyFigure.share("a delay: a true name in the confidence set", list(map(_is_inside, rows))),
    ]
    for kind in KINDS:
        some = [row for row in rows if _kind(row) == kind]
        single = [_is_single(row) and _is_inside(row) for row in some]
        found.append(StudyFigure.share(f"{kind}: named singly and right", single))
        found.append(StudyFigure.share(f"{kind}: a true name in the set", [_is_inside(row) for row in some]))
    sizes = [len(answer["confidence_set"]) for _, answer in rows if answer["confidence_set"]]
    found.append(StudyFigure.mean("a delay: members of the confidence set", sizes))
    return found


def _glove(kind: str, number: int) -> BlindGlove:
    cause, form, _ = KINDS[kind]
    label = ("delays of nine kinds", kind)
    size = dealt(SIZES, number, *label, "size")
    return BlindGlove(
        part="delays",
        truth=cause,
        number=number,
        size=size,
        seed=zlib.crc32(repr((*label, number)).encode()),
        causes=(Cause(cause, form, size * FLOOR_DEG),),
        bits=dealt(BITS, number, *label, "bits"),
        rate_hz=dealt(RATES_HZ, number, *label, "rate"),
        nuisance=dealt(NUISANCES, number, *label, "nuisance"),
    )


def _kind(row: Row) -> str:
    hidden = row[0].causes[0]
    return next(
        kind for kind, (cause, form, _) in KINDS.items() if (cause, form) == (hidden.name, hidden.form)
    )


def true_names(glove: BlindGlove) -> set[str]:
    """Names that are true of a glove with one hidden cause: of some delays there are two."""
    hidden = {(item.name, item.form) for item in glove.causes}
    return next((names for cause, form, names in KINDS.values() if (cause, form) in hidden), {glove.truth})


def _is_inside(row: Row) -> bool:
    return bool(KINDS[_kind(row)][2] & set(row[1]["confidence_set"]))


def _is_single(row: Row) -> bool:
    return len(row[1]["confidence_set"]) == 1


def _is_wrong(row: Row) -> bool:
    return _is_single(row) and not _is_inside(row)
