"""The parts of the study: which gloves each one asks about, how, and what it counts.

Gloves of a part are in an order that has a little of everything at every moment.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from blind_glove import BlindGlove
from ceiling_answer import ceiling_answer, recorded_answer
from ceiling_figures import ceiling_figures, recorded_figures
from delay_gloves import delay_figures, delay_gloves
from diagnosis_answer import diagnosis_answer, told_answer
from glove_choices import (
    NOT_RECORDED,
    RECORDED_INPUTS,
    RECORDED_UNNAMED,
    clean,
    effect_names,
    few_takes,
    in_turn,
    pair,
    undecided,
    unknown,
    unknown_names,
    with_cause,
)
from glove_jobs import Job, Row
from naming_figures import (
    JUDGED_SIZE,
    SMALL_SIZE,
    clean_figures,
    few_takes_figures,
    names_figures,
    sizes_figures,
    unknown_figures,
)
from next_take_answer import next_take_answer
from repair_answer import REMEMBERING, repair_answer
from repair_figures import repair_figures
from study_figure import StudyFigure
from walk_answer import only_walk_answer, pair_answer, walk_answer
from walk_figures import (
    alarm_figures,
    false_alarm_figures,
    next_take_figures,
    pairs_figures,
    second_name_figures,
)

from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits

LARGE_SIZE = 2.6
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
    few_takes: int = 300
    """Healthy gloves with few short takes."""
    repairs: int = 20
    """Gloves that are repaired, per effect."""
    pairs: int = 60
    """Gloves with two effects per size."""
    second_names: int = 288
    """Gloves with one effect that is added, in all."""
    ceilings: int = 200
    """Gloves that are asked for their ceiling, in all; every second one is clean."""
    recorded: int = 104
    """Gloves with a cause without a name, in all; a quarter follows nothing recorded and is left out."""
    effects: tuple[str, ...] = ()
    """None given means all."""
    set_aside: bool = False
    limits: ImprovementLimits = IMPROVEMENT_LIMITS


QUICK = StudyChoices(
    gloves=1, clean=2, few_takes=2, repairs=1, pairs=2, second_names=18, ceilings=24, recorded=8
)
"""Everything once: what can go wrong, no figure to rely on."""


@dataclass(frozen=True)
class StudyPart:
    """One question to the diagnosis."""

    sentence: str
    gloves: Callable[[StudyChoices], list[BlindGlove]]
    job: Job
    figures: Callable[[Sequence[Row]], list[StudyFigure]]
    glove_s: float
    """What a glove costs, seconds of one processor, until some have been asked: time is shared by it."""
    confusion: bool = False
    """Whether its first names go into the confusion matrix."""
    demanded: str = ""
    """What the figures with a headline judge, in few words; empty where a part judges nothing."""
    of_forms: bool = True
    """Whether its gloves are others with set-aside forms."""


def _names(choices: StudyChoices) -> list[BlindGlove]:
    return _single("names", (JUDGED_SIZE,), choices)


def _sizes(choices: StudyChoices) -> list[BlindGlove]:
    return _single("sizes", (SMALL_SIZE, LARGE_SIZE), choices)


def _repair(choices: StudyChoices) -> list[BlindGlove]:
    """Effects that remember twice: from the first frame on, and with frames before the reference."""
    found = []
    for glove in _single("repair", (LARGE_SIZE,), replace(choices, gloves=choices.repairs)):
        found.append(glove)
        if glove.truth in REMEMBERING:
            found.append(replace(glove, lead_s=LEAD_S))
    return found


def _single(part: str, sizes: Sequence[float], choices: StudyChoices) -> list[BlindGlove]:
    made = [
        with_cause(part, name, size, number, set_aside=choices.set_aside)
        for number in range(choices.gloves)
        for size in sizes
        for name in effect_names(choices.effects)
    ]
    return [glove for glove in made if glove is not None]


def _clean(choices: StudyChoices) -> list[BlindGlove]:
    return [clean(number, linear=linear) for number in range(choices.clean) for linear in (False, True)]


def _unknown(choices: StudyChoices) -> list[BlindGlove]:
    """Half as many of each: nothing of the study's table is judged by them."""
    return [
        unknown(name, size, number)
        for number in range((choices.gloves + 1) // 2)
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


def _second_names(choices: StudyChoices) -> list[BlindGlove]:
    names = effect_names(choices.effects)
    return list(_in_turn("second-names", names, LARGE_SIZE, choices.second_names, choices)) if names else []


def _ceilings(choices: StudyChoices) -> list[BlindGlove]:
    names = [name for name in RECORDED_INPUTS if not choices.effects or name in choices.effects]
    healthy = [clean(number, linear=False, part="ceiling") for number in range(choices.ceilings // 2)]
    if not names:
        return healthy
    hidden = list(_in_turn("ceiling", names, JUDGED_SIZE, choices.ceilings - len(healthy), choices))
    both = zip(hidden, healthy, strict=False)
    more = [*hidden[len(healthy) :], *healthy[len(hidden) :]]
    return [*(glove for each in both for glove in each), *more]


def _recorded(choices: StudyChoices) -> list[BlindGlove]:
    names = [name for name in RECORDED_UNNAMED if not choices.effects or name in choices.effects]
    cells = [(name, size) for size in UNKNOWN_SIZES for name in names]
    made = [
        with_cause("recorded", *cells[number % len(cells)], number // len(cells), set_aside=choices.set_aside)
        for number in range(choices.recorded if cells else 0)
    ]
    return [glove for glove in made if glove and glove.causes[0].form not in NOT_RECORDED]


def _in_turn(
    part: str, names: Sequence[str], size: float, count: int, choices: StudyChoices
) -> Iterator[BlindGlove]:
    for number in range(count):
        glove = in_turn(part, names, size, number, set_aside=choices.set_aside)
        if glove is not None:
            yield glove


PARTS: dict[str, StudyPart] = {
    "names": StudyPart(
        "one effect at 1.3 floors: is it named first?",
        _names,
        diagnosis_answer,
        names_figures,
        glove_s=6,
        confusion=True,
        demanded="The right effect first, 1.3 x floor",
    ),
    "sizes": StudyPart(
        "one effect at 0.65 and 2.6 floors: names and confidence sets",
        _sizes,
        diagnosis_answer,
        sizes_figures,
        glove_s=6,
        confusion=True,
        demanded="Confidence sets, 0.65 x floor",
    ),
    "repair": StudyPart(
        "one effect at 2.6 floors, its name given: how far does the error fall?",
        _repair,
        repair_answer,
        repair_figures,
        glove_s=15,
        demanded="Error after adding / clean twin, 2.6 x floor",
    ),
    "recorded": StudyPart(
        "recorded causes without a name: does an action save what the ceiling says could be saved?",
        _recorded,
        recorded_answer,
        recorded_figures,
        glove_s=25,
        demanded="Recorded causes without a name in the catalogue",
    ),
    "second-names": StudyPart(
        "one effect at 2.6 floors through improve: is anything added beside it?",
        _second_names,
        only_walk_answer,
        second_name_figures,
        glove_s=18,
        demanded="Second names that are not there",
    ),
    "clean": StudyPart(
        "healthy gloves: is anything named, or said to be left?",
        _clean,
        walk_answer,
        lambda rows: [*false_alarm_figures(rows), *clean_figures(rows)],
        glove_s=12,
        confusion=True,
        demanded="Clean gloves",
        of_forms=False,
    ),
    "few-takes": StudyPart(
        "healthy gloves in six short takes, of all rates and motions: is anything named?",
        lambda choices: [few_takes(number) for number in range(choices.few_takes)],
        told_answer,
        few_takes_figures,
        glove_s=4,
        demanded="Healthy gloves in few short takes",
        of_forms=False,
    ),
    "delays": StudyPart(
        "constant delays of nine kinds: does a single name ever go wrong?",
        lambda choices: delay_gloves(choices.gloves),
        diagnosis_answer,
        delay_figures,
        glove_s=5,
        demanded="Delays",
        of_forms=False,
    ),
    "pairs": StudyPart(
        "two effects at once: are both added, and nothing else?",
        _pairs,
        pair_answer,
        pairs_figures,
        glove_s=20,
        demanded="Two effects",
    ),
    "next-take": StudyPart(
        "weak effects: does the proposed take settle what is undecided?",
        _next_take,
        next_take_answer,
        next_take_figures,
        glove_s=7,
        demanded="The proposed next take",
    ),
    "ceiling": StudyPart(
        "the black-box ceiling of clean gloves, and of gloves with an effect that is not repaired",
        _ceilings,
        ceiling_answer,
        ceiling_figures,
        glove_s=12,
        demanded="The black-box ceiling, 1.3 x floor",
    ),
    "unknown": StudyPart(
        "causes outside the catalogue: is anything named, and is something said to be left?",
        _unknown,
        walk_answer,
        lambda rows: [*unknown_figures(rows), *alarm_figures(rows)],
        glove_s=18,
        confusion=True,
        of_forms=False,
    ),
}
"""In the order of the page."""
