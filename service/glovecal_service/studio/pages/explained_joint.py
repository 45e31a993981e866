"""The joint that is chosen on a live hand: its angle term by term, while it is chosen."""

from __future__ import annotations

from starlette.concurrency import run_in_threadpool

from glovecal_client.errors import ClientError, QueryRefused
from glovecal_service.studio.hand.hand_view import HandView
from glovecal_service.studio.repeating import again
from glovecal_service.studio.strips.live_values import AngleList, LiveTerms
from glovecal_service.studio.studio import Studio

EVERY_S = 0.4
"""Numbers faster are not read; the next question follows the answer."""


class ExplainedJoint:
    """Chosen on the hand or in the list of angles; both show it."""

    def __init__(self, studio: Studio, glove: str, view: HandView) -> None:
        self._studio, self._glove, self._view = studio, glove, view
        self._chosen: str | None = None
        self._lists: list[AngleList] = []
        self._terms = LiveTerms(label=f"Terms of an angle of glove {glove}")
        self._timer = again(EVERY_S, self._ask, active=False)
        self._terms.on("close", lambda: self._choose(None))
        view.on_rotation(lambda rotation: self._choose(None if rotation == self._chosen else rotation))

    def choose_in(self, angles: AngleList) -> None:
        """Another place where a joint is chosen."""
        self._lists.append(angles)
        angles.on_rotation(self._choose)

    def end(self) -> None:
        """The page shows another hand from now on."""
        self._timer.cancel()

    def _choose(self, rotation: str | None) -> None:
        self._chosen = rotation
        self._view.choose(rotation)
        for angles in self._lists:
            angles.highlight(rotation)
        self._terms.begin(rotation)
        self._timer.active = rotation is not None

    async def _ask(self) -> None:
        rotation = self._chosen
        if rotation is None:
            return
        try:
            answer = await run_in_threadpool(self._studio.feeds.explain, self._glove, rotation)
        except QueryRefused as refused:
            said = str(refused)
            self._terms.refuse(f"{said[:1].upper()}{said[1:]}.")
        except ClientError:
            self._terms.refuse("The real-time process does not answer.")
        else:
            self._terms.show(answer)
