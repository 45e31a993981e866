"""Uploads, videos, films and ledgers of two services that have one object store, a real S3 server."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from filled_store import META
from s3_server import BUCKET, S3Server
from sqlalchemy import text
from stored_takes import LAYOUT, make_take

from glovecal_client import Frame, FrameLog, encode_frame
from glovecal_client.encryption.kept_file import create_whole, finish_file, is_kept_encrypted, read_kept
from glovecal_client.encryption.key_file import KEY_FILE, make_key_file
from glovecal_client.pictures.video_file import ABOUT, picture_name
from glovecal_models.errors import DamagedArtifact
from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_service.settings import Settings
from glovecal_service.store import Store, shared_files
from glovecal_service.store.backup import make_backup, restore_backup
from glovecal_service.store.erasure import erase
from glovecal_service.store.errors import StoreUnavailable
from glovecal_service.store.object_blobs import ObjectBlobs
from glovecal_service.store.retention import send_files, sweep
from glovecal_service.store.subject_archive import SubjectArchive
from glovecal_service.store.take_file import Videos

TABLE = b"time_s,take,s.I_MCP\n" * 5000
NAME = hashlib.sha256(TABLE).hexdigest()
HOUR_S = 3600.0


@dataclass
class Service:
    settings: Settings
    store: Store

    def put(self, file: str, content: bytes, ago_s: float = 0.0) -> Path:
        """As the service itself writes a file that is complete, encrypted where there is a key."""
        path = self.settings.data / file
        path.parent.mkdir(exist_ok=True)
        path.unlink(missing_ok=True)
        with create_whole(path) as kept:
            kept.write(content)
            finish_file(kept)
        at = path.stat().st_mtime - ago_s
        os.utime(path, (at, at))
        return path

    def send(self) -> int:
        return send_files(self.store, self.settings)

    def read(self, file: str) -> bytes | None:
        found = self.store.files.find(file)
        return None if found is None else read_kept(found)


@dataclass
class TwoServices:
    here: Service
    there: Service
    objects: S3Server

    def kept(self) -> dict[str, bytes]:
        """Files in the object store, as they lie there."""
        folder = self.objects.folder / BUCKET / "site" / "files"
        return {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }


@pytest.fixture
def both(tmp_path: Path, s3_server: S3Server, monkeypatch: pytest.MonkeyPatch) -> Iterator[TwoServices]:
    for name, value in s3_server.environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(shared_files, "LOOK_AGAIN_AFTER_S", 0.0)
    database = f"sqlite:///{tmp_path / 'one.sqlite3'}"
    here, there = (
        Settings(data=tmp_path / name, database=database, artifacts=f"s3://{BUCKET}/site")
        for name in ("here", "there")
    )
    with Store.open(here) as first, Store.open(there) as second:
        yield TwoServices(Service(here, first), Service(there, second), s3_server)


def test_what_one_service_got_the_other_reads_bit_exact_also_while_the_store_is_away(
    both: TwoServices,
) -> None:
    assert both.there.read(f"uploads/{NAME}") is None
    both.here.put(f"uploads/{NAME}", TABLE)
    assert (both.here.send(), both.here.store.files.waiting) == (1, "")
    assert both.there.read(f"uploads/{NAME}") == TABLE
    assert not (both.there.settings.uploads_folder / NAME).exists(), "it lies in the cache"
    both.objects.halt()
    try:
        assert both.there.read(f"uploads/{NAME}") == TABLE
        assert both.here.read(f"uploads/{NAME}") == TABLE
    finally:
        both.objects.go_on()


def test_what_cannot_be_sent_waits_and_is_told(both: TwoServices) -> None:
    both.objects.kill()
    both.here.put(f"uploads/{NAME}", TABLE)
    assert both.here.send() == 0
    assert both.here.store.files.waiting == (
        f"1 file of the data folder not sent yet to s3://{BUCKET}/site: other services cannot read them "
        "until it has room and answers"
    )
    assert both.here.read(f"uploads/{NAME}") == TABLE
    both.objects.start()
    sent = []
    while not any(sent):  # until it is seen to answer again
        sent.append(both.here.send())
    assert both.here.store.files.waiting == ""
    both.objects.kill()
    with pytest.raises(StoreUnavailable, match="does not answer"):
        both.there.read(f"uploads/{NAME}")


def test_what_was_changed_in_the_object_store_is_refused(both: TwoServices) -> None:
    both.here.put(f"uploads/{NAME}", TABLE)
    both.here.send()
    kept = both.objects.folder / BUCKET / "site" / "files" / "uploads" / NAME
    kept.write_bytes(TABLE.replace(b"take", b"fake"))
    with pytest.raises(DamagedArtifact, match=f"uploads/{NAME} .* is not what was written"):
        both.there.read(f"uploads/{NAME}")


def test_encrypted_here_it_is_encrypted_there(
    both: TwoServices, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    both.here.put(f"uploads/{NAME}", TABLE)
    both.here.send()
    assert both.there.read(f"uploads/{NAME}") == TABLE
    assert b"I_MCP" not in both.kept()[f"uploads/{NAME}"]
    assert is_kept_encrypted(both.there.store.files.find(f"uploads/{NAME}") or Path())


def test_the_video_that_was_attached_last_is_shown_by_both(both: TwoServices, tmp_path: Path) -> None:
    take = both.here.store
    take.subjects.create("anna")
    take.layouts.put(LAYOUT)
    id = take.takes.add(make_take(1), subject="anna", layout=LAYOUT.name, source="import").id
    both.here.put(f"videos/{id}.zip", preview(tmp_path, 2), ago_s=-HOUR_S)  # its clock is ahead
    assert both.here.send() == 1
    videos = [Videos(each.store.files) for each in (both.here, both.there)]
    assert [each.takes() for each in videos] == [[id], [id]]
    assert [len(each.facts(id).times_s) for each in videos] == [2, 2]
    (tmp_path / "new.zip").write_bytes(preview(tmp_path, 5))
    videos[1].attach(id, tmp_path / "new.zip")
    assert both.there.send() == 1
    assert [len(each.facts(id).times_s) for each in videos] == [5, 5]
    both.here.send()
    assert not (both.here.settings.videos_folder / f"{id}.zip").exists(), "the old one"
    assert len(videos[0].facts(id).times_s) == 5


def preview(folder: Path, pictures: int) -> bytes:
    times_s = [100.0 + number for number in range(pictures)]
    about = {"source": "camera:0", "simulated": False, "computer": "lab-pc", "times_s": times_s}
    with zipfile.ZipFile(folder / "made.zip", "w") as archive:
        archive.writestr(ABOUT, json.dumps(about))
        for number in range(pictures):
            archive.writestr(picture_name(number), b"\xff\xd8\xff" + bytes(number))
    return (folder / "made.zip").read_bytes()


@dataclass
class Anna:
    """All kinds of files of hers."""

    ledger: str
    content: bytes
    files: set[str]


@pytest.fixture
def anna(both: TwoServices, tmp_path: Path) -> Anna:
    store = both.here.store
    store.subjects.create("anna")
    store.layouts.put(LAYOUT)
    take = store.takes.add(
        make_take(1), subject="anna", layout=LAYOUT.name, source="import", original_sha256=NAME
    )
    store.gloves.seen("left", META)
    recording = store.recordings.request("left", name="walk", subject="anna", wearing="w")
    ledger = f"recordings/{recording.id}.glog"
    log = FrameLog.create(both.here.settings.data / ledger, {})
    for number in range(300):
        log.append(encode_frame(Frame(number, 1, number, number, np.full(18, number, np.float32))))
    log.close()
    content = log.path.read_bytes()
    at = log.path.stat().st_mtime - 2 * HOUR_S
    os.utime(log.path, (at, at))
    store.recordings.update(recording.id, state="done", sent=300, missing=0)
    both.here.put(f"uploads/{NAME}", TABLE)
    both.here.put(f"videos/{take.id}.zip", preview(tmp_path, 2))
    film = {
        "films/hers.mkv": b"moving pictures",
        "films/hers.json": json.dumps({"computer": "lab-pc"}).encode(),
        "films/hers.times.csv": b"frame,monotonic_ns,wall_ns\n0,99000000000,0\n1,102000000000,0\n",
    }
    for file, part in film.items():
        both.here.put(file, part)
    return Anna(ledger, content, {ledger, f"uploads/{NAME}", f"videos/{take.id}.zip", *film})


def test_a_settled_recording_is_packed_sent_and_read_elsewhere_as_it_came(
    both: TwoServices, anna: Anna
) -> None:
    both.here.send()
    assert anna.ledger not in both.kept(), "it is sent once it is packed"
    assert sweep(both.here.store, both.here.settings).packed == 1
    both.here.send()
    assert set(both.kept()) == anna.files
    assert len(both.kept()[anna.ledger]) < len(anna.content) / 5
    assert both.there.read(anna.ledger) == anna.content


@pytest.mark.parametrize("is_encrypted", [False, True])
def test_a_frame_of_18_sensors_takes_a_seventh_at_rest(
    both: TwoServices, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_encrypted: bool
) -> None:
    """A simulated CyberGlove at 120 Hz, with the jitter of a computer's clock."""
    if is_encrypted:
        monkeypatch.setenv(KEY_FILE, str(make_key_file(tmp_path / "disk.key").file))
    glove = SimulatedGlove(1, "cyberglove18")
    readings = simulate_take(glove, segments("evaluation", 1), rate_hz=120, name="t").take.readings
    random = np.random.default_rng(0)
    at_ns = np.cumsum(random.normal(1e9 / 120, 2e5, len(readings))).astype(int)
    both.here.store.gloves.seen("left", META)
    recording = both.here.store.recordings.request("left", name="walk", subject=None, wearing="w")
    ledger = f"recordings/{recording.id}.glog"
    log = FrameLog.create(both.here.settings.data / ledger, {})
    for number, (at, row) in enumerate(zip(at_ns, readings, strict=True)):
        frame = Frame(number, 1, int(at), int(at + 1.7e18 + random.normal(0, 300)), row.astype(np.float32))
        log.append(encode_frame(frame))
    log.close()
    content = read_kept(log.path)
    long_ago = log.path.stat().st_mtime - 2 * HOUR_S
    os.utime(log.path, (long_ago, long_ago))
    both.here.store.recordings.update(recording.id, state="done", sent=len(readings), missing=0)
    sweep(both.here.store, both.here.settings)
    both.here.send()
    size = len(both.kept()[ledger]) / len(readings)
    print(f"{len(readings)} frames: {len(content) / len(readings):.1f} bytes each, {size:.2f} kept")
    assert size < 40
    assert both.there.read(ledger) == content


def test_the_other_service_exports_all_of_it(both: TwoServices, anna: Anna, tmp_path: Path) -> None:
    sweep(both.here.store, both.here.settings)
    both.here.send()
    archives = []
    for service in (both.here, both.there):
        file = tmp_path / f"{service.settings.data.name}.zip"
        file.write_bytes(b"".join(SubjectArchive(service.store, "anna").parts()))
        with zipfile.ZipFile(file) as archive:
            assert json.loads(archive.read("manifest.json"))["problems"] == []
            names = [name for name in archive.namelist() if not name.endswith((".json", ".jsonl", ".txt"))]
            archives.append({name: archive.read(name) for name in names} | {"about": archive.namelist()})
    assert archives[0] == archives[1]
    assert anna.content in archives[1].values()
    assert {"films/hers.mkv", f"originals/{NAME}"} <= set(archives[1])


def test_erased_at_one_service_it_is_gone_from_the_other_and_from_the_object_store(
    both: TwoServices, anna: Anna
) -> None:
    sweep(both.here.store, both.here.settings)
    both.here.send()
    assert both.there.read(anna.ledger) == anna.content
    [take] = both.here.store.takes.list("anna")
    assert both.there.store.takes.load(take.id).name == take.name
    assert erase(both.there.store, both.there.settings, "anna").is_finished
    assert both.kept() == {}
    both.here.send()
    for service in (both.here, both.there):
        left = [path for path in service.settings.data.rglob("*") if path.is_file() and path.suffix != ".id"]
        names = (*anna.files, take.artifact)
        hers = [path for path in left if any(path.as_posix().endswith(name) for name in names)]
        assert hers == []
        assert [service.read(file) for file in anna.files] == [None] * len(anna.files)


def test_erased_while_it_is_sent_it_does_not_come_back(
    both: TwoServices, anna: Anna, monkeypatch: pytest.MonkeyPatch
) -> None:
    send_file = ObjectBlobs.send_file

    def send_and_erase(objects: ObjectBlobs, name: str, file: Path) -> None:
        send_file(objects, name, file)
        if "videos/" in name:
            erase(both.there.store, both.there.settings, "anna")

    monkeypatch.setattr(ObjectBlobs, "send_file", send_and_erase)
    both.here.send()
    both.here.send()
    assert not [file for file in both.kept() if "videos" in file]


def test_a_damaged_row_is_named_and_stops_no_other(both: TwoServices) -> None:
    for file in (f"uploads/{NAME}", f"uploads/{'0' * 64}"):
        both.here.put(file, TABLE)
    both.here.send()
    with both.here.store.database.write() as connection:
        connection.execute(text("UPDATE shared_files SET size_bytes = 7 WHERE file LIKE '%0000'"))
    assert both.there.store.files.names("uploads/") == [f"uploads/{NAME}"]
    assert both.there.read(f"uploads/{NAME}") == TABLE
    found = [damage.sentence for some in both.there.store.damages.search() for damage in some]
    assert len(found) == 1
    assert "shared_files was changed after it was written" in found[0]


def test_erased_before_it_was_sent_it_is_not_sent_any_more(both: TwoServices, anna: Anna) -> None:
    erase(both.there.store, both.there.settings, "anna")
    sweep(both.here.store, both.here.settings)
    both.here.send()
    assert not [file for file in both.kept() if not file.startswith("films/")]  # these do not say whose
    assert not (both.here.settings.data / anna.ledger).exists()


def test_what_is_forgotten_after_its_days_goes_everywhere(both: TwoServices) -> None:
    both.here.put(f"uploads/{NAME}", TABLE, ago_s=100 * 24 * HOUR_S)
    both.here.send()
    assert both.there.read(f"uploads/{NAME}") == TABLE
    assert sweep(both.here.store, both.here.settings).files == 1
    assert both.kept() == {}
    assert both.there.read(f"uploads/{NAME}") is None
    both.there.put(f"uploads/{NAME}", TABLE)
    assert both.there.send() == 1, "it came once more"
    assert both.here.read(f"uploads/{NAME}") == TABLE


def test_a_backup_at_one_service_holds_what_the_other_has(
    both: TwoServices, anna: Anna, tmp_path: Path
) -> None:
    sweep(both.here.store, both.here.settings)
    both.here.send()
    made = make_backup(both.there.store, both.there.settings, tmp_path / "all.backup")
    assert made.problems == ()
    restored = Settings(data=tmp_path / "new", database=None, artifacts=f"s3://{BUCKET}/other")
    restore_backup(tmp_path / "all.backup", restored)
    with Store.open(restored) as store:
        service = Service(restored, store)
        assert service.read(anna.ledger) == anna.content
        assert {file for file in anna.files if service.read(file) is None} == set()
        assert service.send() == len(anna.files) - 1, "the ledger was written a moment ago"
