"""Which physical effect is missing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import Progress, library_call
from glovecal._effects import declared
from glovecal._model import CalibrationModel, about, inner_model
from glovecal._takes import takes_in
from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_models.presentation.document import Answer, Presentation
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.diagnosis.diagnosis import Diagnosis as InnerDiagnosis


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Answer):
    """Evidence for physical effects that a model does not have, each beside its control."""

    inner: InnerDiagnosis
    """``glovecal_models.diagnosis.diagnosis.Diagnosis``: evidence for each rotation and block of time."""
    answer: MissingEffects
    """All its numbers, as REST and ``--json`` give them."""

    @property
    def effect(self) -> str | None:
        """The effect that is named; None when none is."""
        named = self.answer.named
        return None if named is None else named.effect

    @property
    def rotations(self) -> tuple[str, ...]:
        """Where the named effect acts; sensors or takes where it is a fault of those."""
        named = self.answer.named
        return () if named is None else named.where

    @property
    def confidence_set(self) -> tuple[str, ...]:
        """The named effect, and all that these takes cannot tell from it."""
        named = self.answer.named
        return () if named is None else named.confidence_set

    @property
    def set_aside(self) -> tuple[str, ...]:
        """A sentence on each take that does not fit the others, and what would make it fit."""
        return tuple(f"{item.sentence} It is set aside." for item in self.answer.odd_takes)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to know, the most important first."""
        return (*self.set_aside, *self.answer.sentences)

    @property
    def decided(self) -> tuple[str, ...]:
        """The rules that decided, in the order in which they are asked, each with a sentence."""
        return tuple(f"{item.rule}: {item.sentence}" for item in self.answer.decided)

    @property
    def not_identifiable(self) -> dict[str, str]:
        """Effects that these takes cannot show, and why."""
        return {item.effect: item.why for item in self.answer.not_identifiable}

    @property
    def next_take(self) -> str | None:
        """What to record to tell the confidence set apart; None when there is nothing to tell apart."""
        following = self.answer.next_take
        return None if following is None else f"{following.seconds} s: {following.what}"

    def presentation(self) -> Presentation:
        return self.answer.presentation()


def diagnose(
    model: CalibrationModel,
    takes: Take | Iterable[Take],
    *,
    also: Sequence[str] = (),
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Diagnosis:
    """Try every known effect on held-out takes, beside a control with the same freedom that cannot be right.

    A take that does not fit the others is set aside first, and told. ``also``: effects of your own as text,
    such as ``"name = strap; columns = c.strap_n * own"``. ``seed`` is of the controls. Raises BadInput,
    Cancelled.
    """
    from glovecal_models.diagnosis.model_on_takes import diagnose_model
    from glovecal_models.diagnosis.text import missing_in_model

    inner, takes = inner_model(model), takes_in(takes)
    own = declared(also)
    with library_call(progress) as report:
        found = diagnose_model(inner, takes, own=own, seed=seed, cancelled=cancelled, report=report)
        answer = missing_in_model(found.diagnosis, found.odd, inner, takes, own)
    return Diagnosis(found.diagnosis, about(answer, takes, model))
