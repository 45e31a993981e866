"""A real PostgreSQL server of our own: a fresh folder, reachable through a Unix socket only."""

from __future__ import annotations

import os
import secrets
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import psycopg


def find_programs() -> Path | None:
    """The folder of ``initdb`` and ``pg_ctl``, None if PostgreSQL is not installed."""
    debian = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    on_path = shutil.which("initdb")
    candidates = debian + ([Path(on_path).resolve().parent] if on_path else [])
    return next((folder for folder in candidates if (folder / "pg_ctl").exists()), None)


class PostgresServer:
    """PostgreSQL refuses to run as root, so root runs it as user ``postgres``."""

    def __init__(self, programs: Path) -> None:
        self.programs = programs
        # not TMPDIR: user postgres must be able to go there, and a socket's path has at most 107 bytes
        self.folder = Path(tempfile.mkdtemp(prefix="glovecal-pg-", dir="/tmp"))
        self._user = "postgres" if os.geteuid() == 0 else None
        if self._user is not None:
            shutil.chown(self.folder, self._user, self._user)
        self._run("initdb", "-k", "-A", "trust", "-U", "postgres", "-E", "UTF8", "--no-sync")
        self.start()

    def start(self) -> None:
        # without fsync: only power cuts, which no test can make, would tell the difference
        options = f"-c fsync=off -c listen_addresses='' -c unix_socket_directories='{self.folder}'"
        self._run("pg_ctl", "-w", "-t", "30", "-l", str(self.folder / "log"), "-o", options, "start")

    def start_after_kill(self) -> None:
        """Start once the processes of the killed server have let go of its memory."""
        for _ in range(100):
            try:
                return self.start()
            except RuntimeError:
                time.sleep(0.2)
        raise RuntimeError(f"PostgreSQL does not start again: {(self.folder / 'log').read_text()[-500:]}")

    @contextmanager
    def hanging(self) -> Iterator[None]:
        """It takes connections and answers nothing."""
        pid = int((self.folder / "data" / "postmaster.pid").read_text().split()[0])
        postmaster = psutil.Process(pid)
        processes = [*postmaster.children(recursive=True), postmaster]
        for each in processes:
            each.suspend()
        try:
            yield
        finally:
            for each in processes[::-1]:
                with suppress(psutil.NoSuchProcess):
                    each.resume()

    def stop(self) -> None:
        self._run("pg_ctl", "-w", "-t", "30", "-m", "immediate", "stop")

    def remove(self) -> None:
        if (self.folder / "data" / "postmaster.pid").exists():
            self.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def new_database(self, *, place: Path | None = None) -> str:
        """SQLAlchemy URL of a new, empty database, whose tables lie in ``place``."""
        name = f"glovecal_{secrets.token_hex(6)}"
        tablespace = "pg_default" if place is None else f"of_{name}"
        with psycopg.connect(
            f"host={self.folder} user=postgres dbname=postgres", autocommit=True
        ) as connection:
            if place is not None:
                folder = place / tablespace
                folder.mkdir()
                if self._user is not None:
                    shutil.chown(folder, self._user, self._user)
                connection.execute(f"CREATE TABLESPACE {tablespace} LOCATION '{folder}'".encode())
            connection.execute(f"CREATE DATABASE {name} STRATEGY FILE_COPY TABLESPACE {tablespace}".encode())
        return f"postgresql+psycopg://postgres@/{name}?host={self.folder}"

    def _run(self, program: str, *arguments: str) -> None:
        command = [str(self.programs / program), "-D", str(self.folder / "data"), *arguments]
        other = {"user": self._user, "group": self._user, "extra_groups": []} if self._user else {}
        done = subprocess.run(command, capture_output=True, text=True, cwd="/", check=False, **other)
        if done.returncode:
            raise RuntimeError(f"{program} failed: {done.stderr or done.stdout}")
