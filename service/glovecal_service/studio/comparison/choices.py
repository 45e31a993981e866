"""Which models and takes are compared: those of a link, else the newest model on takes it has not seen."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.amounts import made_of, version_name

MOST_MODELS = 4
MOST_TAKES_AT_FIRST = 6
"""Chosen without being asked for, the newest ones."""


@dataclass(frozen=True)
class Choice:
    models: tuple[Model, ...]
    """Of one subject and layout."""
    takes: tuple[str, ...]
    """Their ids, in the order they were recorded."""
    notices: tuple[str, ...] = ()
    """What of a link could not be followed."""


def measured_takes(model: Model, takes: Sequence[Take]) -> list[Take]:
    """Those that the model can be held against."""
    return [
        take
        for take in takes
        if take.subject == model.subject and take.layout == model.layout and take.rotations
    ]


def is_held_out(take: str, models: Sequence[Model]) -> bool:
    """Whether none of the models was trained on it."""
    return all(take not in model.trained_on for model in models)


def usual_takes(models: Sequence[Model], takes: Sequence[Take]) -> tuple[str, ...]:
    """The newest takes that were held out of training, else the newest there are."""
    own = [take.id for take in measured_takes(models[0], takes)]
    held_out = [take for take in own if is_held_out(take, models)]
    return tuple((held_out or own)[-MOST_TAKES_AT_FIRST:])


def first_choice(models: Sequence[Model], takes: Sequence[Take], wanted: str, on: str) -> Choice | None:
    """``wanted`` and ``on``: ids (of models also beginnings), of takes also names, with commas between.

    None where no model has takes with measured angles. Whether a take fits is for the service to say.
    """
    notices: list[str] = []
    chosen: list[Model] = []
    for name in filter(None, wanted.split(",")):
        model = next((each for each in models if each.id.startswith(name)), None)
        if model is None:
            notices.append(f"There is no model {name}.")
        elif chosen and not are_comparable(chosen[0], model):
            notices.append(not_comparable(chosen[0], model))
        elif model not in chosen:
            chosen.append(model)
    if len(chosen) > MOST_MODELS:
        notices.append(f"{MOST_MODELS} models at most are compared at once.")
    if not chosen:
        chosen = [each for each in reversed(models) if measured_takes(each, takes)][:1]
    if not chosen:
        return None
    chosen = chosen[:MOST_MODELS]
    found = []
    for name in filter(None, on.split(",")):
        take = next((each for each in takes if each.id == name), None) or next(
            (each for each in takes if each.name == name and each.subject == chosen[0].subject), None
        )
        if take is None:
            notices.append(f"There is no take {name}.")
        else:
            found.append(take.id)
    return Choice(tuple(chosen), tuple(dict.fromkeys(found)) or usual_takes(chosen, takes), tuple(notices))


def are_comparable(model: Model, other: Model) -> bool:
    return (model.subject, model.layout) == (other.subject, other.layout)


def not_comparable(model: Model, other: Model) -> str:
    return (
        f"Model {other.short} is of {other.subject} with layout {other.layout}, not of "
        f"{model.subject} with {model.layout}: models are compared on the same takes."
    )


def short_names(models: Sequence[Model]) -> list[str]:
    """Method and effects, with the id's first digits: short enough for a legend."""
    return [f"{made_of(each)} {each.id[:6]}" for each in models]


def model_options(models: Sequence[Model]) -> dict[str, str]:
    """Newest first."""
    return {each.id: f"{each.subject}: {version_name(each)}" for each in reversed(models)}


def take_options(models: Sequence[Model], takes: Sequence[Take]) -> dict[str, str]:
    """Every take of the subject; a take that does not fit says so, and is refused when it is chosen."""
    return {
        take.id: f"{take.name}, {take.wearing}, {take.duration_s:.0f} s, {_mark(take, models)}"
        for take in takes
        if take.subject == models[0].subject
    }


def _mark(take: Take, models: Sequence[Model]) -> str:
    if take.layout != models[0].layout:
        return f"layout {take.layout}"
    if not take.rotations:
        return "no measured angles"
    return "held out" if is_held_out(take.id, models) else "trained on"


class ChoiceBar:
    """``tried`` shows a choice and answers whether the service took it; one it refused changes nothing."""

    def __init__(
        self,
        models: Sequence[Model],
        takes: Sequence[Take],
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
                value=[each.id for each in choice.models],
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
        self._model_select.set_value([each.id for each in self.choice.models])

    def _offered(self, choice: Choice) -> list[str]:
        options = take_options(choice.models, self.takes)
        return [take for take in choice.takes if take in options]

    async def _choose_models(self, event: ValueChangeEventArguments) -> None:
        before = {each.id for each in self.choice.models}
        if set(event.value) == before:
            return
        chosen = [each for each in self._models if each.id in event.value]
        if not chosen:
            self._restore("One model at least is compared.")
            return
        newest = next((each for each in chosen if each.id not in before), chosen[0])
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
        takes = tuple(each.id for each in self.takes if each.id in event.value)
        if not takes:
            self._restore("One take at least is compared.")
            return
        await self._try(Choice(self.choice.models, takes))

    async def _try(self, choice: Choice) -> None:
        if not await self._tried(choice):
            self._restore()
