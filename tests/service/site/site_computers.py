"""Test support: computers of a site, each in a network namespace of its own, made by root on Linux."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path

from port_attack import NOBODY


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


class Computers:
    """Network namespaces joined by a switch, and a folder for each."""

    def __init__(self, place: Path, addresses: Mapping[str, str], names: Mapping[str, str]) -> None:
        """``addresses``: of each computer; ``names``: addresses by the names that all know."""
        self.place, self._addresses = place, addresses
        self._names = {name: f"gc{os.getpid()}-{name}" for name in (*addresses, "switch")}
        self._hosts = place / "hosts"
        self._hosts.write_text("127.0.0.1 localhost\n" + "".join(f"{names[name]} {name}\n" for name in names))

    def build(self, undo: ExitStack) -> None:
        """Raises OSError, CalledProcessError where this user or system cannot."""
        for name in self._names.values():
            ip("netns", "add", name)
            undo.callback(ip, "netns", "del", name)
            ip("-n", name, "link", "set", "lo", "up")
        switch = self._names["switch"]
        ip("-n", switch, "link", "add", "switch", "type", "bridge")
        ip("-n", switch, "link", "set", "switch", "up")
        for number, (name, address) in enumerate(self._addresses.items()):
            port, there = f"port{number}", self._names[name]
            ip("-n", switch, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", there)
            ip("-n", switch, "link", "set", port, "master", "switch", "up")
            ip("-n", there, "address", "add", f"{address}/24", "dev", "eth0")
            ip("-n", there, "link", "set", "eth0", "up")
            self.folder(name).mkdir()
        subprocess.run(self._command(next(iter(self._addresses)), "true"), check=True, capture_output=True)

    def folder(self, computer: str) -> Path:
        return self.place / computer

    def start(self, computer: str, line: str, **more: str) -> subprocess.Popen[str]:
        """A line of a shell in the computer's folder."""
        known = {name: value for name, value in os.environ.items() if not name.startswith("GLOVECAL_")}
        path = f"{Path(sys.executable).parent}{os.pathsep}{known['PATH']}"
        home = {"HOME": str(self.folder(computer)), "PATH": path, "COLUMNS": "200"}
        return subprocess.Popen(
            self._command(computer, line), cwd=self.folder(computer), env=known | home | more, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    def as_nobody(self, computer: str, line: str) -> str:
        """``line`` as another user, whose home the computer's folder is; the others' are closed to them.

        Python may lie where only this user can look: there it is then put where it is, alone.
        """
        folder, python = self.folder(computer), Path(sys.base_prefix).resolve()
        os.chown(folder, NOBODY, NOBODY)
        for file in folder.iterdir():
            os.chown(file, NOBODY, NOBODY)
        user = f"exec setpriv --reuid {NOBODY} --regid {NOBODY} --clear-groups --bounding-set -all {line}"
        closed = [parent for parent in python.parents if not parent.stat().st_mode & 0o001]
        if not closed:
            return user
        aside = self.place / "python"
        aside.mkdir(exist_ok=True)
        return (
            f"mount --bind {python} {aside} && mount -t tmpfs -o mode=755 none {closed[-1]} && "
            f"mkdir -p {python} && mount --bind {aside} {python} && {user}"
        )

    def _command(self, computer: str, line: str) -> list[str]:
        told = f"mount --bind {self._hosts} /etc/hosts && {line}"
        return ["ip", "netns", "exec", self._names[computer], "sh", "-c", told]

    def run(self, computer: str, line: str, **more: str) -> str:
        process = self.start(computer, line, **more)
        said, complained = process.communicate(timeout=300)
        assert process.returncode == 0, complained
        return said

    def plug(self, computer: str, is_in: bool) -> None:
        port = f"port{list(self._addresses).index(computer)}"
        ip("-n", self._names["switch"], "link", "set", port, "up" if is_in else "down")
