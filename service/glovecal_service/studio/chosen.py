"""Who and which model a tab is about: chosen in the header, kept in the address from page to page."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import quote, urlencode

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.amounts import version_name
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.service import Refusal, Service

MOST_OFFERED = 200
"""Models or takes of one person in a list to choose from, the newest ones."""


@dataclass(frozen=True)
class Chosen:
    people: People
    person: str
    """"" where nobody is known."""
    models: tuple[Model, ...]
    """The person's, newest first."""
    model: Model | None
    """None where the person has none."""
    notice: str
    """What of the address could not be followed."""

    @property
    def is_simulated(self) -> bool:
        """Whether the model is of a simulated hand, which nobody's own takes belong to."""
        return self.model is not None and bool(self.model.facts.get("simulated"))

    def address(self, page: str, **more: str) -> str:
        """Of another page about the same, and ``more`` that it is told."""
        kept = {"who": self.person, "model": self.model.short if self.model else "", **more}
        query = urlencode({name: value for name, value in kept.items() if value})
        return f"/{page}?{query}" if query else f"/{page}"

    def of_person(self, person: str) -> Chosen:
        """The same page about somebody who may have been added on it; models are asked for on other pages."""
        if person == self.person:
            return self
        return Chosen(self.people.and_also(person), person, (), None, "")

    async def takes(self, service: Service) -> list[Take]:
        """The person's, the newest of them, in the order they were added."""
        if not self.person:
            return []
        query = {"subject": self.person, "reverse": True, "limit": MOST_OFFERED}
        return (await service.read(list[Take], "/takes", **query))[::-1]

    def selects(self, page: str, *, about_models: bool) -> None:
        """The choice itself: another one opens ``page`` anew."""

        def other_person(event: ValueChangeEventArguments) -> None:
            ui.navigate.to(f"/{page}?who={quote(event.value)}")

        def other_model(event: ValueChangeEventArguments) -> None:
            ui.navigate.to(f"/{page}?model={event.value}")

        if self.people.names:
            self.people.select("Person", self.person or None, other_person).props("dense")
        if about_models and self.model is not None:
            names = {each.id: version_name(each) for each in self.models}
            ui.select(names, value=self.model.id, label="Model", on_change=other_model).props(
                "dense"
            ).classes("choice")


async def chosen(service: Service) -> Chosen:
    """By the address of the page that is being built: its ``model`` or first of ``models``, else its take
    (``id``), else its ``who``, else the wearer of the newest active model, a real hand's where there is one,
    else of the newest take."""
    query = ui.context.client.request.query_params
    people = await People.of(service)
    wanted = query.get("model") or query.get("models", "").partition(",")[0]
    person, notice, own = query.get("who", ""), "", None
    if wanted:
        own, notice = await _named(service, wanted)
    if own is not None:
        person = own.subject
    elif take := query.get("id"):
        with suppress(Refusal):  # the page says that there is none
            person = (await service.read(Take, f"/takes/{quote(take)}")).subject
    if not person or not await people.has(person):
        person = await _usual(service, people)
    people = people.and_also(person)
    models: tuple[Model, ...] = ()
    if person:
        models = tuple(
            await service.read(list[Model], "/models", subject=person, reverse=True, limit=MOST_OFFERED)
        )
        if own is None:
            own = _active_or_newest(models)
        elif own not in models:
            models = (own, *models)
    return Chosen(people, person, models, own, notice)


async def _named(service: Service, wanted: str) -> tuple[Model | None, str]:
    """The model, or why it cannot be shown."""
    try:
        return (await service.read(list[Model], f"/models/{quote(wanted)}/lineage"))[0], ""
    except Refusal as refusal:
        if refusal.status == 409:
            return None, f"Several models begin with {wanted[:12]}."
        return None, f"There is no model {wanted[:12]}."


def _active_or_newest(models: Sequence[Model]) -> Model | None:
    """``models``: the newest first."""
    return next((each for each in models if each.active), next(iter(models), None))


async def _usual(service: Service, people: People) -> str:
    models = await service.read(list[Model], "/models", reverse=True, limit=MOST_OFFERED)
    takes = [] if models else await service.read(list[Take], "/takes", reverse=True, limit=1)
    real = [each for each in models if not each.facts.get("simulated")]
    latest = _active_or_newest(real or models) or next(iter(takes), None)
    if latest is not None:
        return latest.subject
    return people.names[-1] if people.names else ""
