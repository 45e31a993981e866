"""One page on this machine that shows drawings as they come, and gives back keys and the mouse.

Drawings go out as server-sent events; what the person does comes back as small POSTs. Loopback only: requests
that name another host are refused, so that no page of the internet can ask for it.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from stream.drawing import Drawing

PAGE = Path(__file__).with_name("page.html")
MOST_INPUT_BYTES, MOST_WAITING = 2000, 200
_SILENCE_S = 2.0


class LivePage:
    """Serves until it is closed; ``port`` 0 takes a free one."""

    def __init__(self, title: str, help_text: str, port: int = 0) -> None:
        self._changed = threading.Condition()
        self._message, self._number, self._closed = b"{}", 0, False
        self._inputs: deque[dict[str, Any]] = deque(maxlen=MOST_WAITING)
        page = PAGE.read_text(encoding="utf-8").replace("TITLE", title).replace("HELP", help_text)
        self.page = page.encode()
        live = self

        class Handler(_Handler):
            shown = live

        self._server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self._server.server_address[1]}"

    @property
    def address(self) -> str:
        return f"http://{self.host}/"

    def show(self, drawing: Drawing) -> None:
        """The newest drawing; a slow browser misses some, it never gets old ones."""
        with self._changed:
            self._message = json.dumps(drawing.document(), separators=(",", ":")).encode()
            self._number += 1
            self._changed.notify_all()

    def inputs(self) -> list[dict[str, Any]]:
        """What the person did since the last call: {"kind": "move", "dx": ..., "dy": ...} in pixels,
        {"kind": "wheel", "dy": ...}, {"kind": "key", "key": ...}."""
        found = []
        while self._inputs:
            found.append(self._inputs.popleft())
        return found

    def take_input(self, item: dict[str, Any]) -> None:
        self._inputs.append(item)

    def next_message(self, after: int) -> tuple[int, bytes] | None:
        """The newest drawing once it is newer than number ``after``; None when the page is closed."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > after or self._closed, _SILENCE_S)
            return None if self._closed else (self._number, self._message)

    def close(self) -> None:
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def __enter__(self) -> LivePage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class _Handler(BaseHTTPRequestHandler):
    shown: LivePage

    def do_GET(self) -> None:
        if not self._is_ours():
            return
        if self.path == "/":
            self._begin(200, "text/html; charset=utf-8")
            self.wfile.write(self.shown.page)
        elif self.path == "/drawings":
            self._begin(200, "text/event-stream")
            self._stream()
        else:
            self._begin(404, "text/plain")

    def do_POST(self) -> None:
        if not self._is_ours():
            return
        length = self.headers.get("Content-Length", "")
        if self.path != "/input" or not length.isdigit() or int(length) > MOST_INPUT_BYTES:
            self._begin(400, "text/plain")
            return
        try:
            item = json.loads(self.rfile.read(int(length)))
        except (ValueError, RecursionError):
            item = None
        if isinstance(item, dict):
            self.shown.take_input(item)
        self._begin(204 if isinstance(item, dict) else 400, "text/plain")

    def _is_ours(self) -> bool:
        origin = self.headers.get("Origin", f"http://{self.shown.host}")
        if self.headers.get("Host") == self.shown.host and origin == f"http://{self.shown.host}":
            return True
        self._begin(403, "text/plain")
        return False

    def _begin(self, status: int, kind: str) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", "default-src 'self' 'unsafe-inline'")
        self.end_headers()

    def _stream(self) -> None:
        number = 0
        try:
            while (newer := self.shown.next_message(number)) is not None:
                sent, message = newer
                self.wfile.write(b"data: " + message + b"\n\n" if sent > number else b":\n\n")
                self.wfile.flush()
                number = sent
        except OSError:
            return  # the browser has gone

    def log_message(self, format: str, *arguments: Any) -> None:
        """Requests are not worth a line each."""
