"""An emulated glove at a port, served by a thread of its own."""

from __future__ import annotations

import contextlib
import socket
import threading
import time

from glovecal_service.emulators.faults import Faults
from glovecal_service.emulators.glove import EmulatedGlove
from glovecal_service.emulators.ports import Port, wait

_LONGEST_WAIT_S = 0.1


class Emulation:
    """Plugged in from ``with`` on; ``unplug`` and ``replug`` pull the cable."""

    def __init__(self, glove: EmulatedGlove, port: Port, faults: Faults | None = None) -> None:
        self.glove = glove
        self.port = port
        self.sendings = 0
        """How often something left."""
        self._faults = faults or Faults()
        self._lock = threading.Lock()
        self._pulled = False
        self._plugged = False
        self._running = True
        self._woken, self._wake = socket.socketpair()  # a pipe cannot be waited for on Windows
        self._thread = threading.Thread(target=self._serve, name="emulated-glove", daemon=True)

    def __enter__(self) -> Emulation:
        self._began_s = time.perf_counter()
        self._settle()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        self._wake.send(b"x")
        self._thread.join(timeout=10)
        self._pulled = True
        self._settle()
        self._woken.close()
        self._wake.close()

    def unplug(self) -> None:
        """Pull the cable; the glove is without power until ``replug``."""
        self._pulled = True
        self._settle()

    def replug(self) -> None:
        """Plug it in again: a new start of the glove at a port of the same name."""
        self._pulled = False
        self._settle()
        self._wake.send(b"x")

    def _settle(self) -> None:
        """Plug in or pull out, as it should be now."""
        with self._lock:
            plugged = not (self._pulled or self._faults.unplugged(time.perf_counter() - self._began_s))
            if plugged and not self._plugged:
                self.glove.power_up()
                self.port.plug()
            elif self._plugged and not plugged:
                self.port.unplug()
            self._plugged = plugged

    def _serve(self) -> None:
        while self._running:
            self._settle()
            with self._lock:
                handle = self.port.handle() if self._plugged else None
                wait_s = _LONGEST_WAIT_S if handle is None else self.glove.next_due_s() - time.perf_counter()
            woken = self._woken.fileno()
            watched = [woken] if handle is None else [woken, handle]
            ready = wait(watched, min(_LONGEST_WAIT_S, max(0.0, wait_s)))
            if woken in ready:
                with contextlib.suppress(OSError):
                    self._woken.recv(64)
            with self._lock:
                if self._plugged and handle is not None and self.port.handle() == handle:
                    self._exchange(handle in ready)

    def _exchange(self, something_came: bool) -> None:
        heard = self.port.read() if something_came else b""
        now_s = time.perf_counter()
        for part in (self.glove.feed(heard, now_s), self.glove.due(now_s)):
            if part:
                self.sendings += self.port.write(part)
