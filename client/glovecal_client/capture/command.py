"""``glovecal-capture``: record and publish a glove. Needs nothing but the client."""

from __future__ import annotations

import argparse
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings, CaptureSummary
from glovecal_client.capture.device import build_device, device_names, device_options
from glovecal_client.errors import BadOption, ClientError
from glovecal_client.keys import GloveKeys
from glovecal_client.names import check_identifier, subject_name
from glovecal_client.private_files import keep_private
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_client.signals import stopped_by_signals
from glovecal_client.standard_streams import run_command, say


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
    stop: threading.Event | None = None,
    report: Callable[[str], None] | None = None,
) -> CaptureSummary:
    """Capture until ``stop`` is set or the device has no more to give.

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
    settings = CaptureSettings(GloveKeys(site, glove), subject, wearing, tuple(endpoints), Path(data))
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
    stop = threading.Event()
    keep_private()
    try:
        with stopped_by_signals(stop, outlives_terminal=True):
            summary = run_capture(
                asked.device,
                asked.glove,
                options=parse_options(asked.option),
                site=asked.site,
                subject=asked.subject,
                wearing=asked.wearing,
                endpoints=asked.connect or [os.environ.get("GLOVECAL_ZENOH", DEFAULT_ENDPOINT)],
                data=asked.data,
                stop=stop,
                report=tell,
            )
    except ClientError as error:
        print(f"glovecal-capture: {error}", file=sys.stderr)
        return 1
    say(str(summary))
    return 0


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
    parser.add_argument("--data", default=os.environ.get("GLOVECAL_DATA", "glovecal-data"), type=Path)
    return parser


if __name__ == "__main__":
    script()
