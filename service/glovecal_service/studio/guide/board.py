"""The board that guides a person with a glove on: large text, a ring of the seconds left, tones, keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

from nicegui.element import Element
from nicegui.events import GenericEventArguments

Tone = Literal["", "begin", "end", "good", "bad", "lost", "done"]
MAIN_KEYS = (" ", "Enter", "PageDown")
"""What foot pedals and presenters send."""
RESEND_AFTER_S = 0.3
"""The page counts down by itself; it is told again when it would be off by so much."""


@dataclass(frozen=True)
class Shown:
    """What the board says. ``tone`` sounds once for each ``number``."""

    phase: str
    line: str
    """What to do, or what happens, now."""
    ask: str = ""
    """In the largest letters."""
    note: str = ""
    needs: str = ""
    why: str = ""
    last: str = ""
    number: int = 0
    tone: Tone = ""
    of_s: float | None = None
    """Length of this phase; None: nobody knows."""
    left_s: float | None = None
    wants: Literal["still", "motion"] = "still"


@dataclass(frozen=True)
class Motion:
    """How far the hand moved in the last half second, percent of a sensor's range; None: no frames."""

    percent: float | None
    still_percent: float


class Board(Element, component="board.js", esm={"glovecal-guide": "esm"}):
    """Shows one ``Shown`` after the other."""

    def __init__(self, shown: Shown, *, keys: Mapping[str, Sequence[str]], label: str) -> None:
        """``keys``: by act, as browsers name them. One that is held down acts once."""
        super().__init__()
        self._last: tuple[dict[str, Any], float | None] = ({}, None)
        self._props.update(keys={act: list(each) for act, each in keys.items()}, label=label)
        self.show(shown)

    def show(self, shown: Shown, motion: Motion | None = None) -> None:
        state = asdict(shown)
        if motion is not None:
            state |= {"steadiness": motion.percent, "still": motion.still_percent}
        left = state.pop("left_s")
        before, left_before = self._last
        drifted = left is not None and left_before is not None and left > left_before + RESEND_AFTER_S
        if state == before and not drifted:
            self._last = before, left
            return
        self._last = state, left
        self._props.update(state={**state, "left_s": left})
        self.update()

    def on_act(self, act: Callable[[str], Any]) -> None:
        """Call with the act whose key was pressed."""

        def told(event: GenericEventArguments) -> Any:
            return act(str(event.args))

        self.on("act", told)
