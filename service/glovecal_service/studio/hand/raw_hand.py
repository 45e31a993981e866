"""Which sensor moves which joint of a hand that is drawn from readings alone."""

from __future__ import annotations

from urllib.parse import quote

from glovecal_service.rest.glove.answer import LayoutView
from glovecal_service.studio.hand.hand_view import HandView
from glovecal_service.studio.service import Refusal, Service

LEAST_SHARE = 0.1
"""Of a sensor's counts it has to have gone through before the raw hand follows it."""
LEAST_COUNTS = 20.0
"""Where the layout does not say what its sensors count."""


class RawHand:
    """What a view needs to know of a layout. Make it with ``await RawHand.of(service, layout)``."""

    def __init__(self, reads: dict[str, str], least: float) -> None:
        """The sensor that each rotation is read from, and how many counts it has to have moved."""
        self._reads, self._least = reads, least

    @classmethod
    async def of(cls, service: Service, layout: str | None) -> RawHand:
        """Without a layout each rotation is read from the sensor of its name."""
        try:
            known = await service.read(LayoutView, f"/gloves/{quote(layout or '')}") if layout else None
        except Refusal:
            known = None
        if known is None:
            return cls({}, LEAST_COUNTS)
        reads = {
            rotation: rotation if rotation in sensors else sensors[0]
            for rotation, sensors in known.read_from.items()
            if sensors
        }
        counts = known.document.get("counts")
        return cls(reads, LEAST_SHARE * (counts[1] - counts[0]) if counts else LEAST_COUNTS)

    def show(self, view: HandView, shown: bool) -> None:
        view.raw(self._reads, least=self._least, shown=shown)
