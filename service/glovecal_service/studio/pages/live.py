"""Live: each glove that is connected, its state in a word and a colour, its hand, its sensors."""

from __future__ import annotations

from nicegui import ui
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.studio.next_steps import connect_or_try, next_steps
from glovecal_service.studio.pages.glove_card import GloveCard
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 0.5
NO_GLOVE = "No glove is connected. Run: glovecal capture --device DEVICE --glove NAME"


def add(studio: Studio) -> None:
    """``/studio/live``, also the first page."""

    @page("/")
    @page("/live")
    async def live() -> None:
        async with shell(studio, "live", "Live"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            await LivePage(studio).build()


class LivePage:
    """One open page; gloves come and go."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._cards: dict[str, GloveCard] = {}

    async def build(self) -> None:
        self._notice = ui.label("").classes("studio-notice").props('role="status"')
        self._gloves = ui.element("div").classes("gloves")
        self._next = ui.element("div")
        with self._next:
            connect_or_try()
            await next_steps(self._studio.service)
        await self._look()
        ui.timer(EVERY_S, self._look)

    async def _look(self) -> None:
        try:
            states = await run_in_threadpool(self._studio.feeds.states)
        except ClientError as error:
            self._notice.set_text(f"The real-time process does not answer: {error}")
            return
        self._notice.set_text("" if states else NO_GLOVE)
        self._next.set_visibility(not states)
        new = [glove for glove in states if glove not in self._cards]
        for glove in new:
            with self._gloves:
                card = self._cards[glove] = GloveCard(self._studio, glove)
                await card.build()
        if new:
            self._sort()
        for glove, state in states.items():
            await self._cards[glove].look(state)

    def _sort(self) -> None:
        """Hands of one wearer side by side, the left one first."""
        for place, card in enumerate(sorted(self._cards.values(), key=lambda each: each.place)):
            card.move_to(place)
