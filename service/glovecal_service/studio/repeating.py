"""What a page does by itself: again and again while it is open, or once it is there."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from inspect import isawaitable

from nicegui import ui

from glovecal_service.studio.service import Refusal, is_session_over, warn

Look = Callable[[], Awaitable[object] | object]


def again(every_s: float, look: Look, *, active: bool = True) -> ui.timer:
    """``look`` every so many seconds. What the service refuses is told once until it answers again; nothing
    is looked at any more once the session is over."""
    return ui.timer(every_s, _Repeated(look), active=active)


def soon(look: Look) -> ui.timer:
    """``look`` once, when the page is there."""
    return ui.timer(0.0, _Repeated(look), once=True)


class _Repeated:
    def __init__(self, look: Look) -> None:
        self._look = look
        self._complaint = ""

    async def __call__(self) -> None:
        if is_session_over():
            return
        try:
            done = self._look()
            if isawaitable(done):
                await done
            self._complaint = ""
        except Refusal as refusal:
            if not is_session_over() and str(refusal) != self._complaint:
                self._complaint = str(refusal)
                warn(self._complaint)
