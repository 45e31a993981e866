"""A bare Debian in a folder: made once by debootstrap, used through chroot as an ordinary user.

Whatever is mounted for it is mounted in a mount namespace of its own, which ends with the process that asked
for it: nothing has to be unmounted, and this computer's /dev cannot be taken along. So do its processes.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

USER = "kira"
PACKAGES = ("python3", "python3-pip", "git", "ca-certificates")
NEEDED = {"debootstrap": "debootstrap", "unshare": "util-linux", "chroot": "coreutils", "git": "git"}
"""Programs, and the Debian package of each."""
SCRIPTS = Path("/usr/share/debootstrap/scripts")
ANY_DEBIAN = "sid"
"""The script that those of all Debian's releases stand for; a release newer than debootstrap has none."""
CERTIFICATES = "/etc/ssl/certs/ca-certificates.crt"
NETWORK = ("/etc/resolv.conf", "/etc/hosts", "/etc/pip.conf")
PROXIES = ("http_proxy", "https_proxy", "no_proxy", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY")

_ENTER = """
root=$1 user=$2
shift 2
mount -t proc proc "$root/proc" || exit
for each in dev sys; do
    mount --rbind --make-rslave "/$each" "$root/$each" || exit
done
chroot --userspec="$user:$user" "$root" "$@"
exit $?
"""
"""The shell stays and reaps what the tests leave behind, as the first process of a system does."""


class Unavailable(Exception):
    """A bare system cannot be made here; the sentence says why and what to do."""


def refuse_where_impossible() -> None:
    """Raises Unavailable without Linux, without root or without a program."""
    if sys.platform != "linux":
        raise Unavailable("bare systems are made on Linux only (debootstrap, chroot)")
    if os.geteuid() != 0:
        raise Unavailable("making bare systems needs root (debootstrap, chroot): sudo python3 do.py fresh")
    missing = [package for program, package in NEEDED.items() if shutil.which(program) is None]
    if missing:
        raise Unavailable(f"not installed: {', '.join(missing)} (apt-get install {' '.join(missing)})")


def debian_mirror(lists: Path, scripts: Path = SCRIPTS) -> str:
    """The Debian archive that this system's apt uses. Raises Unavailable where it uses none.

    ``lists``: the folder ``/etc/apt``.
    """
    for kind, address, suites, components in _sources(lists):
        debian = any((scripts / suite).resolve().name == ANY_DEBIAN for suite in suites)
        if kind == "deb" and debian and "main" in components:
            return address
    raise Unavailable("apt on this computer uses no Debian archive: name one with --mirror URL")


def _sources(lists: Path) -> Iterator[tuple[str, str, list[str], list[str]]]:
    """(type, address, suites, components) of both kinds of apt's files, in their order."""
    for path in sorted(lists.glob("sources.list.d/*.sources")):
        for paragraph in re.split(r"\n\s*\n", path.read_text(encoding="utf-8")):
            fields = dict(re.findall(r"^([A-Za-z-]+):[ \t]*(.*(?:\n[ \t].*)*)", paragraph, re.MULTILINE))
            types, addresses, suites, components = (
                fields.get(name, "").split() for name in ("Types", "URIs", "Suites", "Components")
            )
            yield from ((kind, address, suites, components) for kind in types for address in addresses)
    for path in [lists / "sources.list", *sorted(lists.glob("sources.list.d/*.list"))]:
        text = path.read_text(encoding="utf-8") if path.is_file() else ""
        for kind, address, suite, rest in re.findall(
            r"^(deb\S*)\s+(?:\[.*?\]\s+)?(\S+)\s+(\S+)(.*)$", text, re.MULTILINE
        ):
            yield kind, address, [suite], rest.split()


class BareSystem:
    """``folder/suite``. Made where it is not there yet; what made it is told in ``folder/suite.log``."""

    def __init__(self, folder: Path, suite: str) -> None:
        self.suite = suite
        self.root = folder / suite
        self.home = Path("/home", USER)

    @contextmanager
    def held(self) -> Iterator[None]:
        """Nobody else uses it meanwhile. Raises Unavailable where somebody does."""
        import fcntl  # Linux has it; what this module says elsewhere must be said there

        self.root.parent.mkdir(parents=True, exist_ok=True)
        with self.root.with_name(f"{self.suite}.lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise Unavailable(f"another run uses {self.root}: wait for it, or name a --folder") from None
            yield

    @property
    def made(self) -> bool:
        return self.root.is_dir()

    def make(self, mirror: str, architecture: str | None = None) -> None:
        """Raises Unavailable with the last line that debootstrap wrote.

        ``architecture``: Debian's name of one that this computer emulates; default: its own.
        """
        begun = self.root.with_name(f"{self.suite}.begun")
        log = self.root.with_name(f"{self.suite}.log")
        if begun.exists():
            shutil.rmtree(begun)
        script = SCRIPTS / self.suite
        command = ["debootstrap", "--variant=minbase", f"--include={','.join(PACKAGES)}"]
        command += [f"--arch={architecture}"] if architecture else []
        command += [self.suite]
        command += [str(begun), mirror, str(script if script.exists() else SCRIPTS / ANY_DEBIAN)]
        with log.open("wb") as written:
            code = in_own_namespaces(command, written)
            code = code or in_own_namespaces(
                ["chroot", str(begun), "useradd", "--create-home", USER], written
            )
        if code:
            said = log.read_text(encoding="utf-8", errors="replace").strip().rpartition("\n")[2]
            raise Unavailable(f"Debian {self.suite} could not be made ({said}); see {log}")
        begun.rename(self.root)

    def take_network_settings(self) -> None:
        """Name servers, pip's configuration and certificates of this computer, as they are now."""
        for name in NETWORK:
            if Path(name).is_file():
                shutil.copyfile(name, self.inside(name))
        if "SSL_CERT_FILE" in os.environ:
            shutil.copyfile(os.environ["SSL_CERT_FILE"], self.inside(CERTIFICATES))

    def inside(self, path: str | Path) -> Path:
        """Where a path of the bare system is on this computer."""
        return self.root / str(path).lstrip("/")

    def version(self) -> str:
        """Of its Python, such as 3.13.5."""
        command = ["chroot", str(self.root), "python3", "--version"]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[1]

    def give(self, folder: Path) -> None:
        """A folder of the bare system to its ordinary user."""
        subprocess.run(["chroot", str(self.root), "chown", "-R", f"{USER}:{USER}", str(folder)], check=True)

    def run(self, command: str, folder: Path, home: Path, log: Path | None, limit_s: float) -> int | None:
        """Code of a command line, begun in ``folder`` by the user; None: not ended in ``limit_s``.

        ``log``: what it writes goes there, else to the terminal.
        """
        environment = {name: os.environ[name] for name in PROXIES if name in os.environ}
        environment |= {"HOME": str(home), "USER": USER, "LANG": "C.UTF-8"}
        environment |= {"PATH": "/usr/local/bin:/usr/bin:/bin"}
        if "SSL_CERT_FILE" in os.environ:
            environment["SSL_CERT_FILE"] = CERTIFICATES
        variables = [f"{name}={value}" for name, value in environment.items()]
        enter = ["bash", "-c", _ENTER, "bash", str(self.root), USER]
        inside = ["env", "-i", *variables, "bash", "-c", 'cd "$1" && eval "$2"', "bash", str(folder), command]
        if log is None:
            return in_own_namespaces([*enter, *inside], None, limit_s)
        with log.open("wb") as written:
            return in_own_namespaces([*enter, *inside], written, limit_s)


def in_own_namespaces(
    command: Sequence[str], log: IO[bytes] | None, limit_s: float | None = None
) -> int | None:
    """Run with mounts and processes of its own, all of which end when it ends, or this process does."""
    ended = ("setpriv", "--pdeathsig", "KILL")
    apart = ("unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc", "--")
    try:
        return subprocess.run(
            [*ended, *apart, *command],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log and subprocess.STDOUT,
            timeout=limit_s,
        ).returncode
    except subprocess.TimeoutExpired:
        return None
