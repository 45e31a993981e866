"""``do.py fresh``: where it gets a system from, what it keeps apart, and what its table says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NoReturn

import pytest
from bare_system import BareSystem, Unavailable, debian_mirror, in_own_namespaces, refuse_where_impossible
from fresh import COMMANDS
from fresh_table import BEGIN, END, Outcome, Row, demo_outcome, put_into_page, suite_outcome, table

ROOT = Path(__file__).resolve().parents[2]
DEB822 = """\
Types: deb
URIs: https://example.org/node
Suites: nodistro
Components: main

# the archive
Types: deb deb-src
URIs: http://mirror.example.org/debian
 http://other.example.org/debian
Suites: trixie trixie-updates
Components: main
Signed-By: /usr/share/keyrings/debian-archive-keyring.gpg
"""
ONE_LINE = """\
# deb http://commented.example.org/debian trixie main
deb http://vendor.example.org stable-vendor main
deb-src http://source.example.org/debian trixie main
deb [arch=amd64 signed-by=/a.gpg] http://line.example.org/debian trixie main contrib
"""


@pytest.fixture
def scripts(tmp_path: Path) -> Path:
    """debootstrap's folder, as far as it tells which releases are Debian's."""
    folder = tmp_path / "scripts"
    folder.mkdir()
    for name in ("sid", "gutsy"):
        (folder / name).touch()
    (folder / "trixie").symlink_to("sid")
    (folder / "noble").symlink_to("gutsy")
    return folder


@pytest.mark.parametrize(
    ("name", "text", "mirror"),
    [
        ("sources.list.d/some.sources", DEB822, "http://mirror.example.org/debian"),
        ("sources.list.d/some.list", ONE_LINE, "http://line.example.org/debian"),
        ("sources.list", ONE_LINE, "http://line.example.org/debian"),
    ],
)
def test_the_mirror_is_the_one_that_apt_uses(tmp_path: Path, scripts: Path, name, text, mirror) -> None:
    (tmp_path / "sources.list.d").mkdir()
    (tmp_path / name).write_text(text)
    assert debian_mirror(tmp_path, scripts) == mirror


def test_another_systems_archive_is_no_mirror(tmp_path: Path, scripts: Path) -> None:
    (tmp_path / "sources.list").write_text("deb http://archive.example.org/ubuntu noble main\n")
    with pytest.raises(Unavailable, match="--mirror"):
        debian_mirror(tmp_path, scripts)


def test_what_is_missing_is_told_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(Unavailable, match="needs root"):
        refuse_where_impossible()
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(Unavailable, match="apt-get install debootstrap"):
        refuse_where_impossible()


def test_a_page_without_a_place_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    (tmp_path / "page.md").write_text("# A page\n")
    command = [sys.executable, "tests/fresh/fresh.py", "--page", str(tmp_path / "page.md")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2
    assert re.search(r"no place for the table: write .* and .* into it\n$", done.stderr)


def test_a_system_is_used_by_one_at_a_time(tmp_path: Path) -> None:
    system = BareSystem(tmp_path, "trixie")
    with system.held(), pytest.raises(Unavailable, match="another run uses"), system.held():
        pass
    with system.held():
        pass


def test_mounts_and_processes_end_with_the_command(
    tmp_path: Path, not_here: Callable[[str], NoReturn]
) -> None:
    if sys.platform != "linux" or os.geteuid() != 0:
        not_here("needs root: another user may not mount")
    script = 'mount -t tmpfs none "$1" && touch "$1/inside" && (sleep "$2" & echo "$$") && ls "$1"'
    its_own_s = str(1000 + os.getpid())
    with (tmp_path / "said").open("wb") as log:
        code = in_own_namespaces(["bash", "-c", script, "bash", str(tmp_path), its_own_s], log)
    said = (tmp_path / "said").read_text()
    if "Operation not permitted" in said or "unshare failed" in said:
        not_here("needs the right to make namespaces, which this container does not give")
    assert (code, said) == (0, "1\ninside\n")
    assert [path.name for path in tmp_path.iterdir()] == ["said"]
    assert f"sleep\0{its_own_s}\0" not in commands()


def commands() -> set[str]:
    """Of all processes, their arguments ended by zeros."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):  # it has ended
            found.add(path.read_text(errors="replace"))
    return found


DEMO = "Added: lag ...\nRight: lag was named. Wrong: sensor_fault was named afterwards.\n\nThe end.\n"
SUITE = """\
FAILED tests/verbs/test_lock.py::test_everything[3.14.0] - assert 1 in 0.5s
==== 2 failed, 5888 passed, 12 skipped, 1 error in 1150.31s (0:19:10) ====
"""


@pytest.mark.parametrize(
    ("outcome", "cell"),
    [
        (demo_outcome(0, "Right: lag was named.\n", 76.2), "Right: lag was named, 76 s"),
        (
            demo_outcome(0, DEMO, 76.2),
            "**Right: lag was named. Wrong: sensor_fault was named afterwards**, 76 s",
        ),
        (demo_outcome(1, "Right: lag was named.\n", 2), "**ended with code 1**, 2 s"),
        (demo_outcome(0, "nothing of the kind\n", 2), "**ended with code 0**, 2 s"),
        (suite_outcome(1, SUITE, 1152), "**2 failed, 5888 passed, 12 skipped, 1 error**, 1,152 s"),
        (suite_outcome(0, "= 5890 passed in 9.1s =\n", 12), "5890 passed, 12 s"),
        (suite_outcome(1, "error: no such package\n", 12), "**ended with code 1**, 12 s"),
        (suite_outcome(None, SUITE, 7200), "**did not end in the time it was given**, 7,200 s"),
    ],
)
def test_a_cell_says_how_a_command_ended(outcome: Outcome, cell: str) -> None:
    assert outcome.cell() == cell
    assert outcome.passed != cell.startswith("**")


def test_the_table_replaces_what_stands_in_its_place(tmp_path: Path) -> None:
    rows = [Row("trixie", "3.13.5", ("git",), [Outcome("right", True, 1), Outcome("1 failed", False, 2)])]
    assert not rows[0].passed
    page = tmp_path / "page.md"
    page.write_text(f"before\n{BEGIN}\nold\n{END}\nafter\n")
    put_into_page(page, table(rows, ["one", "two"]))
    assert page.read_text().splitlines() == [
        "before",
        BEGIN,
        "| Debian | Python | installed beside the base | `one` | `two` |",
        "| --- | --- | --- | --- | --- |",
        "| trixie | 3.13.5 | git | right, 1 s | **1 failed**, 2 s |",
        END,
        "after",
    ]


@pytest.mark.parametrize("command", COMMANDS)
def test_its_commands_are_those_of_readme(command: str) -> None:
    assert command in (ROOT / "README.md").read_text(encoding="utf-8")
