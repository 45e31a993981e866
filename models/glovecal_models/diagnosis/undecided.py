"""Effects that these takes cannot decide, though they may well be there."""

from __future__ import annotations

from collections.abc import Sequence

from glovecal_models.diagnosis.candidates import NotJudgeable
from glovecal_models.diagnosis.known_effect import KnownEffect
from glovecal_models.diagnosis.naming import Naming
from glovecal_models.diagnosis.next_take import NextTake
from glovecal_models.diagnosis.something_left import Left
from glovecal_models.effects.base.effect import Effect


def likelier(impossible: Sequence[NotJudgeable], naming: Naming) -> list[NotJudgeable]:
    """Those that would save more than the one that is to be named."""
    if not naming.ranked:
        return []
    return [item for item in impossible if item.saved_square > naming.ranked[0].saved_square]


def as_known(item: NotJudgeable, candidates: Sequence[Effect]) -> KnownEffect:
    """On the joints where it saves much."""
    found = item.would_save
    assert found is not None
    effect = next(each for each in candidates if each.name == item.effect)
    where = tuple(found.joints[i] for i in item.joints_saved)
    return KnownEffect(effect, where, tuple(found.shapes[i] for i in item.joints_saved))


def deciding(impossible: Sequence[NotJudgeable], left: Left) -> NextTake | None:
    """The recording that lets an effect be judged which may well be there, or a wearing if any may."""
    asked = [item for item in impossible if item.record is not None]
    likely = sorted((item for item in asked if item.saves_much), key=lambda item: -item.saved_square)
    unexplained = left.is_left or left.not_judgeable is not None
    wearing = [item for item in asked if item.effect == "donning_shift" and unexplained]
    return next((item.record for item in (*likely, *wearing)), None)
