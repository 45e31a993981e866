"""The installed service where others can read and write: a start folder with traps, and no umask at all."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest
from realtime_support import eventually, free_endpoint

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_service.settings import Settings
from glovecal_service.store import Store

TRAPS = ("dask", "distributed", "zenoh", "numpy", "random", "tempfile", "glovecal_models", "tornado")
"""Imported by a child of the service before anything else, or late; a name for the standard library's too."""


@dataclass(frozen=True)
class Place:
    folder: Path
    data: Path
    endpoint: str
    port: int

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """The installed command, as a user starts it, in the folder with the traps."""
        settings = {"GLOVECAL_DATA": str(self.data), "GLOVECAL_ZENOH": self.endpoint}
        return subprocess.Popen(
            [str(Path(sys.executable).with_name("glovecal")), *arguments],
            env=os.environ | settings | {"GLOVECAL_PORT": str(self.port)},
            cwd=self.folder,
            umask=0,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    @contextmanager
    def running(self, *arguments: str) -> Iterator[subprocess.Popen[str]]:
        process = self.start(*arguments)
        try:
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=120)

    def is_ready(self) -> bool:
        try:
            with RestClient(f"http://127.0.0.1:{self.port}") as client:
                client.get("/health/ready")
            return True
        except ServiceError:
            return False


@pytest.fixture
def place(tmp_path: Path) -> Place:
    folder = tmp_path / "start"
    folder.mkdir()
    for name in TRAPS:
        trap = f"open({str(tmp_path / 'sprung')!r}, 'a').write('{name}\\n')\nraise ImportError('a trap')\n"
        (folder / f"{name}.py").write_text(trap)
    return Place(folder, tmp_path / "data", free_endpoint(), int(free_endpoint().rpartition(":")[2]))


def table(folder: Path) -> Path:
    rows = [f"{n / 50},{100 + n % 37},{0.4 * (n % 37)}" for n in range(300)]
    file = folder / "poses.csv"
    file.write_text("\n".join(["time_s,s.I_PIP,r.I_PIP", *rows]) + "\n")
    return file


def readable(data: Path) -> dict[str, str]:
    """What others have any right to, with its permissions."""
    modes = {path: path.lstat().st_mode for path in (data, *data.rglob("*"))}
    return {str(path): stat.filemode(mode) for path, mode in modes.items() if mode & 0o077}


def test_no_trap_springs_and_nobody_else_reads(place: Place, tmp_path: Path) -> None:
    with place.running("serve"), RestClient(f"http://127.0.0.1:{place.port}") as client:
        eventually(place.is_ready, "the service is ready")
        client.post("/subjects", {"name": "anna"})
        taken = client.upload_takes(table(tmp_path), subject="anna")
        job = client.post("/models/train", {"subject": "anna", "layout": taken["layout"], "method": "spgp"})
        assert client.wait_for_job(job["id"])["state"] == "done"
        capture = (
            "--device",
            "simulated",
            "--glove",
            "right",
            "--subject",
            "anna",
            "--connect",
            place.endpoint,
        )
        with place.running("capture", *capture):
            eventually(lambda: client.get("/gloves")["seen"], "the glove is there")
            client.post("/recordings", {"glove": "right", "name": "live", "lead_s": 0})
            eventually(lambda: list(place.data.glob("recordings/*.glog")), "it is recorded")
            assert readable(place.data) == {}
        kinds = {path.suffix or path.name for path in place.data.rglob("*") if path.is_file()}
    assert {".glvlog", ".glog", ".sqlite3", ".sqlite3-wal", ".sqlite3-shm", ".safetensors"} <= kinds
    assert not (tmp_path / "sprung").exists()


def opened(data: Path, *, more: str = "") -> None:
    """A data folder as earlier versions left it under the usual umask."""
    with Store.open(Settings(data=data)) as store:
        store.subjects.create("anna")
    (data / "capture" / "lab").mkdir(parents=True)
    (data / "capture" / "lab" / "run.glvlog").write_bytes(b"readings")
    if more:
        (data / more).write_text("not ours")
    for path in (data, *data.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)


def test_an_open_data_folder_is_closed_and_the_log_says_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    data = tmp_path / "data"
    opened(data)
    (data / "artifacts" / "elsewhere").symlink_to(tmp_path)
    before = stat.S_IMODE(tmp_path.stat().st_mode)
    for _ in range(2):
        Store.open(Settings(data=data)).close()
        assert set(readable(data)) <= {str(data / "artifacts" / "elsewhere")}
    assert [f"files and folders of {data}" in record.message for record in caplog.records] == [True]
    assert stat.S_IMODE(tmp_path.stat().st_mode) == before


def test_what_is_not_ours_keeps_its_permissions(tmp_path: Path) -> None:
    """A home, for example, that others have to pass."""
    opened(tmp_path, more="letter.txt")
    Store.open(Settings(data=tmp_path)).close()
    assert set(readable(tmp_path)) == {str(tmp_path), str(tmp_path / "letter.txt")}
