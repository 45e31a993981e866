"""The emulated CyberGlove box on a pseudo-terminal, with faults that can be switched on. POSIX only.

A pseudo-terminal has no bit rate, so a wrong one is emulated: while the terminal's configured speed differs
from the box's, nothing the computer writes is understood and what it reads is scrambled.
"""

from __future__ import annotations

import contextlib
import os
import random
import select
import termios
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from glovecal_service.emulators.cyberglove import EmulatedBox

Persona = Literal["box", "text", "noise", "silent", "echo"]


@dataclass
class Damage:
    """Chances per byte on the way to the computer; a burst is 1 to 40 random bytes pushed in."""

    burst: float = 0.0
    lost: float = 0.0
    repeated: float = 0.0
    replies_too: bool = False
    """Without it only sample records suffer."""

    def apply(self, data: bytes, chance: random.Random) -> bytes:
        out = bytearray()
        for value in data:
            if chance.random() < self.burst:
                out += chance.randbytes(chance.randint(1, 40))
            if chance.random() < self.lost:
                continue
            out.append(value)
            if chance.random() < self.repeated:
                out.append(value)
        return bytes(out)


class CyberGloveEmulator:
    """Serves ``box`` at ``link`` (a symbolic link that outlives re-plugging) from a thread of its own."""

    simulated = True

    def __init__(
        self, link: Path, box: EmulatedBox | None = None, *, persona: Persona = "box", seed: int = 0
    ) -> None:
        self.link = link
        self.box = box or EmulatedBox()
        self.persona: Persona = persona
        self.damage = Damage()
        self.silenced = False
        """True: a cable pulled on the far side of the serial adapter: nothing comes, nothing arrives."""
        self.received = b""
        self._chance = random.Random(seed)
        self._lock = threading.Lock()
        self._ends: tuple[int, int] | None = None
        self._wake_read, self._wake_write = os.pipe()
        self._running = True
        self._thread = threading.Thread(target=self._serve, name="cyberglove-emulator", daemon=True)

    def __enter__(self) -> CyberGloveEmulator:
        self.replug()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        self._wake()
        self._thread.join(timeout=120)
        self.unplug()
        os.close(self._wake_read)
        os.close(self._wake_write)

    @property
    def path(self) -> str:
        return str(self.link)

    def unplug(self) -> None:
        """Pull the adapter: the port vanishes, whoever has it open gets an error."""
        with self._lock:
            if self._ends is not None:
                for end in self._ends:
                    os.close(end)
                self._ends = None
                self.link.unlink(missing_ok=True)
                self.box._power_up()
        self._wake()

    def replug(self) -> None:
        """A new port under the old name, the box powered up afresh."""
        with self._lock:
            if self._ends is None:
                ours, theirs = os.openpty()
                tty.setraw(theirs)
                self._ends = ours, theirs
                self.link.symlink_to(os.ttyname(theirs))
        self._wake()

    def send(self, data: bytes) -> None:
        """Push bytes to the computer as they are."""
        with self._lock:
            if self._ends is not None:
                self._write(self._ends[0], data)

    def _wake(self) -> None:
        with contextlib.suppress(OSError):
            os.write(self._wake_write, b"x")

    def _serve(self) -> None:
        while self._running:
            with self._lock:
                ours = self._ends[0] if self._ends else None
                wait_s = self._wait_s()
            watched = [self._wake_read] + ([ours] if ours is not None else [])
            try:
                ready, _, _ = select.select(watched, [], [], wait_s)
            except OSError:  # unplugged while waiting
                continue
            if self._wake_read in ready:
                os.read(self._wake_read, 64)
            with self._lock:
                if self._ends is not None and self._ends[0] == ours:
                    self._exchange(self._ends[0])

    def _wait_s(self) -> float:
        if self.persona in ("text", "noise"):
            return 0.02
        return min(0.2, max(0.0, self.box.next_due_s() - time.monotonic()))

    def _exchange(self, ours: int) -> None:
        heard = b""
        if select.select([ours], [], [], 0)[0]:  # asked again: the port may be a new one under the old number
            with contextlib.suppress(OSError):  # nobody has the other end open
                heard = os.read(ours, 4096)
        if self.silenced:
            self.box.due(time.monotonic())
            return
        self.received += heard
        if self.persona == "box":
            self._exchange_as_box(ours, heard)
        elif self.persona == "text":  # a home-made flex glove that streams lines by itself
            self._write(ours, b"A2047B1011C1200D1811E900F2047G2047P0\n")
        elif self.persona == "noise":
            self._write(ours, self._chance.randbytes(40))
        elif self.persona == "echo":
            self._write(ours, heard)

    def _exchange_as_box(self, ours: int, heard: bytes) -> None:
        now_s = time.monotonic()
        same_speed = self._same_speed()
        replies = self.box.feed(heard, now_s) if same_speed else b""
        if heard and not same_speed:
            replies = self._chance.randbytes(len(heard))
        if self.damage.replies_too:
            replies = self.damage.apply(replies, self._chance)
        samples = self.damage.apply(self.box.due(now_s), self._chance)
        if not same_speed:
            samples = self._chance.randbytes(len(samples))
        self._write(ours, replies + samples)

    def _same_speed(self) -> bool:
        assert self._ends is not None
        code = getattr(termios, f"B{self.box.baud}", None)
        return termios.tcgetattr(self._ends[1])[5] == code

    def _write(self, ours: int, data: bytes) -> None:
        """What does not fit is lost, as in a serial port that nobody reads."""
        if data and select.select([], [ours], [], 0)[1]:
            os.set_blocking(ours, False)
            with contextlib.suppress(OSError):
                os.write(ours, data)
            os.set_blocking(ours, True)
