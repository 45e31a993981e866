"""Capture that systemd starts at boot: its unit, its udev rule, and logs that do not fill the disk."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
from configparser import RawConfigParser
from pathlib import Path

import numpy as np
import pytest
from loopback import free_endpoint

from glovecal_client import Frame, FrameLog, GloveKeys, encode_frame
from glovecal_client.capture import command
from glovecal_client.capture.command import main, run_capture
from glovecal_client.capture.daemon import CaptureSettings
from glovecal_client.capture.log_folder import LogFolder
from glovecal_client.encryption.key_file import KEY_FILE, key_of_environment, make_key_file
from glovecal_client.errors import BadEncryptionKey

LUCID = (
    "--device",
    "lucidglove:/dev/serial/by-id/usb-1a86",
    "--glove",
    "right",
    "--connect",
    "tcp/studio:7447",
)


@pytest.fixture(autouse=True)
def for_all_users(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python as if it were installed where every user can read it."""
    monkeypatch.setattr(command.sys, "prefix", "/opt/glovecal")


def unit_of(root: Path, name: str = "right") -> RawConfigParser:
    parser = RawConfigParser(strict=False)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    assert parser.read(root / f"etc/systemd/system/glovecal-capture-{name}.service")
    return parser


def test_the_unit_gets_the_key_that_files_are_encrypted_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "100%.key").file))
    assert main((*LUCID, "--install-unit", str(tmp_path))) == 0
    service = unit_of(tmp_path)["Service"]
    assert service["LoadCredential"] == f"encryption.key:{tmp_path}/100%%.key"
    assert service["Environment"] == f"{KEY_FILE}=%d/encryption.key"
    given = make_key_file(tmp_path / "given.key").file
    given.chmod(0o440)  # as systemd shows a credential
    monkeypatch.setenv(KEY_FILE, str(given))
    with pytest.raises(BadEncryptionKey, match="others on this computer may read it"):
        key_of_environment()
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    assert key_of_environment() is not None


def test_the_unit_captures_with_the_options_it_was_made_with(tmp_path: Path, capsys) -> None:
    asked = (*LUCID, "--option", "hand=right", "--subject", "anna", "--install-unit", str(tmp_path))
    assert main(asked) == 0
    said = capsys.readouterr().out
    assert "sudo systemctl daemon-reload && sudo systemctl enable --now glovecal-capture-right" in said
    service = unit_of(tmp_path)["Service"]
    program, *arguments = shlex.split(service["ExecStart"])
    assert (program, arguments[:3]) == (sys.executable, ["-I", "-m", "glovecal_client.capture.command"])
    pairs = list(zip(arguments[3::2], arguments[4::2], strict=True))
    assert set(zip(LUCID[::2], LUCID[1::2], strict=True)) < set(pairs)
    assert {("--option", "hand=right"), ("--subject", "anna"), ("--log-limit", "8")} < set(pairs)
    assert ("--data", f"/var/lib/{service['StateDirectory']}") in pairs
    assert (service["Restart"], service["DynamicUser"], service["SupplementaryGroups"]) == (
        "always",
        "yes",
        "dialout",
    )
    assert service["SocketBindDeny"] == "any"


def test_a_glove_that_dials_in_may_be_listened_to(tmp_path: Path) -> None:
    asked = ("--device", "lucidglove:tcp:65432", "--glove", "left", "--install-unit", str(tmp_path))
    assert main(asked) == 0
    assert "SocketBindDeny" not in unit_of(tmp_path, "left")["Service"]


def test_systemd_accepts_the_unit(tmp_path: Path) -> None:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("needs systemd-analyze: apt-get install systemd")
    assert main((*LUCID, "--install-unit", str(tmp_path))) == 0
    unit = tmp_path / "etc/systemd/system/glovecal-capture-right.service"
    result = subprocess.run(
        ["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, timeout=60
    )
    assert (result.returncode, result.stderr) == (0, "")


def test_udev_accepts_the_rule(tmp_path: Path) -> None:
    rule = tmp_path / "60-glovecal.rules"
    rule.write_text(command.RULE)
    udevadm = shutil.which("udevadm")
    if udevadm is None or subprocess.run([udevadm, "verify", "--help"], capture_output=True).returncode:
        pytest.skip("needs udevadm of systemd 254 or later: apt-get install udev")
    result = subprocess.run([udevadm, "verify", str(rule)], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stdout + result.stderr


def test_what_systemd_would_expand_is_written_as_it_is() -> None:
    text = command.unit_text("n", "right", ["--option", 'port=/dev/my "50 %" $glove'], dials_in=False)
    assert '--option "port=/dev/my \\"50 %%\\" $$glove" --data' in text


@pytest.mark.parametrize(
    ("device", "sentence"),
    [
        ("lucidglove:/home/anna/glove", "cannot read /home/anna/glove: move it"),
        ("nonsense", "no device 'nonsense'"),
    ],
)
def test_a_capture_that_cannot_be_is_refused(tmp_path: Path, capsys, device: str, sentence: str) -> None:
    assert main(("--device", device, "--glove", "right", "--install-unit", str(tmp_path))) == 1
    assert sentence in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_python_in_a_home_folder_is_refused(tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command.sys, "prefix", "/home/anna/.venv")
    assert main((*LUCID, "--install-unit", str(tmp_path))) == 1
    assert (
        "cannot read /home/anna/.venv: move it to a folder that all users can read" in capsys.readouterr().err
    )


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path, capsys) -> None:
    (tmp_path / "etc").write_text("")
    assert main((*LUCID, "--install-unit", str(tmp_path))) == 1
    assert "run it with sudo, or give a folder" in capsys.readouterr().err


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """400 frames of two sensors."""
    log = FrameLog.create(tmp_path / "source.glvlog", {"layout": "two", "sensors": ["A", "B"]})
    for i in range(400):
        log.append(encode_frame(Frame(i, 1, i * 1_000_000, 0, np.array([i, -i], np.float32))))
    log.close()
    return log.path


def test_a_run_ends_at_its_share_of_the_limit_and_the_oldest_runs_go(recording: Path, tmp_path: Path) -> None:
    said: list[str] = []
    limit = 30_000
    settings = CaptureSettings(
        GloveKeys("lab", "g1"), endpoints=(free_endpoint(),), data=tmp_path / "data", log_limit=limit
    )
    runs = [
        run_capture(f"replay:{recording}", settings, {"speed": "20", "loop": "yes"}, report=said.append)
        for _ in range(3)
    ]
    assert [run.log_is_full for run in runs] == [True] * 3
    assert [run.log.exists() for run in runs] == [False, False, True]
    assert sum(log.stat().st_size for log in runs[0].log.parent.glob("*.glvlog")) <= limit
    assert f"earlier recording {runs[0].log.name} deleted: the limit is reached" in said


def test_without_a_limit_nothing_is_deleted_and_with_one_the_newest_stay(tmp_path: Path) -> None:
    folder = LogFolder(tmp_path, GloveKeys("lab", "g1"))
    for day in range(1, 6):
        log = folder.path / f"2026010{day}T000000Z-{day:016x}.glvlog"
        log.write_bytes(bytes(1000))
        os.utime(log, (day, day))
    folder.forget(2500, lambda sentence: None)
    assert sorted(log.name[:8] for log in folder.path.glob("*.glvlog")) == ["20260104", "20260105"]
    folder.close()
