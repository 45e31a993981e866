"""A take's video over REST: its pictures; another clock, another time and wrong files are refused."""

from __future__ import annotations

import json
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.clock import computer_id
from glovecal_client.pictures.recording import VideoRecording
from glovecal_client.pictures.source import RenderedPictures
from glovecal_client.pictures.video_file import write_preview
from glovecal_client.rest import Refused, RestClient
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def preview(tmp_path_factory: pytest.TempPathFactory) -> Path:
    film = tmp_path_factory.mktemp("film") / "fist.mkv"
    with VideoRecording(RenderedPictures(), film) as video:
        time.sleep(0.6)
    return write_preview(film, json.loads(video.describe().read_text()))


def times_s(preview: Path) -> list[float]:
    with zipfile.ZipFile(preview) as file:
        return json.loads(file.read("video.json"))["times_s"]


LAYOUT = Layout.built_in("cyberglove18")
Add = Callable[..., str]


@pytest.fixture
def add(client: RestClient, settings: Settings, preview: Path) -> Add:
    """A recorded take beside the video, by default of its computer and time; its id."""
    client.post("/subjects", {"name": "anna"})

    def add(computer: str | None = None, later_s: float = 0.0) -> str:
        at = times_s(preview)
        time_s = np.arange(at[0] - 0.2, at[-1] + 0.2, 1 / 60) + later_s
        readings = np.full((len(time_s), len(LAYOUT.sensors)), 100.0) + np.arange(len(time_s))[:, None]
        take = Take("fist", "w", LAYOUT.sensors, time_s, readings)
        with Store.open(settings) as store:
            return store.takes.add(
                take, subject="anna", layout=LAYOUT.name, source="recording",
                accounting={"computer": computer or computer_id()},
            ).id  # fmt: skip

    return add


def test_pictures_are_as_they_were_sent(client: RestClient, preview: Path, add: Add) -> None:
    take = add()
    answer = client.put(f"/videos/{take}", {"upload": client.upload(preview)})
    assert answer["simulated"] is True
    assert answer["sentence"].startswith(f"{len(answer['times_s'])} pictures drawn")
    assert [one["take"] for one in client.get("/videos", {"subject": "anna"})] == [take]
    with zipfile.ZipFile(preview) as file:
        assert client.download(f"/videos/{take}/pictures/2") == file.read("000002.jpg")
    with pytest.raises(Refused, match="no picture 900"):
        client.download(f"/videos/{take}/pictures/900")


def test_another_clock_and_another_time_are_refused(client: RestClient, preview: Path, add: Add) -> None:
    upload = client.upload(preview)
    with pytest.raises(Refused, match="another computer's clock"):
        client.put(f"/videos/{add('0' * 16)}", {"upload": upload})
    with pytest.raises(Refused, match="no moment in common"):
        client.put(f"/videos/{add(later_s=1000.0)}", {"upload": upload})
    with pytest.raises(Refused, match="has no video"):
        client.get(f"/videos/{add(later_s=2000.0)}")


def changed(preview: Path, path: Path, **change: object) -> Path:
    """A copy with other times, another picture, an entry more, or compression."""
    with zipfile.ZipFile(preview) as old, zipfile.ZipFile(path, "w") as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename == "video.json" and "times" in change:
                content = json.dumps({**json.loads(content), "times_s": change["times"]}).encode()
            if entry.filename == "000001.jpg" and "picture" in change:
                content = bytes(str(change["picture"]), "ascii")
            method = zipfile.ZIP_DEFLATED if change.get("packed") else zipfile.ZIP_STORED
            new.writestr(entry.filename, content, method)
        if "more" in change:
            new.writestr(str(change["more"]), b"\xff\xd8\xff")
    return path


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"times": [3.0, 2.0]}, "must increase"),
        ({"times": [1.0]}, "one a time"),
        ({"times": ["x"]}, r"times_s\.0"),
        ({"picture": "<script>"}, "no JPEG"),
        ({"more": "../evil.jpg"}, "one a time"),
        ({"packed": True}, "compressed"),
    ],
)
def test_wrong_files_are_named(
    client: RestClient, preview: Path, add: Add, tmp_path: Path, change: dict[str, object], says: str
) -> None:
    wrong = changed(preview, tmp_path / "wrong.zip", **change)
    with pytest.raises(Refused, match=says):
        client.put(f"/videos/{add()}", {"upload": client.upload(wrong)})


def test_what_is_no_preview_is_refused(client: RestClient, preview: Path, add: Add, tmp_path: Path) -> None:
    take = add()
    for content in (b"x", b"PK\x03\x04 and then nothing", preview.read_bytes()[:2000]):
        (tmp_path / "no.zip").write_bytes(content)
        with pytest.raises(Refused, match="no preview of a video"):
            client.put(f"/videos/{take}", {"upload": client.upload(tmp_path / "no.zip")})
    assert client.get("/videos") == []
