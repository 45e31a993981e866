"""``glovecal-capture``: record and publish a glove. Needs nothing but the client."""

from __future__ import annotations

import argparse
import math
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from glovecal_client.capture.boot import install_unit
from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings, CaptureSummary
from glovecal_client.capture.device import build_device, device_names, device_options
from glovecal_client.errors import BadOption, ClientError
from glovecal_client.keys import GloveKeys
from glovecal_client.names import check_identifier, subject_name
from glovecal_client.private_files import keep_private
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_client.signals import stopped_by_signals
from glovecal_client.standard_streams import never_wait, run_command, say

UNIT_LOG_LIMIT = 8_000_000_000
"""Bytes that capture at boot keeps, five days at 120 Hz."""


def run_capture(
    device: str,
    glove: str,
    *,
    options: Mapping[str, str] | None = None,
    site: str = "lab",
    subject: str | None = None,
    wearing: str | None = None,
    endpoints: Sequence[str] = (DEFAULT_ENDPOINT,),
    data: Path | str = "glovecal-data",
    log_limit: int | None = None,
    stop: threading.Event | None = None,
    report: Callable[[str], None] | None = None,
) -> CaptureSummary:
    """Capture until ``stop`` is set, the device has no more to give or the log has half of ``log_limit``.

    ``device`` is ``NAME`` or ``NAME:ARGUMENT``; ``report`` gets sentences as things happen. Subjects are
    written in lower case. Raises BadName, UnknownDevice, BadOption, DeviceError (a device that cannot work at
    all) and CaptureRefused (another publisher, no place to record).
    """
    report = report or (lambda sentence: None)
    if subject is not None and (stored := subject_name(subject)) != subject:
        report(f"Subject {subject} is stored as {stored}.")
        subject = stored
    if wearing is not None:
        check_identifier(wearing, "wearing")
    settings = CaptureSettings(
        GloveKeys(site, glove), subject, wearing, tuple(endpoints), Path(data), log_limit
    )
    daemon = CaptureDaemon(build_device(device, options), settings, report)
    return daemon.run(stop or threading.Event())


def parse_options(pairs: Sequence[str]) -> dict[str, str]:
    """``["speed=2"]`` as ``{"speed": "2"}``. Raises BadOption."""
    options: dict[str, str] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals or not key:
            raise BadOption(f"option {pair!r} is not KEY=VALUE")
        if key in options:
            raise BadOption(f"option {key!r} is given twice")
        options[key] = value
    return options


def script() -> NoReturn:
    """Entry point of the ``glovecal-capture`` script."""
    run_command(main)


def main(arguments: Sequence[str] | None = None) -> int:
    """0 when stopped cleanly, 1 with a sentence when it could not capture."""
    asked = _parser().parse_args(arguments)
    keep_private()
    try:
        if asked.install_unit is not None:
            say(_install_unit(asked))
        else:
            _capture(asked)
    except ClientError as error:
        print(f"glovecal-capture: {error}", file=sys.stderr)
        return 1
    return 0


def _capture(asked: argparse.Namespace) -> None:
    """One run after another, each ended by the limit of its log; the last by a signal or the device."""
    stop, is_over = threading.Event(), False
    never_wait()
    with stopped_by_signals(stop, outlives_terminal=True):
        while not is_over:
            summary = run_capture(
                asked.device,
                asked.glove,
                options=parse_options(asked.option),
                site=asked.site,
                subject=asked.subject,
                wearing=asked.wearing,
                endpoints=_endpoints(asked),
                data=asked.data,
                log_limit=asked.log_limit,
                stop=stop,
                report=tell,
            )
            say(str(summary))
            is_over = not summary.log_is_full or stop.is_set()


def _install_unit(asked: argparse.Namespace) -> str:
    """With the options of this command, checked as a capture would check them."""
    options = parse_options(asked.option)
    GloveKeys(asked.site, asked.glove)
    build_device(asked.device, options)
    kind, colon, argument = asked.device.partition(":")
    device = f"{kind}:{Path(argument).absolute()}" if colon and Path(argument).exists() else asked.device
    words = {"device": [device], "glove": [asked.glove], "site": [asked.site], "option": asked.option}
    words |= {"connect": _endpoints(asked), "log-limit": [f"{(asked.log_limit or UNIT_LOG_LIMIT) / 1e9:g}"]}
    words |= {name: [value] for name in ("subject", "wearing") if (value := getattr(asked, name)) is not None}
    arguments = [word for name, values in words.items() for value in values for word in (f"--{name}", value)]
    dials_in = any(kind in value for value in (asked.device, *options.values()) for kind in ("tcp:", "udp:"))
    return install_unit(asked.install_unit, asked.glove, arguments, dials_in=dials_in)


def _endpoints(asked: argparse.Namespace) -> list[str]:
    return asked.connect or [os.environ.get("GLOVECAL_ZENOH", DEFAULT_ENDPOINT)]


def _gigabytes(text: str) -> int:
    """``0.5`` as bytes; 0.01 to 100,000."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.01 <= value <= 100_000:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of gigabytes from 0.01 to 100000")
    return int(value * 1e9)


def tell(sentence: str) -> None:
    """To standard error, if somebody reads it: a closed terminal must not end a recording."""
    with suppress(OSError, ValueError):
        print(sentence, file=sys.stderr, flush=True)


class _Parser(argparse.ArgumentParser):
    def format_help(self) -> str:
        """The devices are loaded when their options are asked for, not at every start."""
        self.epilog = "\n\n".join(textwrap.fill(sentence, 79) for sentence in device_options())
        return super().format_help()


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="glovecal-capture",
        description="Record and publish a data glove.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    installed = ", ".join(device_names())
    parser.add_argument(
        "--version", action="version", version=f"glovecal-capture {version('glovecal-client')}"
    )
    parser.add_argument("--device", required=True, help=f"NAME or NAME:ARGUMENT; installed: {installed}")
    parser.add_argument(
        "--option", action="append", default=[], metavar="KEY=VALUE", help="for the device, see below"
    )
    parser.add_argument("--glove", required=True, help="name of this glove on the wire, such as right-hand")
    parser.add_argument("--site", default=os.environ.get("GLOVECAL_SITE", "lab"))
    parser.add_argument("--subject", help="who wears it")
    parser.add_argument("--wearing", help="name of this donning")
    parser.add_argument(
        "--connect", action="append", metavar="ENDPOINT", help=f"the service's router, {DEFAULT_ENDPOINT}"
    )
    parser.add_argument(
        "--log-limit",
        type=_gigabytes,
        metavar="GB",
        help="delete the oldest frame logs above this (120 Hz with 22 sensors take 1.5 GB a day)",
    )
    parser.add_argument(
        "--install-unit",
        type=Path,
        nargs="?",
        const=Path("/"),
        metavar="FOLDER",
        help="capture nothing: have systemd capture so at every boot (below FOLDER instead of /)",
    )
    parser.add_argument("--data", default=os.environ.get("GLOVECAL_DATA", "glovecal-data"), type=Path)
    return parser


if __name__ == "__main__":
    script()
