"""A serial port opened the way gloves want it, its errors turned into sentences."""

from __future__ import annotations

import contextlib
import errno
import logging
import time
from functools import cache
from typing import Any

from glovecal_client.errors import DeviceError, DeviceLost
from glovecal_client.installation import not_installed
from glovecal_client.operating_system import held_back_ms

_POLL_S = 0.02
"""Longest single wait for bytes; bounds how late a timeout is noticed."""
_WRITE_TIMEOUT_S = 1.0
HELD_BACK_MS = 2
"""More makes frames of a glove of 120 Hz come in bursts."""
_NO_ANSWER, _DOES_NOT_WORK = ", 121)", ", 31)"
"""How pyserial tells two of Windows' errors: a Bluetooth port without a glove, an adapter in trouble."""
_logger = logging.getLogger(__name__)


def import_pyserial() -> Any:
    """pyserial, or a DeviceError saying how to get it: it is an extra, since few computers have a glove."""
    try:
        import serial
    except ImportError as error:
        raise DeviceError(not_installed("a serial glove", "pyserial")) from error
    return serial


class SerialLink:
    """An open port: 8 data bits, no parity, 1 stop bit, no flow control, DTR and RTS raised.

    Every method raises DeviceLost once the port is gone.
    """

    def __init__(self, path: str, baud: int) -> None:
        serial = import_pyserial()
        self.path = path
        self.baud = baud
        self._failures = (serial.SerialException, OSError, TypeError)
        self._port = serial.Serial(port=None, baudrate=baud, timeout=_POLL_S, write_timeout=_WRITE_TIMEOUT_S)
        self._port.port = path
        self._port.dtr = True
        self._port.rts = True
        self._port.exclusive = True
        try:
            self._port.open()
        except (OSError, ValueError) as error:
            raise DeviceLost(_why_not_open(path, error)) from error
        self._hurry()

    def _hurry(self) -> None:
        """Have a USB adapter's driver hand bytes over at once, or say how (FTDI's holds them up to 16 ms)."""
        if hasattr(self._port, "set_low_latency_mode"):
            with contextlib.suppress(ValueError, *self._failures):  # not every driver can
                self._port.set_low_latency_mode(True)
        else:
            _tell_what_is_held_back(self.path)

    def close(self) -> None:
        """Let go of the port; harmless when it is gone already."""
        try:
            self._port.close()
        except self._failures:
            return

    def read(self, timeout_s: float) -> bytes:
        """What has come, waiting up to ``timeout_s`` for a first byte; empty if nothing did."""
        deadline = time.monotonic() + timeout_s
        try:
            while True:
                data = self._port.read(1)
                if data:
                    return data + self._port.read(self._port.in_waiting)
                if time.monotonic() >= deadline:
                    return b""
        except self._failures as error:
            raise self._lost(error) from error

    def write(self, data: bytes) -> None:
        """Send byte by byte, as drivers that work with old boxes do."""
        try:
            for value in data:
                self._port.write(bytes([value]))
            self._port.flush()
        except self._failures as error:
            raise self._lost(error) from error

    def drain(self, quiet_s: float, at_most_s: float) -> bytes:
        """Read until nothing came for ``quiet_s``, or for ``at_most_s``; returns what came."""
        deadline = time.monotonic() + at_most_s
        heard = b""
        while time.monotonic() < deadline:
            data = self.read(quiet_s)
            if not data:
                break
            heard += data
        return heard

    def flush_both_ways(self) -> None:
        """Throw away what waits in either direction."""
        try:
            self._port.reset_input_buffer()
            self._port.reset_output_buffer()
        except self._failures as error:
            raise self._lost(error) from error

    def apply_settings_again(self) -> None:
        """Drivers of one lineage met ports that stay silent after a timeout until this is done.

        pyserial skips settings that have not changed, so the stop bits, which a receiver ignores, go to two
        and back.
        """
        try:
            self._port.stopbits = 2
            self._port.stopbits = 1
        except self._failures as error:
            raise self._lost(error) from error

    def _lost(self, error: BaseException) -> DeviceLost:
        return DeviceLost(f"{self.path} is gone ({_short(error)}): check the cable or plug it in again")


@cache
def _tell_what_is_held_back(path: str) -> None:
    if (held_ms := held_back_ms(path)) > HELD_BACK_MS:
        _logger.warning(
            "%s hands bytes over every %d ms: set its latency timer to 1 ms (device manager, the port's "
            "properties, port settings, advanced)",
            path, held_ms,
        )  # fmt: skip


def _why_not_open(path: str, error: BaseException) -> str:
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT or "FileNotFound" in text:
        return f"there is no port {path}: plug the glove in, or look for its port with glovecal find-port"
    if number in (errno.EACCES, errno.EPERM) and "lock" not in text:
        return f"no permission to open {path}: on Linux add your user to the group dialout and log in again"
    if (
        number in (errno.EAGAIN, errno.EBUSY, errno.EWOULDBLOCK)
        or "lock" in text
        or "PermissionError" in text
    ):
        return f"{path} is in use by another program: stop that first"
    if _NO_ANSWER in text:
        return f"nothing answers at {path}: is the glove switched on and near?"
    if _DOES_NOT_WORK in text:
        return f"the adapter at {path} does not work: pull it out and plug it in again"
    return f"{path} cannot be opened as a serial port ({_short(error)})"


def _short(error: BaseException) -> str:
    """The first clause of a message, enough to look it up."""
    return str(error).split("\n", 1)[0][:120] or type(error).__name__
