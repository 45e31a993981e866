"""What effects have to know about each glove: which wearing a run is, and what its context values mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from glovecal_client.wire.frame import Frame
from glovecal_models.takes.known_latency import KnownLatency


@dataclass(frozen=True)
class WornGlove:
    """What was said about one glove."""

    run_id: str = ""
    """The run that the wearing is of, 16 hexadecimal digits."""
    wearing: str = ""
    """"" when nobody said."""
    context: tuple[str, ...] = ()
    """Names of a frame's context values, in order."""
    latency_ns: int = 0
    """How long before a frame's time the hand was as it shows; 0 if nobody measured it."""
    sensors: tuple[str, ...] = ()
    """Names of a frame's readings, in order; empty while capture has not said them."""

    @classmethod
    def of(
        cls, meta: Mapping[str, Any] | None, wearing: str | None, latency: KnownLatency | None = None
    ) -> WornGlove:
        """``meta`` as capture said it, ``wearing`` as the store has it (it knows later assignments too)."""
        meta = meta or {}
        names = meta.get("context")
        context = tuple(map(str, names)) if isinstance(names, list) else ()
        latency_ns = 0 if latency is None else round(1e9 * latency.seconds)
        said = meta.get("sensors")
        sensors = tuple(map(str, said)) if isinstance(said, list) else ()
        return cls(str(meta.get("run_id") or ""), wearing or "", context, latency_ns, sensors)

    def wearing_of(self, frame: Frame) -> str:
        """A run of which nothing was said yet is a wearing of its own, without a name."""
        return self.wearing if self.run_id == f"{frame.run_id:016x}" else ""

    def context_of(self, frame: Frame, wanted: tuple[str, ...]) -> dict[str, float]:
        """Those of the ``wanted`` columns that this frame has a value of.

        Nothing when the frame has another number of values than there are names.
        """
        if not wanted or len(frame.context) != len(self.context):
            return {}
        values = dict(zip(self.context, frame.context.tolist(), strict=True))
        return {name: values[name] for name in wanted if not np.isnan(values.get(name, np.nan))}


class WornGloves:
    """Written by the model watcher, read between frames."""

    def __init__(self) -> None:
        self._gloves: dict[str, WornGlove] = {}

    def of(self, glove: str) -> WornGlove:
        return self._gloves.get(glove, _UNKNOWN)

    def put(self, glove: str, worn: WornGlove) -> None:
        self._gloves[glove] = worn

    def forget(self, glove: str) -> None:
        self._gloves.pop(glove, None)


_UNKNOWN = WornGlove()
