"""Which models and takes are compared: two selects, and why a choice was not followed."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.studio.comparison.choices import (
    MOST_MODELS,
    Choice,
    Row,
    are_comparable,
    model_options,
    take_options,
    usual_takes,
)


class ChoiceBar:
    """``tried`` shows a choice and answers whether the service took it; one it refused changes nothing."""

    def __init__(
        self,
        models: Sequence[Row],
        takes: Sequence[Row],
        choice: Choice,
        tried: Callable[[Choice], Awaitable[bool]],
    ) -> None:
        """``models`` and ``takes``: all there are."""
        self.choice = choice
        self.takes = takes
        self._models = models
        self._tried = tried
        self._notice = ui.label(" ".join(choice.notices)).props('role="status"')
        self._notice.classes("studio-notice compare-notice")
        with ui.row().classes("choices"):
            self._model_select = ui.select(
                model_options(models),
                multiple=True,
                label="Models",
                value=[each["id"] for each in choice.models],
                on_change=self._choose_models,
            )
            self._take_select = ui.select(
                take_options(choice.models, takes),
                multiple=True,
                label="Takes",
                value=self._offered(choice),
                on_change=self._choose_takes,
            )
            for select in (self._model_select, self._take_select):
                select.props("use-chips").classes("choice")

    @property
    def told(self) -> str:
        return self._notice.text

    def tell(self, notice: str) -> None:
        self._notice.set_text(notice)

    def choose(self, choice: Choice) -> None:
        """What is shown from now on."""
        self.choice = choice
        self.tell(" ".join(choice.notices))
        self._restore()

    def _restore(self, notice: str = "") -> None:
        """The selects as the choice is."""
        if notice:
            self.tell(notice)
        options = take_options(self.choice.models, self.takes)
        self._take_select.set_options(options, value=self._offered(self.choice))
        self._model_select.set_value([each["id"] for each in self.choice.models])

    def _offered(self, choice: Choice) -> list[str]:
        options = take_options(choice.models, self.takes)
        return [take for take in choice.takes if take in options]

    async def _choose_models(self, event: ValueChangeEventArguments) -> None:
        before = {each["id"] for each in self.choice.models}
        if set(event.value) == before:
            return
        chosen = [each for each in self._models if each["id"] in event.value]
        if not chosen:
            self._restore("One model at least is compared.")
            return
        newest = next((each for each in chosen if each["id"] not in before), chosen[0])
        own = [each for each in self.choice.models if each in chosen and are_comparable(newest, each)]
        own += [each for each in chosen if each not in own and are_comparable(newest, each)]
        if len(own) > MOST_MODELS:
            self._restore(f"{MOST_MODELS} models at most are compared at once.")
            return
        same = are_comparable(newest, self.choice.models[0])
        takes = self.choice.takes if same else usual_takes(own, self.takes)
        await self._try(Choice(tuple(own), takes))

    async def _choose_takes(self, event: ValueChangeEventArguments) -> None:
        if set(event.value) == set(self.choice.takes):
            return
        takes = tuple(each["id"] for each in self.takes if each["id"] in event.value)
        if not takes:
            self._restore("One take at least is compared.")
            return
        await self._try(Choice(self.choice.models, takes))

    async def _try(self, choice: Choice) -> None:
        if not await self._tried(choice):
            self._restore()
