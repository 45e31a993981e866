"""Who wears which glove: the choice of both, with the glove's state in a word."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.events import ValueChangeEventArguments
from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError
from glovecal_service.rest.glove.answer import GloveView
from glovecal_service.studio.person_choice import People
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio

WORD_EVERY_S = 0.7


class GloveAndWearer:
    """The choice of a glove and its wearer, with the glove's state in a word."""

    def __init__(self, studio: Studio, gloves: Sequence[GloveView]) -> None:
        self._studio = studio
        self._gloves = {each.name: each for each in gloves}
        self._word: ui.label

    async def build(self, subject: str | None = None) -> None:
        self._people = await People.of(self._studio.service)
        states = await _states(self._studio)
        newest = sorted(self._gloves, key=lambda name: (name in states, self._gloves[name].last_seen_at))
        with ui.element("div").classes("capture-fields"):
            self._glove = ui.select(
                list(self._gloves), value=newest[-1], label="Glove", on_change=self._changed
            ).classes("choice")
            wearer = subject or self._gloves[newest[-1]].subject or ""
            wearer = wearer if await self._people.has(wearer) else ""
            self._people = self._people.and_also(wearer)
            self._subject = self._people.select("Subject", wearer or None, may_be_new=True)
            self._subject.props('hint="A new name, with Enter, adds a subject."')
        with ui.row().classes("glove-head"):
            self._word = ui.label("").classes("state-word").props('role="status"')
            self._sentence = ui.label("")
        await self._look()
        again(WORD_EVERY_S, self._look)

    @property
    def glove(self) -> str:
        return str(self._glove.value)

    @property
    def layout(self) -> str | None:
        return self._gloves[self.glove].layout

    @property
    def hand(self) -> str | None:
        """Which one the glove is for; None where its capture does not know."""
        return self._gloves[self.glove].known_hand

    @property
    def subject(self) -> str:
        return str(self._subject.value or "").strip().lower()

    async def put_on(self, wearing: str | None = None) -> None:
        """Tell the service who wears the glove, and in which wearing; a new subject is added. Raises
        Refusal."""
        if not self.subject:
            raise Refusal(422, "Choose a subject, or type a new name.")
        people = await People.of(self._studio.service)
        glove = self._gloves[self.glove]
        if not await people.has(self.subject):
            await self._studio.service.post("/subjects", {"name": self.subject, "hand": self.hand})
        if wearing is not None or glove.subject != self.subject:
            body = {"subject": self.subject, "wearing": wearing or glove.wearing}
            await self._studio.service.put(f"/gloves/{quote(self.glove)}/wearer", body)

    async def _look(self) -> None:
        state = (await _states(self._studio)).get(self.glove)
        word = "lost" if state is None else "ok" if state.word == "unwatched" else state.word
        self._word.set_text("connected" if word == "ok" else word)
        if self._word.props.get("data-word") != word:
            self._word.props["data-word"] = word
            self._word.update()
        self._sentence.set_text("Its capture is not running." if state is None else state.sentence)

    async def _changed(self, event: ValueChangeEventArguments) -> None:
        wearer = self._gloves[str(event.value)].subject
        if wearer:
            self._people.choose(self._subject, wearer)
        await self._look()


async def _states(studio: Studio) -> dict[str, Any]:
    try:
        return await run_in_threadpool(studio.feeds.states)
    except ClientError:
        return {}
