"""``glovecal-capture``: record and publish a glove, now or at every boot. Needs nothing but the client.

At boot on Linux: the systemd unit of one glove, and the udev rule of its USB adapter.

The unit runs the command it was made by, as a user of its own that exists only while it runs and may use
serial ports (group dialout) and nothing else. It listens nowhere (SocketBindDeny), except for a glove that
dials in; it is started at boot and again 2 s after it ends, whatever the reason. What it says is in the
journal, which systemd bounds; frame logs are bounded by ``--log-limit``.
(https://www.freedesktop.org/software/systemd/man/latest/systemd.exec.html, systemd.resource-control.html)
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from glovecal_client.capture.daemon import CaptureDaemon, CaptureSettings, CaptureSummary
from glovecal_client.capture.device import build_device, device_names, device_options
from glovecal_client.encryption.key_file import KEY_FILE, key_of_environment
from glovecal_client.errors import BadOption, CaptureRefused, ClientError
from glovecal_client.keys import GloveKeys, check_identifier, subject_name
from glovecal_client.private_files import keep_private
from glovecal_client.program import never_wait, run_command, say, stopped_by_signals
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_client.site.member import SITE_FILE, settle_environment, site_file

UNIT_LOG_LIMIT = 8_000_000_000
"""Bytes that capture at boot keeps, five days at 120 Hz."""


def run_capture(
    device: str,
    settings: CaptureSettings,
    options: Mapping[str, str] | None = None,
    *,
    stop: threading.Event | None = None,
    report: Callable[[str], None] = lambda sentence: None,
) -> CaptureSummary:
    """Capture until ``stop`` is set, the device has no more to give or the log has half of its limit.

    ``device`` is ``NAME`` or ``NAME:ARGUMENT``; ``report`` gets sentences as things happen. Subjects are
    written in lower case. Raises BadName, UnknownDevice, BadOption, DeviceError (a device that cannot work at
    all) and CaptureRefused (another publisher, no place to record).
    """
    subject, wearing = settings.subject, settings.wearing
    if subject is not None and (stored := subject_name(subject)) != subject:
        report(f"Subject {subject} is stored as {stored}.")
        settings = replace(settings, subject=stored)
    if wearing is not None:
        check_identifier(wearing, "wearing")
    return CaptureDaemon(build_device(device, options), settings, report).run(stop or threading.Event())


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
    settle_environment()
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
    keys, endpoints = GloveKeys(asked.site, asked.glove), tuple(_endpoints(asked))
    settings = CaptureSettings(keys, asked.subject, asked.wearing, endpoints, asked.data, asked.log_limit)
    never_wait()
    with stopped_by_signals(stop, outlives_terminal=True):
        while not is_over:
            summary = run_capture(asked.device, settings, parse_options(asked.option), stop=stop, report=tell)
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


RULE = """\
# Glovecal: USB adapters that gloves are known to use (FTDI, WCH, Silicon Labs, Prolific, Arduino, Espressif,
# Teensy) belong to the group dialout, and ModemManager leaves them alone: what it sends to look for a modem
# would reach the glove.
ACTION=="remove", GOTO="glovecal_end"
SUBSYSTEMS=="usb", ATTRS{idVendor}=="0403|1a86|10c4|067b|2341|2a03|303a|16c0", GOTO="glovecal_adapter"
GOTO="glovecal_end"
LABEL="glovecal_adapter"
ENV{ID_MM_DEVICE_IGNORE}="1"
SUBSYSTEM=="tty", ENV{ID_MM_PORT_IGNORE}="1", GROUP="dialout", MODE="0660"
LABEL="glovecal_end"
"""
_UNIT = """\
[Unit]
Description=Glovecal: capture of glove {glove}
After=network.target
StartLimitIntervalSec=0

[Service]
Type=exec
ExecStart={command}
Restart=always
RestartSec=2
TimeoutStopSec=20
DynamicUser=yes
SupplementaryGroups=dialout
StateDirectory={name}
StateDirectoryMode=0700
UMask=0077
LogRateLimitIntervalSec=30
LogRateLimitBurst=300
ProtectSystem=strict
ProtectHome=yes
ProtectKernelTunables=yes
ProtectKernelModules=yes
ProtectKernelLogs=yes
ProtectControlGroups=yes
ProtectHostname=yes
PrivateTmp=yes
NoNewPrivileges=yes
CapabilityBoundingSet=
LockPersonality=yes
RestrictRealtime=yes
RestrictSUIDSGID=yes
RestrictNamespaces=yes
RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK
SystemCallArchitectures=native
{listening}{credentials}
[Install]
WantedBy=multi-user.target
"""


def install_unit(root: Path, glove: str, arguments: Sequence[str], *, dials_in: bool) -> str:
    """Write unit and rule below ``root`` (``/`` for this computer); returns what to do next.

    ``arguments`` are those of the capture, without ``--data``. Raises CaptureRefused where the unit could not
    run (Python or the glove's description in a home folder) or cannot be written.
    """
    for path in (sys.prefix, *(word.partition(":")[2] for word in arguments)):
        if Path(path).is_relative_to("/home") or Path(path).is_relative_to("/root"):
            raise CaptureRefused(
                f"capture at boot runs as a user of its own, which cannot read {path}: "
                "move it to a folder that all users can read, such as /opt/glovecal"
            )
    name = f"glovecal-capture-{glove}"
    unit = root / "etc" / "systemd" / "system" / f"{name}.service"
    rule = root / "etc" / "udev" / "rules.d" / "60-glovecal.rules"
    try:
        for file, text in ((unit, unit_text(name, glove, arguments, dials_in=dials_in)), (rule, RULE)):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
            file.chmod(0o644)
    except OSError as error:
        raise CaptureRefused(
            f"{error.filename} cannot be written ({error.strerror}): run it with sudo, or give a folder"
        ) from error
    return (
        f"Written: {unit} and {rule}. Next:\n"
        "sudo udevadm control --reload && sudo udevadm trigger\n"
        f"sudo systemctl daemon-reload && sudo systemctl enable --now {name}\n"
        f"journalctl -fu {name}"
    )


def unit_text(name: str, glove: str, arguments: Sequence[str], *, dials_in: bool) -> str:
    """The unit. ``dials_in``: the glove connects to this computer, which must then listen."""
    program = (sys.executable, "-I", "-m", "glovecal_client.capture.command")
    command = " ".join(_quoted(word) for word in (*program, *arguments, "--data", f"/var/lib/{name}"))
    return _UNIT.format(
        name=name,
        glove=glove,
        command=command,
        listening="" if dials_in else "SocketBindDeny=any\n",
        credentials=_credentials(),
    )


def _credentials() -> str:
    """systemd hands the site's file and the key to a user that could not read them; after a renewal, restart
    the unit."""
    key = key_of_environment()
    files = {SITE_FILE: site_file(), KEY_FILE: None if key is None else key.file}
    lines = ""
    for variable, file in files.items():
        if file is not None:
            name, place = _CREDENTIAL[variable], str(file.absolute()).replace("%", "%%")
            lines += f"LoadCredential={name}:{place}\nEnvironment={variable}=%d/{name}\n"
    return lines


_CREDENTIAL = {SITE_FILE: "site.glovecal", KEY_FILE: "encryption.key"}


def _quoted(word: str) -> str:
    """One word of ExecStart: in quotes, with nothing that systemd would expand."""
    plain = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{plain}"' if not word or set(word) & set(" \t'\"\\;") else plain


if __name__ == "__main__":
    script()
