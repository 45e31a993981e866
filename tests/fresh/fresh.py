"""``python3 do.py fresh``: README's two commands on bare systems, as their new user has them.

A system has Python, pip and git of its Debian and nothing else; it is kept for the next time. The commands
run in a new clone of what is committed here, in a new home, so that all they need is fetched anew.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from datetime import date
from pathlib import Path

from bare_system import PACKAGES, BareSystem, Unavailable, debian_mirror, refuse_where_impossible
from fresh_table import Outcome, Row, around_table, demo_outcome, put_into_page, suite_outcome, table

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path("/var/cache/glovecal-fresh")
SUITES = ("bookworm", "trixie", "forky")
HOSTILE, HOSTILE_SUITE = "hostile", "trixie"
"""A place like any other computer, and the system it is made on."""
HOSTILE_FOLDER = "Übungen für die Hände – größer und länger, als es irgendjemand erwartet hätte"
HOSTILE_SHELL = "export LANG=C TZ=Asia/Kathmandu; umask 077; trap '' INT; "
"""As from the background of a script: whatever is begun there has SIGINT ignored."""
COMMANDS: dict[str, Callable[[int | None, str, float], Outcome]] = {
    "python3 do.py demo": demo_outcome,
    "python3 do.py test": suite_outcome,
}
LIMIT_S = 2 * 3600
CLONE = "glovecal"
KEPT = (".venv", ".tools")
"""Folders of a clone that the next one with the same place takes over."""


def main() -> int:
    arguments, tests = _split(sys.argv[1:])
    parser = argparse.ArgumentParser(
        prog="do.py fresh",
        description="README's two commands on bare Debian systems (root and debootstrap needed)",
        epilog="fresh trixie -- tests/client -q: only these tests, in a clone that is kept",
    )
    usual = ", ".join((*SUITES, HOSTILE))
    parser.add_argument(
        "suites",
        nargs="*",
        metavar="SUITE",
        help=f"Debian releases, and {HOSTILE}: {HOSTILE_SUITE} in a long path with blanks and umlauts that "
        f"others cannot read, a home that cannot be written, LANG=C, SIGINT ignored; default: {usual}",
    )
    parser.add_argument("--folder", type=Path, default=FOLDER, help=f"where they are kept; default: {FOLDER}")
    parser.add_argument("--mirror", help="Debian archive; default: the one that apt uses here")
    parser.add_argument("--page", type=Path, help="write the table into the marked part of a page, too")
    parser.add_argument(
        "--smoke", action="store_true", help="clone, command and table, without a bare system"
    )
    options = parser.parse_args(arguments)
    os.environ["PATH"] += ":/usr/sbin:/sbin"  # not everywhere in root's, and debootstrap and chroot are there
    try:
        return _smoke() if options.smoke else _fresh(options, tests)
    except (Unavailable, ValueError) as error:
        print(error, file=sys.stderr)
        return 2


def _fresh(options: argparse.Namespace, tests: Sequence[str]) -> int:
    """Raises Unavailable, and ValueError for a page without the marks."""
    if options.page:
        around_table(options.page)
    refuse_where_impossible()
    with ExitStack() as ours:
        places = options.suites or (*SUITES, HOSTILE)
        suites = dict.fromkeys(HOSTILE_SUITE if place == HOSTILE else place for place in places)
        systems = {
            suite: ours.enter_context(_system(options.folder, suite, options.mirror)) for suite in suites
        }
        _tell_uncommitted()
        if tests:
            return max(_only(system, tests) for system in systems.values())
        rows = [
            _try(systems[HOSTILE_SUITE], hostile=True) if place == HOSTILE else _try(systems[place])
            for place in places
        ]
    written = table(rows, list(COMMANDS))
    print(written)
    if options.page:
        put_into_page(options.page, f"{_heading()}\n\n{written}")
    return 0 if all(row.passed for row in rows) else 1


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Before and after ``--``."""
    place = list(arguments).index("--") if "--" in arguments else len(arguments)
    return list(arguments[:place]), list(arguments[place + 1 :])


@contextmanager
def _system(folder: Path, suite: str, mirror: str | None) -> Iterator[BareSystem]:
    """Made if it is not there yet, and nobody else's meanwhile. Raises Unavailable."""
    system = BareSystem(folder, suite)
    with system.held():
        if not system.made:
            print(f"making Debian {suite} in {system.root} ...", file=sys.stderr, flush=True)
            system.make(mirror or debian_mirror(Path("/etc/apt")))
        system.take_network_settings()
        yield system


def _try(system: BareSystem, hostile: bool = False) -> Row:
    """Both commands in a new clone and a new home, which are removed afterwards."""
    name = f"{system.suite}, {HOSTILE}" if hostile else system.suite
    place = Path(tempfile.mkdtemp(prefix="fresh-", dir=system.inside("/home")))
    home = Path("/home", place.name)
    clone = home / (HOSTILE_FOLDER if hostile else "") / CLONE
    _clone(system.inside(clone))
    system.give(home)
    if hostile:
        system.inside(clone).parent.chmod(0o700)
        os.chown(place, 0, 0)
        place.chmod(0o555)
    outcomes = []
    try:
        for command, outcome in COMMANDS.items():
            log = system.root.with_name(f"{name.replace(', ', '-')}-{command.split()[-1]}.log")
            print(f"Debian {name}: {command}, told in {log} ...", file=sys.stderr, flush=True)
            begun = time.monotonic()
            code = system.run(HOSTILE_SHELL * hostile + command, clone, home, log, LIMIT_S)
            text = log.read_text(encoding="utf-8", errors="replace")
            outcomes.append(outcome(code, text, time.monotonic() - begun))
    finally:
        shutil.rmtree(place)
    return Row(name, system.version(), PACKAGES, outcomes)


def _only(system: BareSystem, tests: Sequence[str]) -> int:
    """Some tests, on the terminal; clone, environment and home are kept for the next time."""
    name = hashlib.sha256(bytes(ROOT)).hexdigest()[:8]
    place = system.inside(system.home) / name
    new = place / "new"
    _clone(new)
    old = place / CLONE
    for folder in KEPT:
        if (old / folder).is_dir():
            (old / folder).rename(new / folder)
    shutil.rmtree(old, ignore_errors=True)
    new.rename(old)
    system.give(system.home)
    command = shlex.join(["python3", "do.py", "test", *tests])
    code = system.run(command, system.home / name / CLONE, system.home, None, LIMIT_S)
    return 1 if code is None else code


def _clone(into: Path) -> None:
    """What is committed here, sharing no file with this checkout: its owner will be another.

    Raises Unavailable.
    """
    command = ["git", "clone", "--quiet", "--no-hardlinks", str(ROOT), str(into)]
    try:
        done = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    except FileNotFoundError:
        raise Unavailable(
            "fresh clones this checkout with git, which is not installed: install git"
        ) from None
    if done.returncode:
        raise Unavailable(f"{ROOT} cannot be cloned: {done.stderr.strip()}")


def _commit() -> str:
    command = ["git", "-C", str(ROOT), "log", "-1", "--format=%h"]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def _tell_uncommitted() -> None:
    command = ["git", "-C", str(ROOT), "status", "--porcelain"]
    changed = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    if changed:
        print(
            f"{len(changed)} files have changes that are not committed: they are not tried.", file=sys.stderr
        )


def _heading() -> str:
    return f"Commit {_commit()}, {date.today():%Y-%m-%d}, each as an ordinary user with a new home."


def _smoke() -> int:
    """All but the bare system: a clone is made, and its do.py asked here."""
    with tempfile.TemporaryDirectory(prefix="glovecal-fresh-") as temporary:
        _clone(Path(temporary, CLONE))
        begun = time.monotonic()
        command = [sys.executable, "do.py", "help"]
        code = subprocess.run(command, cwd=Path(temporary, CLONE), stdout=subprocess.DEVNULL).returncode
        outcome = Outcome(f"ended with code {code}", code == 0, time.monotonic() - begun)
    print(table([Row("(this computer)", sys.version.split()[0], (), [outcome])], ["python3 do.py help"]))
    return code


if __name__ == "__main__":
    sys.exit(main())
