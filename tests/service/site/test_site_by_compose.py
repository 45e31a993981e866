"""A site of two services as docker/site says it, without containers: each computer is a network namespace,
and its environment, commands, host name and secrets are read from the Compose files themselves.

Two minutes: ``python3 do.py test -m slow tests/service/site/test_site_by_compose.py``.
"""

from __future__ import annotations

import json
import re
import secrets
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import NoReturn

import numpy as np
import psutil
import pytest
from compose_files import Container, container, first_steps
from postgres_server import find_programs
from site_computers import Computers
from site_support import eventually

from glovecal_service.secret_files import FILE, SECRETS
from glovecal_service.settings import Settings

STORE = "192.168.1.10"
ADDRESSES = {
    "store": STORE, "lab": "192.168.1.20", "lab-2": "192.168.1.21", "capture-1": "192.168.1.33",
    "viewer-1": "192.168.1.41",
}  # fmt: skip
NAMES = {"lab.example": ADDRESSES["lab"], "lab-2.example": ADDRESSES["lab-2"]}
OTHER = {"lab": "lab-2.example", "lab-2": "lab.example"}
RATE_HZ = 120.0
LONGEST_GAP_S = 3.0


def of_site(name: str) -> Container:
    return container("site/service.yaml", "service", {"NAME": name, "OTHER": OTHER[name], "STORE": STORE})


@pytest.mark.parametrize("found", [of_site("lab"), container("compose.yaml", "service", {})])
def test_every_setting_in_the_compose_files_is_one(found: Container) -> None:
    known = {f"GLOVECAL_{name.upper()}" for name in Settings.model_fields} | {"GLOVECAL_INSTALLED_BY"}
    ours = {name for name in found.environment if name.startswith("GLOVECAL_")}
    assert ours <= known | {f"{name}{FILE}" for name in SECRETS}
    named = {
        value
        for name, value in found.environment.items()
        if name.removesuffix(FILE) in SECRETS and FILE in name
    }
    assert named == set(found.secrets)
    Settings.model_validate(
        {name.removeprefix("GLOVECAL_").lower(): value for name, value in found.environment.items()}
    )


def succeeds(computers: Computers, computer: str, line: str) -> bool:
    process = computers.start(computer, line)
    process.communicate(timeout=60)
    return process.returncode == 0


class Host:
    """A service of the site on its computer, as its container would be."""

    def __init__(self, computers: Computers, name: str, shared: Path) -> None:
        self.computers, self.name = computers, name
        self.container = of_site(name)
        self.folder = computers.folder(name)
        self.data = self.folder / "data"
        self.data.mkdir(mode=0o700)
        settings = {name: self._here(value) for name, value in self.container.environment.items()}
        brought = " && ".join(
            f"cp {shared / file.name} {place}" for place, file in self.container.secrets.items()
        )
        words = " ".join(f"{name}={shlex.quote(value)}" for name, value in settings.items() if name != "HOME")
        run = self.folder / "run"
        run.write_text(
            "#!/bin/sh\n"
            f"[ $(hostname) = {self.container.hostname} ] || "
            f"""exec unshare --uts sh -c 'hostname {self.container.hostname} && exec "$@"' - "$0" "$@"\n"""
            f'mount -t tmpfs none /run && mkdir /run/secrets && {brought} && exec env {words} "$@"\n'
        )
        run.chmod(0o700)
        self.process: subprocess.Popen[str] | None = None

    def run(self, line: str) -> str:
        """A line of the first steps, or one like them."""
        run = self.folder / "run"
        return self.computers.run(self.name, self._here(line.replace("$RUN", str(run))))

    def _here(self, text: str) -> str:
        """With the folder that the volume on ``/data`` is."""
        return re.sub(r"(?<![\w.])/data(?=[/\s;]|$)", str(self.data), text)

    def start(self) -> None:
        log = self.folder / "log"
        line = f"exec {self.folder / 'run'} {shlex.join(self.container.command)} >> {log} 2>&1"
        self.process = self.computers.start(self.name, line)

    def is_healthy(self) -> bool:
        line = f"{self.folder / 'run'} {shlex.join(self.container.health_check)}"
        return succeeds(self.computers, self.name, line)

    def is_ready(self) -> bool:
        line = "curl -sk -o /dev/null -w '%{http_code}' https://localhost:8600/v1/health/ready"
        return self.computers.start(self.name, line).communicate(timeout=60)[0] == "200"

    def kill(self) -> None:
        """All of it at once, as an engine does."""
        if self.process is None:
            return
        with suppress(psutil.NoSuchProcess):
            first = psutil.Process(self.process.pid)
            for each in (first, *first.children(recursive=True)):
                with suppress(psutil.NoSuchProcess):
                    each.kill()
        self.process.communicate(timeout=60)
        self.process = None


@pytest.fixture
def computers() -> Iterator[Computers]:
    with ExitStack() as undo:
        place = Path(undo.enter_context(tempfile.TemporaryDirectory(prefix="glovecal-site-")))
        place.chmod(0o755)
        found = Computers(place, ADDRESSES, NAMES)
        try:
            found.build(undo)
        except (OSError, subprocess.CalledProcessError) as error:
            pytest.skip(f"no network namespaces can be made here (root on Linux, iproute2): {error}")
        yield found


@pytest.fixture
def shared(computers: Computers, not_here: Callable[[str], NoReturn]) -> Iterator[Path]:
    """The folder of secrets; PostgreSQL and an S3 store run, and ask for them."""
    programs = find_programs()
    if programs is None:
        not_here("PostgreSQL is not installed (Debian: apt-get install postgresql)")
    folder = computers.folder("store")
    for name in ("database-password", "s3-secret-key"):
        (folder / name).write_text(secrets.token_hex(24))
    shutil.chown(folder, "postgres")
    (folder / "database-password").chmod(0o644)
    as_postgres = f"cd {folder} && exec runuser -u postgres -- {programs}/"
    computers.run(
        "store",
        f"{as_postgres}initdb -D data -E UTF8 -A scram-sha-256 -U glovecal --pwfile database-password -N",
    )
    (folder / "data" / "pg_hba.conf").write_text("host all all all scram-sha-256\n")
    (folder / "data" / "pg_hba.conf").chmod(0o644)
    options = f"-c listen_addresses='*' -c unix_socket_directories='{folder}' -c fsync=off"
    database = computers.start("store", f"{as_postgres}postgres -D data {options} > log 2>&1")
    store = Path(__file__).with_name("s3_store.py")
    objects = computers.start(
        "store", f"exec {sys.executable} {store} 7070 glovecal {folder / 's3-secret-key'} 2> s3-log"
    )
    create = f"PGPASSWORD=$(cat database-password) {programs}/createdb -h {STORE} -U glovecal glovecal"
    eventually(lambda: succeeds(computers, "store", create), "the database is made")
    yield folder
    for each in (objects, database):
        each.terminate()
        each.communicate(timeout=60)


class Watched:
    """Poses of the glove at the viewer's."""

    def __init__(self, computers: Computers) -> None:
        self._file = computers.folder("viewer-1") / "poses"
        line = f"exec env GLOVECAL_SITE_FILE=viewer-1.glovecal glovecal watch right --json > {self._file}"
        self.process = computers.start("viewer-1", line)

    def poses(self) -> list[dict]:
        lines = self._file.read_text().splitlines() if self._file.exists() else []
        return [json.loads(line) for line in lines[:-1] if '"sequence"' in line]

    def go_on(self) -> bool:
        """Whether more come."""
        before = len(self.poses())
        eventually(lambda: len(self.poses()) > before + 60, "poses go on")
        return True

    def stop(self) -> None:
        self.process.terminate()
        self.process.communicate(timeout=60)


@pytest.mark.slow
@pytest.mark.needs_postgres
def test_either_service_is_killed_and_the_other_goes_on(computers: Computers, shared: Path) -> None:
    lab, lab_2 = Host(computers, "lab", shared), Host(computers, "lab-2", shared)
    *at_lab, copy, at_the_other = first_steps("site/service.yaml")
    for line in at_lab:
        lab.run(line.replace("key add NAME", "key add lena"))
    for kind, name in (("capture", "capture-1"), ("viewer", "viewer-1")):
        lab.run(f"$RUN glovecal site add {name} --as {kind} --to {computers.folder(name)}/{name}.glovecal")
    lab.run(copy)
    shutil.copy(lab.folder / "lab-2.tar", lab_2.folder)
    lab_2.run(at_the_other.partition(": ")[2])
    assert not (lab_2.data / "site" / "authority.key").exists()
    with ExitStack() as running:
        for host in (lab, lab_2):
            host.start()
            running.callback(host.kill)
        for host in (lab, lab_2):
            eventually(lambda host=host: host.is_healthy() and host.is_ready(), f"{host.name} is ready")
        line = (
            "exec env GLOVECAL_SITE_FILE=capture-1.glovecal glovecal capture --device simulated --glove right"
        )
        capture = computers.start("capture-1", f"{line} > log 2>&1")
        running.callback(capture.communicate)
        running.callback(capture.terminate)
        watched = Watched(computers)
        running.callback(watched.stop)
        watched.go_on()
        lab.run("$RUN glovecal demo --effect none --seed 7 --write-takes takes")
        lab.run("$RUN glovecal take import takes/training.csv --subject pia")
        lab.run("$RUN glovecal train --subject pia --method linear")
        [model] = json.loads(lab_2.run("$RUN glovecal model list --json"))
        lab_2.run(f"$RUN glovecal model export {model['id']} model.safetensors")
        assert (lab_2.folder / "model.safetensors").stat().st_size > 1000, "one database, and one store"
        for host, other in ((lab, lab_2), (lab_2, lab)):
            host.kill()
            watched.go_on()
            assert other.is_healthy()
            assert other.is_ready()
            host.start()
            eventually(host.is_ready, f"{host.name} is back")
            watched.go_on()
        poses = watched.poses()
    sequences = [pose["sequence"] for pose in poses]
    assert sequences == sorted(set(sequences)), "one pose a frame"
    gap_s = max(np.diff(sequences)) / RATE_HZ
    print(f"{len(poses)} poses, longest gap {gap_s:.1f} s")
    assert gap_s <= LONGEST_GAP_S
