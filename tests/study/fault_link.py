"""The network between a capture and its router, in our hands: cut, slow, still, or damaging bytes."""

from __future__ import annotations

import asyncio
import random
import threading
from contextlib import suppress

PART_BYTES = 4096
LOOK_EVERY_S = 0.01
ONE_BYTE_IN = 2000
"""How many bytes pass for each that a damaging link changes."""


class NetworkLink:
    """A TCP proxy on a port of its own. Its attributes may be set from any thread at any time."""

    def __init__(self, port: int, seed: int) -> None:
        """``port``: of the router, on this computer."""
        self.cut = False
        """Connections are broken, and new ones end at once."""
        self.still = False
        """Nothing passes and nobody is told, as with a cable that was pulled."""
        self.delay_s = 0.0
        self.bytes_per_s: float | None = None
        self.damaging = False
        self._port, self._random = port, random.Random(seed)
        self._writers: set[asyncio.StreamWriter] = set()
        self._started = threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="link", daemon=True)
        self._thread.start()
        self._started.wait()

    def close(self) -> None:
        self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join()

    async def _serve(self) -> None:
        self._loop, self._ended = asyncio.get_running_loop(), asyncio.Event()
        self._passing: set[asyncio.Task[None]] = set()
        server = await asyncio.start_server(self._connected, "127.0.0.1", 0)
        self.port: int = server.sockets[0].getsockname()[1]
        self._started.set()
        while not self._ended.is_set():
            if self.cut:
                self._break()
            with suppress(TimeoutError):
                await asyncio.wait_for(self._ended.wait(), LOOK_EVERY_S)
        server.close()
        self._break()
        for task in self._passing:
            task.cancel()
        await asyncio.gather(*self._passing, return_exceptions=True)

    def _break(self) -> None:
        for writer in self._writers:
            writer.transport.abort()
        self._writers.clear()

    async def _connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._passing.add(task)
        try:
            with suppress(OSError):
                there_reader, there = await asyncio.open_connection("127.0.0.1", self._port)
                self._writers |= {writer, there}
                await asyncio.gather(self._pass(reader, there), self._pass(there_reader, writer))
        finally:
            writer.transport.abort()
            self._passing.discard(task)

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError):
            while part := await reader.read(PART_BYTES):
                while self.still:
                    await asyncio.sleep(LOOK_EVERY_S)
                if self.delay_s:
                    await asyncio.sleep(self.delay_s)
                if self.bytes_per_s:
                    await asyncio.sleep(len(part) / self.bytes_per_s)
                writer.write(self._damaged(part) if self.damaging else part)
                await writer.drain()
        writer.transport.abort()

    def _damaged(self, part: bytes) -> bytes:
        changed = bytearray(part)
        for at in range(len(changed)):
            if self._random.random() < 1 / ONE_BYTE_IN:
                changed[at] ^= 1 << self._random.randrange(8)
        return bytes(changed)
