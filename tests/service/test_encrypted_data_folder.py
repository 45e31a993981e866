"""A service with a key: what it does is as without, and its data folder shows nothing of anybody."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import zipfile
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random

import anyio
import httpx
import pytest
from realtime_support import eventually, free_endpoint

from glovecal_client import FrameLog, Recording
from glovecal_client.encryption.kept_file import is_kept_encrypted, read_kept
from glovecal_client.encryption.key_file import KEY_FILE, KEY_ID_FILE, make_key_file, settle_encryption
from glovecal_client.errors import BadEncryptionKey
from glovecal_models.errors import DamagedArtifact
from glovecal_service.jobs.finished_tasks import FinishedTasks
from glovecal_service.jobs.job_kind import TaskResult
from glovecal_service.rest.http import upload_folder
from glovecal_service.rest.http.upload_folder import UploadFolder
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.blobs import Artifacts, FolderBlobs
from glovecal_service.store.database import Database
from glovecal_service.store.encrypt_folder import encrypt_folder
from glovecal_service.store.shared_files import SharedFiles

pytest.importorskip("cv2")
GLOVECAL = [sys.executable, "-m", "glovecal_service.cli.command"]
KNOWN = (
    b"GLVLOG1", b"GLVF", b"matroska", b"FFV1", b"\xff\xd8\xff\xe0", b"PK\x03\x04", b"I_MCP", b"THUMB",
    b"s.A,s.B", b"glovecal.take", b"time_s", b"data_offsets",
)  # fmt: skip
"""Beginnings of logs, frames, videos, pictures, archives and artifacts, and names of sensors. Half a million
encrypted bytes hold any three by chance in one of 35 runs."""
ROW = "{:.3f},{},{},{},{},{:.2f}\n".format
TABLE = "time_s,take,wearing,s.A,s.B,r.I_PIP\n" + "".join(
    ROW(at / 50, take, take[0], (at * 7 + shift) % 90, at * 3 % 50, (at * 7 + shift) % 90 * 0.8)
    for take, shift in (("a1", 0), ("b1", 3), ("c1", 5))
    for at in range(200)
)


class Place:
    """A folder with a data folder and a key beside it, and the command there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.data, self.key = folder, folder / "data", folder / "disk.key"
        self.temporary = folder / "tmp"
        self.temporary.mkdir()
        port = free_endpoint().rpartition(":")[2]
        self.url = f"http://127.0.0.1:{port}"
        self.environment = {name: value for name, value in os.environ.items() if "GLOVECAL" not in name} | {
            "GLOVECAL_DATA": str(self.data), "GLOVECAL_ZENOH": free_endpoint(), "GLOVECAL_PORT": port,
            "TMPDIR": str(self.temporary),
        }  # fmt: skip

    def run(self, *words: str, **more: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [*GLOVECAL, *words],
            env=self.environment | more,
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=False,
        )

    def ask(self, *words: str) -> str:
        """Of the running service."""
        done = self.run(*words, GLOVECAL_URL=self.url)
        assert done.returncode == 0, done.stderr
        return done.stdout

    @contextmanager
    def process(self, *words: str) -> Iterator[subprocess.Popen[str]]:
        command = [*GLOVECAL, *words]
        started = subprocess.Popen(
            command, env=self.environment, cwd=self.folder, text=True, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            yield started
            started.send_signal(signal.SIGINT)
            started.communicate(timeout=120)
        finally:
            started.kill()
            started.communicate(timeout=120)

    def files(self) -> dict[str, bytes]:
        """Without the database, which is not encrypted."""
        places = [*self.data.rglob("*"), *self.temporary.rglob("*")]
        return {
            path.relative_to(self.folder).as_posix(): path.read_bytes()
            for path in places
            if path.is_file() and not path.is_symlink() and "sqlite3" not in path.name
        }


@pytest.fixture(scope="module")
def used(tmp_path_factory: pytest.TempPathFactory) -> Place:
    """A glove was captured, recorded and filmed, a table imported and a model trained; all has ended."""
    place = Place(tmp_path_factory.mktemp("encrypted"))
    assert place.run("encryption", "make-key", str(place.key)).returncode == 0
    place.environment[KEY_FILE] = str(place.key)
    with place.process("serve", "--no-studio") as serving, httpx.Client(base_url=place.url + "/v1") as http:
        assert serving.stdout is not None
        assert serving.stdout.readline().startswith("Glovecal is running")
        place.ask("subject", "add", "anna")
        table = place.folder / "table.csv"
        table.write_text(TABLE)
        capture = ("capture", "--device", "simulated", "--glove", "right", "--subject", "anna")
        with place.process(*capture):
            eventually(lambda: "right" in http.get("/live-gloves").text, "the glove is there")
            assert http.post("/films", json={"source": "rendered"}, timeout=60).status_code == 201
            recorded = json.loads(
                place.ask("record", "right", "fist", "--seconds", "2", "--pre-roll", "1", "--json")
            )
            takes = [take["id"] for take in json.loads(place.ask("take", "list", "--json"))]
            assert len(takes) == 1, recorded
            filmed = http.post("/films/stop", json={"takes": takes}, timeout=120).json()
            assert filmed["sentences"][0].startswith("fist: "), filmed
        place.ask("take", "import", str(table), "--subject", "ben")
        place.ask("train", "--subject", "ben", "--method", "linear")
        picture = http.get(f"/videos/{takes[0]}/pictures/0")
        assert picture.content.startswith(b"\xff\xd8\xff")
        place.ask("subject", "export", "anna", "--to", "anna.zip")
        place.ask("take", "export", takes[0], "fist.csv")
    return place


def test_no_file_shows_anything(used: Place) -> None:
    shown = {name: known for name, content in used.files().items() for known in KNOWN if known in content}
    assert shown == {}
    kinds = {name.split("/")[1] for name in used.files() if name.startswith("data/")}
    assert kinds >= {"artifacts", "capture", "films", "fits", "recordings", "uploads", "videos"}


def test_what_is_exported_is_not_encrypted(used: Place) -> None:
    with zipfile.ZipFile(used.folder / "anna.zip") as archive:
        content = {Path(name).suffix: archive.read(name) for name in archive.namelist()}
        manifest = json.loads(archive.read("manifest.json"))
    assert manifest["problems"] == []
    assert content[".glog"].startswith(b"GLVLOG1")
    assert b"matroska" in content[".mkv"][:60]
    assert content[".zip"].startswith(b"PK\x03\x04")
    assert b"glovecal.take" in content[".safetensors"]
    assert (used.folder / "fist.csv").read_text().startswith("time_s,")


def test_its_files_are_read_by_the_verbs(used: Place) -> None:
    [film] = (used.data / "films").glob("*.mkv")
    read = used.run("encryption", "read", str(film), "--to", "film.mkv")
    assert read.returncode == 0, read.stderr
    assert b"matroska" in (used.folder / "film.mkv").read_bytes()[:60]
    [log] = (used.data / "capture" / "lab" / "right").glob("*.glvlog")
    replayed = used.run(
        "capture", "--device", f"replay:{log}", "--glove", "x", "--data", str(used.folder / "d")
    )
    assert "is encrypted" not in replayed.stderr


NONE = "is encrypted with the key .* name its file in GLOVECAL_ENCRYPTION_KEY_FILE"
OTHER = "is encrypted with the key .* other.key holds the key .* name the right file"
LOOK, SERVE = ("take", "list"), ("serve", "--no-studio")
CAPTURE = ("capture", "--device", "simulated", "--glove", "right")


@pytest.mark.parametrize(
    ("key", "sentence", "verb"),
    [
        ("", NONE, SERVE),
        ("", NONE, CAPTURE),
        ("other.key", OTHER, SERVE),
        ("other.key", OTHER, CAPTURE),
        ("gone.key", "the key .*gone.key that .* names cannot be read: No such file", LOOK),
        ("open.key", "the key .*open.key: others on this computer may read it .* chmod 600", LOOK),
        ("cut.key", "cut.key, which GLOVECAL_ENCRYPTION_KEY_FILE names, is no key of Glovecal", LOOK),
        ("data/inside.key", "lies inside the data folder .* move it elsewhere", LOOK),
    ],
)
def test_without_the_right_key_one_sentence_and_nothing_changes(
    used: Place, key: str, sentence: str, verb: tuple[str, ...]
) -> None:
    for name in ("other.key", "open.key"):
        if not (used.folder / name).exists():
            make_key_file(used.folder / name)
    (used.folder / "open.key").chmod(0o640)
    (used.folder / "cut.key").write_text(used.key.read_text()[:-9])
    (used.folder / "cut.key").chmod(0o600)
    inside = used.data / "inside.key"
    inside.write_bytes(used.key.read_bytes())
    inside.chmod(0o600)
    before = used.files()
    place = str(used.folder / key) if key else ""
    done = used.run(*verb, **{KEY_FILE: place, "GLOVECAL_URL": ""})
    assert done.returncode == 1
    said = " ".join(done.stderr.split())
    assert re.search(sentence.replace(" .* ", " .*"), said), said
    assert "Traceback" not in said
    after = used.files()
    inside.unlink()
    changed = {name for name in before | after if before.get(name) != after.get(name)}
    assert not {name for name in changed if not name.endswith(("/lock", "service.lock", "service.txt"))}


def test_a_key_is_never_overwritten_nor_made_in_the_data_folder(used: Place) -> None:
    before = used.key.read_bytes()
    again = used.run("encryption", "make-key", str(used.key))
    assert again.returncode == 1
    assert "is not overwritten" in " ".join(again.stderr.split())
    assert used.key.read_bytes() == before
    inside = used.run("encryption", "make-key", str(used.data / "new.key"))
    assert inside.returncode == 1
    assert not (used.data / "new.key").exists()


# What was there before the key.


def filled(data: Path) -> dict[Path, bytes]:
    """Plain files of each kind, and what they hold."""
    settings = Settings(data=data)
    with Store.open(settings) as store:
        for number in range(20):
            store.artifacts.put(Random(number).randbytes(300_000))
    for folder, suffix in (
        ("uploads", ""),
        ("videos", ".zip"),
        ("films", ".mkv"),
        ("cameras/kept", ".labels"),
    ):
        for number in range(5):
            file = data / folder / (f"{number:064x}{suffix}")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(os.urandom(200_000))
    logs = data / "capture" / "lab" / "g1"
    logs.mkdir(parents=True)
    for number in range(5):
        log = FrameLog.create(logs / f"{number}.glvlog", {"n": number})
        for record in range(200):
            log.append(b"%d" % record)
        log.close()
    with (logs / "4.glvlog").open("ab") as file:
        file.write(b"half a record")
    named = [
        path for path in data.rglob("*") if path.is_file() and path.suffix in ("", ".zip", ".mkv", ".labels")
    ]
    return {
        path: path.read_bytes() for path in named if path.name != KEY_ID_FILE and path.stat().st_size > 1000
    }


def test_what_was_there_is_encrypted_also_by_one_that_is_killed_again_and_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = tmp_path / "data"
    held = filled(data)
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    apply = "from pathlib import Path; import sys\nfrom glovecal_service.settings import Settings\n"
    apply += "from glovecal_service.store.encrypt_folder import encrypt_folder\n"
    apply += "encrypt_folder(Settings(data=Path(sys.argv[1])), lambda file: print(file, flush=True))"
    for files in (1, 3, 9):
        process = subprocess.Popen(
            [sys.executable, "-c", apply, str(data)], stdout=subprocess.PIPE, text=True
        )
        assert process.stdout is not None
        for _ in range(files):
            process.stdout.readline()
        process.kill()
        process.communicate(timeout=60)
        assert {path: read_kept(path) for path in held} == held
    done = encrypt_folder(Settings(data=data))
    assert done.problems == []
    assert 0 < done.files < len(held)
    assert all(is_kept_encrypted(path) for path in held)
    assert {path: read_kept(path) for path in held} == held
    for log in (data / "capture" / "lab" / "g1").glob("*.glvlog"):
        assert is_kept_encrypted(log)
        assert len(list(Recording.open(log).payloads())) == 200
        resumed = FrameLog.resume(log)
        resumed.append(b"more")
        resumed.close()
        assert len(list(Recording.open(log).payloads())) == 201
    assert encrypt_folder(Settings(data=data)).files == 0
    with Store.open(Settings(data=data)) as store:
        assert all(store.artifacts.is_sound(path.name) for path in held if path.parent.name == "artifacts")


def test_a_data_folder_remembers_its_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert settle_encryption(tmp_path / "data") is None
    key = make_key_file(tmp_path / "disk.key")
    monkeypatch.setenv(KEY_FILE, str(key.file))
    assert settle_encryption(tmp_path / "data") == key
    assert (tmp_path / "data" / KEY_ID_FILE).read_text().strip() == key.id.hex()
    assert key.secret.hex() not in repr(key)
    monkeypatch.delenv(KEY_FILE)
    with pytest.raises(BadEncryptionKey, match="Nothing was changed"):
        settle_encryption(tmp_path / "data")


async def whole(content: bytes) -> AsyncIterator[bytes]:
    yield content


@pytest.mark.parametrize("in_memory", [True, False])
def test_an_encrypted_upload_is_read_by_path_and_does_not_lie_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_memory: bool
) -> None:
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    if not in_memory:
        monkeypatch.setattr(upload_folder, "memory_file", lambda: None)
    here = SharedFiles(Database(f"sqlite:///{tmp_path / 'none'}"), None, tmp_path)
    uploads, content = UploadFolder(here), TABLE.encode()
    upload = anyio.run(uploads.receive, whole(content))
    assert upload.sha256 == hashlib.sha256(content).hexdigest()
    assert is_kept_encrypted(upload.path)
    with uploads.under_names(("my table.csv", upload.path)) as [named]:
        assert (named.name, named.read_bytes(), named.stat().st_size) == (
            "my table.csv",
            content,
            len(content),
        )
        plain = [path for path in uploads.folder.rglob("*") if path.is_file() and not path.is_symlink()]
        assert [path for path in plain if b"time_s" in path.read_bytes()] == ([] if in_memory else [named])
    assert list(uploads.folder.iterdir()) == [upload.path]


def test_an_encrypted_artifact_has_the_name_of_its_content_and_no_damage_is_missed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    artifacts, content = Artifacts(FolderBlobs(tmp_path / "artifacts")), b"of somebody" * 9
    name = artifacts.put(content)
    assert name == hashlib.sha256(content).hexdigest()
    file = tmp_path / "artifacts" / name
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    assert artifacts.get(name) == content
    assert artifacts.put(content) == name
    sealed = file.read_bytes()
    assert b"somebody" not in sealed
    assert artifacts.get(name) == content
    for at in range(len(sealed)):
        for damaged in (sealed[:at], sealed[:at] + bytes([sealed[at] ^ 4]) + sealed[at + 1 :]):
            file.write_bytes(damaged)
            with pytest.raises((DamagedArtifact, BadEncryptionKey), match=name):
                artifacts.get(name)
    file.write_bytes(sealed[:-1])
    assert artifacts.put(content) == name
    assert artifacts.get(name) == content


def test_results_of_fits_are_encrypted_by_whoever_keeps_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A worker knows no key: what it found comes back over TLS."""
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    fits = tmp_path / "fits"
    fits.mkdir()
    FinishedTasks(fits).put("0" * 16, TaskResult({}, {"done": True}))
    assert [is_kept_encrypted(file) for file in fits.glob("*.safetensors")] == [True]
