"""Live: each glove that is connected, its state in a word and a colour, its hand, its sensors."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from contextlib import suppress

from nicegui import ui
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.rest.glove.answer import Gloves
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.glove_state import GloveState
from glovecal_service.studio.next_steps import connect_or_try, next_steps
from glovecal_service.studio.pages.glove_card import GloveCard
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 0.5
LOOK_AGAIN_S = 5.0
"""Models and wearers change elsewhere too."""
NO_GLOVE = "No glove is connected. Run: glovecal capture --device DEVICE --glove NAME"


def add(studio: Studio) -> None:
    """``/studio/live``, also the first page."""

    @page("/")
    @page("/live")
    async def live() -> None:
        async with shell(studio, "live", "Live") as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            await LivePage(studio).build(around.chosen)


class LivePage:
    """One open page; gloves come and go."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._cards: dict[str, GloveCard] = {}
        self._served: dict[str, str | None] = {}
        self._looked_at = 0.0

    async def build(self, about: Chosen) -> None:
        self._notice = ui.label("").classes("studio-notice").props('role="status"')
        self._gloves = ui.element("div").classes("gloves")
        self._next = ui.element("div")
        with self._next:
            connect_or_try()
            await next_steps(self._studio.service, about)
        await self._look()
        again(EVERY_S, self._look)

    async def _look(self) -> None:
        try:
            states = await run_in_threadpool(self._studio.feeds.states)
        except ClientError as error:
            self._notice.set_text(f"The real-time process does not answer: {error}")
            return
        self._notice.set_text("" if states else NO_GLOVE)
        self._next.set_visibility(not states)
        await self._follow(states)
        for glove, state in states.items():
            if glove in self._cards:
                self._cards[glove].look(state)

    async def _follow(self, states: Mapping[str, GloveState]) -> None:
        """Gloves that came, and what was changed elsewhere: wearers, models and which of them are active."""
        served = {glove: state.model for glove, state in states.items()}
        if served == self._served and time.monotonic() - self._looked_at < LOOK_AGAIN_S:
            return
        with suppress(Refusal):  # the database may be away for a moment; the states are shown all the same
            await self._look_again(served)
            self._served, self._looked_at = served, time.monotonic()

    async def _look_again(self, gloves: Iterable[str] = ()) -> None:
        seen = {each.name: each for each in (await self._studio.service.read(Gloves, "/gloves")).seen}
        new = [glove for glove in gloves if glove not in self._cards]
        for glove, card in self._cards.items():
            await card.follow(seen.get(glove))
        for glove in new:
            with self._gloves:
                card = GloveCard(self._studio, glove, self._look_again)
                await card.build(seen.get(glove))
                self._cards[glove] = card
        if new:
            self._sort()

    def _sort(self) -> None:
        """Hands of one wearer side by side, the left one first."""
        for place, card in enumerate(sorted(self._cards.values(), key=lambda each: each.place)):
            card.move_to(place)
