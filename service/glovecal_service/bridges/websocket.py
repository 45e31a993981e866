"""Poses for browsers: a WebSocket server that gives each receiver the newest pose it has not had yet.

    ws://127.0.0.1:8766/              JSON, every glove; /right only glove right
    ws://127.0.0.1:8766/binary/right  the wire's own poses of one glove, what they mean as JSON

A text message is a JSON object: ``type`` ``meta`` with a glove's ``pose/meta`` (names, hand, skeleton) before
the first pose and when it changes, or ``type`` ``pose``. Stale poses come on, their ``state`` says so (in a
binary message, the flag). Web pages of other computers are refused by their ``Origin``.
"""

from __future__ import annotations

import asyncio
import json
import re
import socket
import threading
from concurrent.futures import Future
from functools import cached_property
from types import TracebackType
from typing import TYPE_CHECKING, Any, ClassVar

from glovecal_client.keys import IDENTIFIER
from glovecal_client.wire.pose import encode_pose
from glovecal_models.errors import BadInput
from glovecal_service.bridges.bridge import LOOPBACK, Bridge, BridgeOptions
from glovecal_service.bridges.glove_pose import GlovePose, PoseMeaning
from glovecal_service.bridges.traffic import Traffic

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection
    from websockets.http11 import Request, Response
    from websockets.typing import Origin

DEFAULT_PORT = 8766
_OF_THIS_COMPUTER = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
_PATH = re.compile(r"/(?:(?P<binary>binary)/(?P<only>[^/?]+)|(?P<glove>(?!binary/?$)[^/?]*))/?(?:\?.*)?")
_MOST_WAITING_BYTES = 16_384
"""Of a receiver that does not read: some dozen poses in the system, then newer ones replace older ones."""
_LARGEST_INPUT_BYTES = 1024
_CLOSE_WITHIN_S = 1.0
"""At the end, for a receiver that does not read."""


class WebSocketBridge(Bridge):
    """Serves browsers, and any program that reads JSON from a WebSocket."""

    about = "web pages and scripts: JSON, or the wire's own binary poses"
    to_set_there = (
        "the address; a page that another computer serves needs `--option origin=ORIGIN`; "
        "[an example](#a-page-of-your-own)"
    )
    units = "degrees; the skeleton in mm, right-handed, x to the fingers, z out of the back of the hand"
    when_stale = "the last pose, with state stale"
    options: ClassVar[dict[str, str]] = {
        "port": f"to listen on; default {DEFAULT_PORT}",
        "host": f"address to listen on; default {LOOPBACK}, this computer only",
        "origin": "an origin whose pages may connect besides this computer's, such as https://stage.example; "
        "null for pages opened as files; several with commas",
    }
    needs = ("websockets", "websockets")

    def __init__(self, options: BridgeOptions, traffic: Traffic) -> None:
        super().__init__(options, traffic)
        self._host = options.more.get("host", LOOPBACK)
        self._port = DEFAULT_PORT if options.port is None else options.port
        self._origins = [origin for origin in options.more.get("origin", "").split(",") if origin]
        self._receivers: set[_Receiver] = set()
        self._newest: dict[str, _Messages] = {}
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_over: asyncio.Event | None = None
        self._thread: threading.Thread | None = None

    @property
    def where(self) -> str:
        return f"Browsers connect to ws://{self._host}:{self._port}/ (JSON) or /binary/GLOVE."

    @property
    def receivers(self) -> int:
        return len(self._receivers)

    def send(self, hand: GlovePose) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._offer, _Messages(hand))

    def __enter__(self) -> WebSocketBridge:
        is_up: Future[int] = Future()
        self._thread = threading.Thread(target=self._run, args=(is_up,), name="websocket", daemon=True)
        self._thread.start()
        try:
            self._port = is_up.result()
        except OSError as error:
            raise BadInput(
                f"cannot listen on {self._host}:{self._port}, it is in use or not this computer's; choose "
                "another with --port, or --option host=ADDRESS"
            ) from error
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._loop is not None and self._is_over is not None:
            self._loop.call_soon_threadsafe(self._is_over.set)
        if self._thread is not None:
            self._thread.join()

    def _run(self, is_up: Future[int]) -> None:
        try:
            asyncio.run(self._serve(is_up))
        except OSError as error:
            is_up.set_exception(error)

    async def _serve(self, is_up: Future[int]) -> None:
        from websockets.asyncio.server import serve

        allowed: list[Origin | re.Pattern[str] | None] = [None, _OF_THIS_COMPUTER, *self._origins]  # type: ignore[list-item]
        self._is_over = asyncio.Event()
        async with serve(
            self._attend, self._host, self._port, origins=allowed, process_request=_check_path,
            compression=None, max_size=_LARGEST_INPUT_BYTES, write_limit=_MOST_WAITING_BYTES,
            close_timeout=_CLOSE_WITHIN_S,
        ) as server:  # fmt: skip
            self._loop = asyncio.get_running_loop()
            is_up.set_result(next(iter(server.sockets)).getsockname()[1])
            await self._is_over.wait()
            self._loop = None

    async def _attend(self, connection: ServerConnection) -> None:
        """One receiver, from its connection to its end."""
        from websockets.exceptions import ConnectionClosed

        assert connection.request is not None
        receiver = _Receiver(connection, connection.request.path)
        for messages in self._newest.values():
            receiver.offer(messages)
        self._receivers.add(receiver)
        writing = asyncio.create_task(receiver.write(self._traffic))
        try:
            async for _ in connection:  # what it says is not looked at
                pass
        except ConnectionClosed:
            pass
        finally:
            self._receivers.discard(receiver)
            writing.cancel()

    def _offer(self, messages: _Messages) -> None:
        hand = messages.hand
        self._newest[hand.glove] = messages
        for receiver in self._receivers:
            if receiver.offer(messages) and hand.state == "live":
                self._traffic.note_left_out(hand.glove)


class _Messages:
    """A pose in its two forms, each made when the first receiver wants it."""

    def __init__(self, hand: GlovePose) -> None:
        self.hand = hand

    @cached_property
    def text(self) -> str:
        hand, pose = self.hand, self.hand.pose
        names = hand.meaning.rotations
        degrees, sd_deg = (part.astype(float).round(5).tolist() for part in (pose.degrees, pose.deviations))
        document = {
            "type": "pose",
            "glove": hand.glove,
            "state": hand.state,
            "flags": list(pose.words),
            "sequence": pose.sequence,
            "time_s": pose.monotonic_ns / 1e9,
            "wall_time_s": pose.wall_ns / 1e9,
            "age_ms": pose.age_us / 1e3,
            "degrees": dict(zip(names, degrees, strict=True)),
            "sd_deg": dict(zip(names, sd_deg, strict=True)),
            "unusable": [
                name for name, is_usable in zip(names, hand.pose.usable, strict=True) if not is_usable
            ],
        }
        return json.dumps(document)

    @cached_property
    def binary(self) -> bytes:
        return encode_pose(self.hand.pose)


class _Receiver:
    """A connection with at most one waiting pose of each glove."""

    def __init__(self, connection: ServerConnection, path: str) -> None:
        parts = _PATH.fullmatch(path)
        assert parts is not None
        self._connection = connection
        self._is_binary = parts["binary"] is not None
        self._only = parts["only"] or parts["glove"]
        self._waiting: dict[str, _Messages] = {}
        self._meanings: dict[str, PoseMeaning] = {}
        self._has_news = asyncio.Event()
        opened: socket.socket | None = connection.transport.get_extra_info("socket")
        if opened is not None:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _MOST_WAITING_BYTES)

    def offer(self, messages: _Messages) -> bool:
        """Whether a live pose was waiting still, and is left out for this newer one."""
        glove = messages.hand.glove
        if self._only and glove != self._only:
            return False
        earlier = self._waiting.get(glove)
        self._waiting[glove] = messages
        self._has_news.set()
        return earlier is not None and earlier.hand.state == "live"

    async def write(self, traffic: Traffic) -> None:
        """Send what is newest until the connection ends."""
        from websockets.exceptions import ConnectionClosed

        try:
            while True:
                await self._has_news.wait()
                self._has_news.clear()
                for glove in list(self._waiting):
                    messages = self._waiting.pop(glove)
                    await self._explain(messages.hand)
                    await self._connection.send(messages.binary if self._is_binary else messages.text)
                    traffic.note_departure(messages.hand)
        except ConnectionClosed:
            pass

    async def _explain(self, hand: GlovePose) -> None:
        """Say what a glove's poses mean, before the first and whenever that changes."""
        if self._meanings.get(hand.glove) is not hand.meaning:
            self._meanings[hand.glove] = hand.meaning
            document: dict[str, Any] = {"type": "meta", "glove": hand.glove, "meta": hand.meaning.document}
            await self._connection.send(json.dumps(document))


def _check_path(connection: ServerConnection, request: Request) -> Response | None:
    """Whose poses are wanted; an answer only where nobody could be meant."""
    if (parts := _PATH.fullmatch(request.path)) is not None:
        wanted = parts["only"] or parts["glove"]
        if wanted == "" or IDENTIFIER.match(wanted):
            return None
    return connection.respond(404, "There are /, /GLOVE and /binary/GLOVE.\n")
