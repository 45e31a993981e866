"""Whether a model is served: said only once a pose of the glove carries its id."""

from __future__ import annotations

from nicegui import ui
from starlette.concurrency import run_in_threadpool

from glovecal_service.studio.repeating import again
from glovecal_service.studio.studio import Studio

EVERY_S = 0.5


class ServedLabel:
    """A sentence that follows a glove until its poses are made with ``model``; built where it is made."""

    def __init__(self, studio: Studio, glove: str, model: str, what: str) -> None:
        """``what``: the model's part of the sentence, such as "Trained"."""
        self._studio, self._glove, self._model, self._what = studio, glove, model, what
        self._label = ui.label(f"{what}.").props('role="status"')
        self._timer = again(EVERY_S, self._look)

    async def _look(self) -> None:
        state = (await run_in_threadpool(self._studio.feeds.states)).get(self._glove)
        if state is None or state.word == "lost":
            self._label.set_text(f"{self._what}. {self._glove} sends no frames; it is served when they come.")
        elif state.model == self._model:
            self._label.set_text(f"{self._what}, and served: the poses of {self._glove} are made with it.")
            self._timer.deactivate()
        else:
            self._label.set_text(f"{self._what}, not served yet. {state.sentence}")
