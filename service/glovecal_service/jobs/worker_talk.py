"""What a service and a worker elsewhere say to each other before Dask does, and beside it: lines of JSON over
TLS. Nothing in them is run or unpickled.

The worker begins: its code, and what it wants. A connection for ``WORK`` lasts as long as the worker does;
both say every two seconds that they live. Through each of the others, for the ``SCHEDULER``, Dask's bytes
pass as they are, encrypted once more by Dask with the keys that the first one brought.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

WORK, SCHEDULER = "work", "scheduler"
ALIVE_EVERY_S = 2.0
SILENT_FOR_S = 8.0
"""Who says nothing for so long is gone."""
GREETED_WITHIN_S = 5.0
_PIECE = 1 << 18
_LONGEST_LINE = 1 << 15


class Gone(Exception):
    """The other side closed, went silent, or said what nobody understands."""


@dataclass(frozen=True)
class Line:
    """A connection."""

    reader: asyncio.StreamReader
    writer: asyncio.StreamWriter

    async def say(self, **words: Any) -> None:
        """Raises Gone."""
        try:
            self.writer.write(json.dumps(words).encode() + b"\n")
            await asyncio.wait_for(self.writer.drain(), SILENT_FOR_S)
        except (OSError, TimeoutError) as error:
            raise Gone from error

    async def hear(self, within_s: float = SILENT_FOR_S) -> Mapping[str, Any]:
        """Raises Gone."""
        try:
            line = await asyncio.wait_for(self.reader.readline(), within_s)
            words = json.loads(line) if len(line) < _LONGEST_LINE else None
        except (OSError, TimeoutError, ValueError, RecursionError) as error:
            raise Gone from error
        if not isinstance(words, dict):
            raise Gone
        return words

    async def say_alive(self) -> None:
        """For ever. Raises Gone."""
        while True:
            await self.say(alive=True)
            await asyncio.sleep(ALIVE_EVERY_S)

    def close(self) -> None:
        """At once, whatever was not sent yet."""
        self.writer.transport.abort()

    async def end(self) -> None:
        """Once all is sent."""
        try:
            self.writer.close()
            await asyncio.wait_for(self.writer.wait_closed(), GREETED_WITHIN_S)
        except (OSError, TimeoutError):
            self.close()


async def pass_on(one: Line, other: Line) -> None:
    """Whatever comes, in both directions, until either closes."""

    async def copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while piece := await reader.read(_PIECE):
                writer.write(piece)
                await writer.drain()
        except OSError:
            pass
        finally:
            writer.close()

    try:
        await asyncio.gather(copy(one.reader, other.writer), copy(other.reader, one.writer))
    finally:
        one.close()
        other.close()
