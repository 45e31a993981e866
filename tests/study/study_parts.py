"""The parts of the study: which gloves each one asks about, how, and what it counts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from blind_glove import BlindGlove
from delay_gloves import delay_figures, delay_gloves
from diagnosis_answer import diagnosis_answer
from glove_choices import clean, effect_names, pair, undecided, unknown, unknown_names, with_cause
from glove_jobs import Job, Row
from naming_figures import (
    JUDGED_SIZE,
    SMALL_SIZE,
    clean_figures,
    names_figures,
    sizes_figures,
    unknown_figures,
)
from next_take_answer import next_take_answer
from repair_answer import repair_answer
from repair_figures import repair_figures
from study_figure import StudyFigure
from walk_answer import pair_answer, walk_answer
from walk_figures import alarm_figures, false_alarm_figures, next_take_figures, pairs_figures

from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

LARGE_SIZE = 2.6
REMEMBERING = ("creep", "hysteresis", "lag")
LEAD_S = 30.0
"""How long a glove streams before a reference begins, where it does."""
PAIR_SIZES = (JUDGED_SIZE, LARGE_SIZE)
UNKNOWN_SIZES = (JUDGED_SIZE, LARGE_SIZE)


@dataclass(frozen=True)
class StudyChoices:
    """What the command line asked for."""

    gloves: int = 20
    """Per effect and size."""
    clean: int = 150
    """Clean gloves per base."""
    pairs: int = 24
    """Gloves with two effects per size."""
    effects: tuple[str, ...] = ()
    """None given means all."""
    set_aside: bool = False
    limits: ImprovementLimits = IMPROVEMENT_LIMITS


@dataclass(frozen=True)
class StudyPart:
    """One question to the diagnosis."""

    sentence: str
    gloves: Callable[[StudyChoices], list[BlindGlove]]
    job: Job
    figures: Callable[[Sequence[Row]], list[StudyFigure]]
    confusion: bool = True
    """Whether its first names go into the confusion matrix."""


def _names(choices: StudyChoices) -> list[BlindGlove]:
    return _single("names", (JUDGED_SIZE,), choices)


def _sizes(choices: StudyChoices) -> list[BlindGlove]:
    return _single("sizes", (SMALL_SIZE, LARGE_SIZE), choices)


def _repair(choices: StudyChoices) -> list[BlindGlove]:
    """Effects that remember twice: from the first frame on, and with frames before the reference."""
    alone = _single("repair", (LARGE_SIZE,), choices)
    return [*alone, *(replace(glove, lead_s=LEAD_S) for glove in alone if glove.truth in REMEMBERING)]


def _single(part: str, sizes: Sequence[float], choices: StudyChoices) -> list[BlindGlove]:
    """Effects in turn within each round, so that an early stop has a little of everything."""
    made = [
        with_cause(part, name, size, number, set_aside=choices.set_aside)
        for number in range(choices.gloves)
        for size in sizes
        for name in effect_names(choices.effects)
    ]
    return sorted(
        (glove for glove in made if glove is not None), key=lambda glove: (glove.size, glove.number)
    )


def _clean(choices: StudyChoices) -> list[BlindGlove]:
    return [clean(number, linear=linear) for number in range(choices.clean) for linear in (False, True)]


def _unknown(choices: StudyChoices) -> list[BlindGlove]:
    return [
        unknown(name, size, number)
        for number in range(choices.gloves)
        for size in UNKNOWN_SIZES
        for name in unknown_names(choices.effects)
    ]


def _pairs(choices: StudyChoices) -> list[BlindGlove]:
    made = [
        pair(number, size, set_aside=choices.set_aside)
        for number in range(choices.pairs)
        for size in PAIR_SIZES
    ]
    wanted = set(choices.effects)
    return [glove for glove in made if not wanted or wanted & set(glove.truth.split("+"))]


def _next_take(choices: StudyChoices) -> list[BlindGlove]:
    made = [
        undecided(name, number, set_aside=choices.set_aside)
        for number in range(choices.gloves)
        for name in effect_names(choices.effects)
    ]
    return [glove for glove in made if glove is not None]


PARTS: dict[str, StudyPart] = {
    "names": StudyPart(
        "one effect at 1.3 floors: is it named first?", _names, diagnosis_answer, names_figures
    ),
    "sizes": StudyPart(
        "one effect at 0.65 and 2.6 floors: names and confidence sets",
        _sizes,
        diagnosis_answer,
        sizes_figures,
    ),
    "delays": StudyPart(
        "constant delays of nine kinds: does a single name ever go wrong?",
        lambda choices: delay_gloves(choices.gloves),
        diagnosis_answer,
        delay_figures,
        confusion=False,
    ),
    "clean": StudyPart(
        "healthy gloves: is anything named, or said to be left?",
        _clean,
        walk_answer,
        lambda rows: [*clean_figures(rows), *false_alarm_figures(rows)],
    ),
    "unknown": StudyPart(
        "causes outside the catalogue: is anything named, and is something said to be left?",
        _unknown,
        walk_answer,
        lambda rows: [*unknown_figures(rows), *alarm_figures(rows)],
    ),
    "repair": StudyPart(
        "one effect at 2.6 floors, its name given: how far does the error fall?",
        _repair,
        repair_answer,
        repair_figures,
        confusion=False,
    ),
    "pairs": StudyPart(
        "two effects at once: are both added, and nothing else?",
        _pairs,
        pair_answer,
        pairs_figures,
        confusion=False,
    ),
    "next-take": StudyPart(
        "weak effects in few short takes: does the proposed take settle what is undecided?",
        _next_take,
        next_take_answer,
        next_take_figures,
        confusion=False,
    ),
}
