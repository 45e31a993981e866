"""The body of a question's request: what it is asked of, beside what it asks."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from pydantic import Field, create_model

from glovecal_models.hand.rotations import Handedness
from glovecal_service.questions.chosen_takes import TakesNamed, any_takes, measured_takes, model_takes
from glovecal_service.questions.declarations import Declared, checked_declaration, declaration_document
from glovecal_service.questions.model_work import named_takes, stored_takes
from glovecal_service.questions.question import Asked, AsOption, Question, Who
from glovecal_service.request_types import Identifier, StrictBody
from glovecal_service.store import Store

MOST_DECLARATIONS = 8


class OfTakes(StrictBody):
    takes: Annotated[TakesNamed | None, AsOption(("--take", "-t"))] = None
    """Take to look at, by id or name; null: those the model was trained on, else all that were measured."""


class OfSubject(OfTakes):
    layout: Annotated[Identifier | None, AsOption(("--layout", "-l"))] = None
    """Only of this layout; null: the takes have one."""
    hand: Annotated[Handedness | None, AsOption(("--hand",))] = None
    """Of a subject with two gloves, which: left or right."""


OWN_EFFECTS: Any = (
    Annotated[
        list[Declared],
        Field(
            max_length=MOST_DECLARATIONS,
            description="An effect of your own to try too (docs/own-effect.md).",
        ),
        AsOption(("--expression", "-e")),
    ],
    Field(default=[]),
)


@cache
def body_of(question: Question, who: Who) -> type[StrictBody]:
    """The body of the question's route."""
    of = () if question.of_training else (OfTakes if who == "model" else OfSubject,)
    bases = (*of, question.request)
    own = {} if question.own_effects is None else {question.own_effects: OWN_EFFECTS}
    return create_model(f"{who.title()}{question.request.__name__}", __base__=bases, **own)


def asked_of_model(store: Store, question: Question, id: str, body: Any) -> Asked:
    """Raises as ``model_takes``, and BadInput."""
    model = store.models.get(id)
    if question.of_training:
        takes = stored_takes(store, named_takes(model))
    elif question.of_any_takes and body.takes is not None:
        takes = any_takes(store, model.subject, body.takes)
    else:
        takes = model_takes(store, model, body.takes)
    layout = store.layouts.get(model.layout)
    own = _declarations(question, body, takes, layout.sensors)
    return Asked(_request(question, body), model.subject, layout, takes, model, own)


def asked_of_subject(store: Store, question: Question, name: str, body: Any) -> Asked:
    """Raises as ``measured_takes``, and BadInput."""
    subject = store.subjects.get(name).name
    takes = measured_takes(store, subject, body.takes, body.layout, body.hand)
    layout = store.layouts.get(takes[0].layout)
    own = _declarations(question, body, takes, layout.sensors)
    return Asked(_request(question, body), subject, layout, takes, None, own)


def _request(question: Question, body: Any) -> Any:
    """A body of another route has fewer fields: there the question's defaults count."""
    fields = [name for name in question.request.model_fields if hasattr(body, name)]
    return question.request(**{name: getattr(body, name) for name in fields})


def _declarations(question: Question, body: Any, takes: Any, sensors: Any) -> list[dict[str, Any]]:
    own: list[Declared] = [] if question.own_effects is None else getattr(body, question.own_effects)
    return [declaration_document(checked_declaration(item.declaration, takes, sensors)) for item in own]
