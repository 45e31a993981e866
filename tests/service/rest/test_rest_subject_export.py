"""All that is kept of a subject as one file: whole, with its manifest, without others, never half."""

from __future__ import annotations

import hashlib
import io
import json
import sys
import tracemalloc
import zipfile
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from anyio.from_thread import start_blocking_portal
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import StreamingResponse
from starlette.routing import Route

sys.path.insert(0, str(Path(__file__).parents[1]))

from filled_store import fill
from stored_takes import LAYOUT, make_take

from glovecal_client.pictures.video_file import ABOUT, picture_name
from glovecal_client.rest import NoService, RestClient
from glovecal_service.rest.in_process import PortalTransport, in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store
from glovecal_service.store.subject_archive import SubjectArchive
from glovecal_service.store.take_file import load_take

GLOG = b"frames as they came"
ORIGINAL = b"time_s,I_MCP\n0,1\n"


@pytest.fixture
def filled(settings: Settings) -> Iterator[Store]:
    with Store.open(settings) as store:
        fill(store)
        yield store


def put(file: Path, content: bytes) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(content)
    return file


def film(settings: Settings, name: str, computer: str, times_s: list[float]) -> None:
    put(settings.films_folder / f"{name}.mkv", b"moving pictures")
    put(settings.films_folder / f"{name}.json", json.dumps({"computer": computer}).encode())
    rows = [f"{number},{round(at * 1e9)},0" for number, at in enumerate(times_s)]
    lines = "\n".join(["frame,monotonic_ns,wall_ns", *rows])
    put(settings.films_folder / f"{name}.times.csv", lines.encode())


def video(settings: Settings, take: str, computer: str, times_s: list[float]) -> None:
    about = {"source": "camera:0", "simulated": False, "computer": computer, "times_s": times_s}
    file = put(settings.videos_folder / f"{take}.zip", b"")
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr(ABOUT, json.dumps(about))
        for number in range(len(times_s)):
            archive.writestr(picture_name(number), b"\xff\xd8\xff")


def exported(settings: Settings, file: Path, name: str = "anna") -> zipfile.ZipFile:
    with in_process_client(settings) as client:
        client.save(f"/subjects/{name}/export", file)
    return zipfile.ZipFile(file)


def test_everything_of_a_subject_is_in_it_and_nothing_of_others(
    filled: Store, settings: Settings, tmp_path: Path
) -> None:
    original = hashlib.sha256(ORIGINAL).hexdigest()
    put(settings.uploads_folder / original, ORIGINAL)
    take = filled.takes.add(
        make_take(7, "given"), subject="anna", layout=LAYOUT.name, source="import", original_sha256=original
    )
    late = make_take(7).reference_time_s + 0.01
    filled.takes.attach_reference(take.id, late, ("I_MCP",), make_take(7).reference[:, :1])
    others = filled.takes.add(make_take(8, "ben's"), subject="ben", layout=LAYOUT.name, source="import")
    recording = filled.recordings.list()[-1]
    put(settings.recordings_folder / f"{recording.id}.glog", GLOG)
    video(settings, take.id, "lab-pc", [100.0, 101.0])
    video(settings, others.id, "lab-pc", [500.0, 501.0])
    film(settings, "hers", "lab-pc", [99.0, 102.0])
    film(settings, "later", "lab-pc", [499.0, 502.0])
    film(settings, "elsewhere", "other-pc", [99.0, 102.0])
    filled.gloves.assign("left", "ben")
    filled.gloves.assign("left", "anna", "w")
    with exported(settings, tmp_path / "anna.zip") as archive:
        names = set(archive.namelist())
        manifest = json.loads(archive.read("manifest.json"))
        assert {row["name"] for row in manifest["files"]} == names - {"manifest.json"}
        for row in manifest["files"]:
            content = archive.read(row["name"])
            assert (len(content), hashlib.sha256(content).hexdigest()) == (row["bytes"], row["sha256"]), row
        assert manifest["problems"] == []
        loaded = load_take(archive.read(f"takes/{take.id}/take-1.safetensors"))
        assert loaded.rotations == ("I_MCP",)
        assert load_take(archive.read(f"takes/{take.id}/take-2.safetensors")).rotations == LAYOUT.sensors
        assert archive.read(f"originals/{original}") == ORIGINAL
        assert archive.read(f"recordings/{recording.id}/{recording.id}.glog") == GLOG
        assert f"takes/{take.id}/video.zip" in names
        assert {name for name in names if name.startswith("films/")} == {
            "films/hers.mkv", "films/hers.json", "films/hers.times.csv",
        }  # fmt: skip
        models = filled.models.list("anna")
        assert archive.read(f"models/{models[0].id}/model.safetensors") == b"one"
        assert len(json.loads(archive.read("activations.json"))) == 2
        assert {one["wearing"] for one in json.loads(archive.read("wearings.json"))} == {"first", "w"}
        assert [one["name"] for one in json.loads(archive.read("gloves.json"))] == ["left"]
        assert len([name for name in names if name.startswith("jobs/")]) == 3
        job = next(
            archive.read(name) for name in names if name.startswith("jobs/") and b"1.25" in archive.read(name)
        )
        assert json.loads(job)["steps"][-1]["state"] == "done"
        assert len([name for name in names if name.startswith("samplings/")]) == 1
        audit = [json.loads(line) for line in archive.read("audit.jsonl").splitlines()]
        tables = {change["table"] for entry in audit for change in entry["changes"]}
        assert {"subjects", "takes", "models", "activations", "recordings", "samplings", "jobs"} <= tables
        worn = [change for entry in audit for change in entry["changes"] if change["table"] == "gloves"][-1]
        assert worn["before"]["subject"] == "another person"
        readme = archive.read("README.txt").decode()
        assert all(name.split("/")[0] in readme for name in names - {"README.txt"})
        everything = b"".join(archive.read(name) for name in names)
    assert b"ben" not in everything
    assert others.id.encode() not in everything


def test_what_is_damaged_is_named_and_the_rest_is_there(
    filled: Store, settings: Settings, tmp_path: Path
) -> None:
    take = filled.takes.list("anna")[0]
    (settings.artifacts_folder / take.artifact).write_bytes(b"spoiled")
    with exported(settings, tmp_path / "anna.zip") as archive:
        manifest = json.loads(archive.read("manifest.json"))
        assert manifest["problems"] == [
            f"{take.artifact} is missing or damaged: what is here of it is not whole"
        ]
        other = filled.takes.list("anna")[1]
        assert load_take(archive.read(f"takes/{other.id}/take-1.safetensors")).name == other.name


def test_a_recording_of_any_length_takes_no_more_memory(filled: Store, settings: Settings) -> None:
    with (settings.recordings_folder / f"{filled.recordings.list()[-1].id}.glog").open("wb") as file:
        file.truncate(300_000_000)
    tracemalloc.start()
    try:
        size = sum(map(len, SubjectArchive(filled, "anna").parts()))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert size > 300_000_000
    assert peak < 16_000_000


def test_over_http_it_is_a_file_to_save(filled: Store, settings: Settings) -> None:
    with in_process_client(settings) as client:
        content = client.download("/subjects/anna/export")
        with pytest.raises(Exception, match="no subject 'nobody'"):
            client.download("/subjects/nobody/export")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None


def test_one_that_breaks_off_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    async def half() -> AsyncIterator[bytes]:
        yield b"half"
        raise RuntimeError

    async def answer(request: Request) -> StreamingResponse:
        return StreamingResponse(half())

    app = Starlette(routes=[Route("/v1/subjects/anna/export", answer)])
    file = put(tmp_path / "anna.zip", b"the one before")
    with start_blocking_portal() as portal:
        client = RestClient("http://localhost", transport=PortalTransport(app, portal))
        with client, pytest.raises(NoService, match="broke"):
            client.save("/subjects/anna/export", file)
    assert file.read_bytes() == b"the one before"
    assert list(tmp_path.iterdir()) == [file]
