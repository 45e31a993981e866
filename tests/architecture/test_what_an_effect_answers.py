"""What an effect can be asked for: few questions, each kind its own; what only some have answers for itself.

The limits are today's figures; they only fall, and none is above twelve.
"""

from __future__ import annotations

import pytest

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.context_effect import ContextEffect
from glovecal_models.effects.base.dynamics import ArrayStateEffect, HistoryEffect, InstantEffect
from glovecal_models.effects.base.effect import (
    CorrectionEffect,
    Dynamics,
    Effect,
    FurtherColumns,
    Hidden,
    IntervalEffect,
    LiveRepair,
    RepairByPrediction,
    RepairEffect,
    SignatureEffect,
    Stream,
)
from glovecal_models.effects.base.facts import About, Shape, Weights, WeightsOfWearings
from glovecal_models.effects.base.findings import Hold, Interval
from glovecal_models.effects.base.relations import Relations
from glovecal_models.effects.catalogue import catalogue

KINDS = {CorrectionEffect: 12, RepairEffect: 12, IntervalEffect: 12, SignatureEffect: 7}
PARTS = {
    Effect: 5,
    About: 10,
    Shape: 2,
    Weights: 4,
    WeightsOfWearings: 4,
    EffectComparison: 12,
    Dynamics: 7,
    Stream: 4,
    FurtherColumns: 5,
    RepairByPrediction: 1,
    LiveRepair: 2,
    Hidden: 2,
    Hold: 2,
    Interval: 2,
}
"""What an answer of an effect can be asked for in turn."""
MOST = 12


def members(asked: type) -> set[str]:
    """Public ones, annotated attributes included."""
    annotated = {name for each in asked.__mro__ for name in vars(each).get("__annotations__", {})}
    return {name for name in (*dir(asked), *annotated) if not name.startswith("_")}


@pytest.mark.parametrize("asked", [*KINDS, *PARTS], ids=lambda asked: asked.__name__)
def test_there_are_few_members(asked: type) -> None:
    found, limit = members(asked), (KINDS | PARTS)[asked]
    assert limit <= MOST
    assert len(found) == limit, f"{len(found)}: {', '.join(sorted(found))}; the limit is {limit}"


@pytest.mark.parametrize(
    ("asked", "base", "most"), [(ContextEffect, InstantEffect, 6), (ArrayStateEffect, HistoryEffect, 2)]
)
def test_what_is_asked_by_its_class_answers_little_more(asked: type, base: type, most: int) -> None:
    """A context column is tried in any smooth form and in steps; memories of arrays are run side by side."""
    assert len(members(asked) - members(base)) <= most, members(asked) - members(base)


def test_every_effect_is_of_one_kind() -> None:
    for name, effect in catalogue().items():
        kinds = [kind for kind in (CorrectionEffect, SignatureEffect) if isinstance(effect, kind)]
        assert len(kinds) == (name != "no_effect"), name
        assert not (isinstance(effect, RepairEffect) and isinstance(effect, IntervalEffect)), name


def test_the_table_between_effects_answers_few_questions() -> None:
    methods = {name for name in members(Relations) if callable(getattr(Relations, name, None))}
    assert len(methods) <= MOST, methods
