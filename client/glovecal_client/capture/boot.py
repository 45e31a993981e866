"""Capture at boot on Linux: the systemd unit of one glove, and the udev rule of its USB adapter.

The unit runs the command it was made by, as a user of its own that exists only while it runs and may use
serial ports (group dialout) and nothing else. It listens nowhere (SocketBindDeny), except for a glove that
dials in; it is started at boot and again 2 s after it ends, whatever the reason. What it says is in the
journal, which systemd bounds; frame logs are bounded by ``--log-limit``.
(https://www.freedesktop.org/software/systemd/man/latest/systemd.exec.html, systemd.resource-control.html)
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from glovecal_client.errors import CaptureRefused

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
{listening}
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
        name=name, glove=glove, command=command, listening="" if dials_in else "SocketBindDeny=any\n"
    )


def _quoted(word: str) -> str:
    """One word of ExecStart: in quotes, with nothing that systemd would expand."""
    plain = word.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%").replace("$", "$$")
    return f'"{plain}"' if not word or set(word) & set(" \t'\"\\;") else plain
