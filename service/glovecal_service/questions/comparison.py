"""How large are a model's errors, and where does it fail?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.answer import Comparison, OnSeenTakes
from glovecal_models.comparison.compare import compare, cross_validation_difference
from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where.answer import WhereItFails, cross_validation_sentences
from glovecal_models.comparison.where_it_fails import where_it_fails
from glovecal_service.questions.ceiling import known_ceiling
from glovecal_service.questions.model_work import named_takes, trained_ids
from glovecal_service.questions.question import Asked, Question, WorkOnTakes
from glovecal_service.request_types import StrictBody
from glovecal_service.store import Store
from glovecal_service.store.records import ModelRecord, TakeRecord

Found = TypeVar("Found", bound=OnSeenTakes)


class ComparisonRequest(StrictBody):
    offline: bool = False
    """Of angles estimated with both directions of time, as recordings can be; the live error is beside it."""


class WhereRequest(StrictBody):
    cross_validation: bool = False
    """Also compare two models trained on disjoint halves of the training takes."""


def _compared(on: WorkOnTakes, request: ComparisonRequest) -> Comparison:
    return compare(on.loaded, on.takes, offline=request.offline, dimensions=on.hand)


def _failures(on: WorkOnTakes, _: WhereRequest) -> WhereItFails:
    return where_it_fails(residuals(on.loaded, on.takes))


def with_what_is_known(store: Store, asked: Asked, found: Found) -> Found:
    """The takes that the model has seen, and its ceiling."""
    assert asked.model is not None
    assert asked.loaded is not None
    ceiling = known_ceiling(store, asked.model)
    return replace(found, trained_on=trained_on(asked.model, asked.loaded, asked.takes), ceiling=ceiling)


def trained_on(record: ModelRecord, model: CalibrationModel, takes: Sequence[TakeRecord]) -> list[str]:
    """Ids of those of ``takes`` whose frames the model has seen."""
    named = set(named_takes(record))
    return [take.id for take in takes if take.id in named or take.artifact in model.takes]


def _with_cross_validation(store: Store, asked: Asked[WhereRequest], found: WhereItFails) -> WhereItFails:
    known = with_what_is_known(store, asked, found)
    if not asked.request.cross_validation:
        return known
    assert asked.model is not None
    assert asked.loaded is not None
    takes = [store.takes.load(id) for id in trained_ids(store, asked.model)]
    difference = cross_validation_difference(asked.loaded, takes)
    sentences = cross_validation_sentences(difference)
    return replace(known, cross_validation_difference=difference, sentences=sentences)


COMPARE = Question(
    kind="compare",
    verb=None,
    of=("model",),
    summary="The model against measurements",
    help="Errors in degrees, and of fingertips in mm; `trained_on` says which takes it has seen before.",
    request=ComparisonRequest,
    answer=Comparison,
    at_once=_compared,
    of_any_takes=True,
    finish=with_what_is_known,
)
WHERE = Question(
    kind="where",
    verb=None,
    of=("model",),
    summary="Where the model fails",
    help=(
        "Noise floor, what each error depends on (against chance), wearings, and the worst seconds.\n\n"
        "With `cross_validation` two models are trained on disjoint halves of the training takes and "
        "compared."
    ),
    request=WhereRequest,
    answer=WhereItFails,
    at_once=_failures,
    of_any_takes=True,
    finish=_with_cross_validation,
)
