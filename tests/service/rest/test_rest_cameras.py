"""Cameras over REST: started in processes of their own, listed wherever they were started, ended."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from phone_videos import phone_video

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.importorskip("cv2")
pytest.importorskip("numba")

from camera_support import SMALL, ready_folder
from realtime_support import eventually, free_endpoint

from glovecal_client.keys import GloveKeys
from glovecal_client.rest import Refused, RestClient
from glovecal_client.session import open_router
from glovecal_models.colour_glove.camera_model import write_cameras
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.pose.window_view import PrintedHand
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_service.camera.tracking_setup import ASSUMED, RenderedGlove
from glovecal_service.rest.glove.cameras import said_of_itself
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(data=tmp_path_factory.mktemp("cameras") / "data", zenoh=free_endpoint())


@pytest.fixture(scope="module")
def client(settings: Settings) -> Iterator[RestClient]:
    with in_process_client(settings) as client:
        yield client


def keep_camera_files(client: RestClient, folder: Path, learned: Path) -> None:
    """A table ``lamp`` and a calibration ``desk``; what is neither is refused and changes nothing."""
    table, calibration = folder / "table.npz", folder / "camera.json"
    shutil.copy(next(learned.glob("colours-*.npz")), table)
    write_cameras(calibration, [ASSUMED])
    known = client.put("/camera-files/colours/lamp", {"upload": client.upload(table)})
    assert known == {"colours": ["lamp"], "calibrations": []}
    client.put("/camera-files/calibrations/desk", {"upload": client.upload(calibration)})
    for kind, file in (("colours", calibration), ("calibrations", table)):
        with pytest.raises(Refused):
            client.put(f"/camera-files/{kind}/other", {"upload": client.upload(file)})
    for name in ("../desk", "Desk", ".desk", "a" * 65):
        with pytest.raises(Refused):
            client.put(f"/camera-files/colours/{name}", {"upload": client.upload(table)})
        with pytest.raises(Refused):
            client.post("/cameras", {"glove": "x", "source": "rendered", "calibration": name})
    with pytest.raises(Refused, match="send the file to /v1/uploads first"):
        client.put("/camera-files/colours/lamp", {"upload": "0" * 64})
    assert client.get("/camera-files") == {"colours": ["lamp"], "calibrations": ["desk"]}


def test_a_camera_from_its_start_to_its_end(client: RestClient, settings: Settings, tmp_path: Path) -> None:
    ready_folder(settings.data)
    assert client.get("/cameras") == []
    with open_router([settings.zenoh]):
        body: dict[str, Any] = {"glove": "right", "source": "rendered", "stage": "ik", "keep": "nothing"}
        body |= {"colours": "lamp", "calibration": "desk"}
        with pytest.raises(Refused, match="no colours 'lamp'; there are: none yet"):
            client.post("/cameras", body)
        keep_camera_files(client, tmp_path, settings.data / "cameras")
        begun = client.post("/cameras", body | SMALL)
        assert (begun["state"], begun["is_simulated"], begun["started_here"]) == ("opening", True, True)
        with pytest.raises(Refused, match="publishes glove right already"):
            client.post("/cameras", body)

        def tracking() -> dict[str, Any] | None:
            found = client.get("/cameras/right")
            return found if found["health"] and found["health"]["tracked"] >= 3 else None

        camera = eventually(tracking, "it tracks")
        assert client.get("/cameras")[0]["glove"] == "right"
        health = camera["health"]
        assert health["simulated"]
        assert health["calibrated"]
        assert health["latency_ms"]["p95"] >= health["latency_ms"]["p50"] > 0
        assert len(health["rotations"]) == 20
        chosen = client.put("/cameras/right/stage", {"stage": "nearest"})
        assert chosen["health"]["stage"] == "nearest"
        balanced = client.post("/cameras/right/balance")
        assert set(balanced["health"]["gains"]) == {"red", "green", "blue"}
        with pytest.raises(Refused, match="stage"):
            client.put("/cameras/right/stage", {"stage": "best"})
        picture = client.download("/cameras/right/picture", {"layers": "model", "width": 64})
        assert picture.startswith(b"\xff\xd8\xff")
        ended = client.post("/cameras/right/stop")
        assert ended["state"] == "stopped"
        assert ended["sentence"].startswith("run ")
        assert ended["sentence"].endswith("; stopped")
        assert client.get("/cameras/right")["health"] is None
        with pytest.raises(Refused, match="no camera of glove right answers"):
            client.download("/cameras/right/picture")
    with pytest.raises(Refused, match="no camera of glove other"):
        client.post("/cameras/other/stop")
    for source in ("video:/etc/passwd", "labels:/etc/passwd", "camera:100"):
        with pytest.raises(Refused):
            client.post("/cameras", {"glove": "x", "source": source})
    with pytest.raises(Refused, match="reserved"):
        client.post("/cameras", {"glove": "service", "source": "rendered"})


def test_a_phones_video_is_imported_and_played(
    client: RestClient, settings: Settings, tmp_path: Path
) -> None:
    cv2 = pytest.importorskip("cv2")
    ready_folder(settings.data)
    phone = tmp_path / "IMG 0042.MOV"
    drawn = RenderedGlove(PrintedHand(hand_skin(), printed_pattern()), ASSUMED)
    pictures = [cv2.resize(drawn.draw(number / 20), (1280, 960)) for number in range(12)]
    phone_video(tmp_path / "a.mov", pictures, [40 + 30 * (number % 2) for number in range(12)])
    (tmp_path / "a.mov").rename(phone)
    body = {"upload": client.upload(phone), "filename": phone.name}
    kept = client.put("/camera-files/videos/phone", body)
    told = "the file's own times, a variable rate, 14.3 to 25.0 Hz"
    assert kept == {"name": "phone", "pictures": 12, "seconds": pytest.approx(0.59), "times": told}
    assert client.get("/camera-files/videos") == [kept]
    assert client.get(f"/uploads/{body['upload']}/kind") == {"kind": "video"}
    table = tmp_path / "no.mp4"
    table.write_text("time_s,a\n0,1\n")
    with pytest.raises(Refused, match="cannot be read as a video"):
        client.put("/camera-files/videos/other", {"upload": client.upload(table), "filename": table.name})
    with pytest.raises(Refused, match="is no video that can be read"):
        client.put("/camera-files/videos/other", {"upload": client.upload(table), "filename": "no.csv"})
    with pytest.raises(Refused, match="no video 'other'; there are: phone"):
        client.post("/cameras", {"glove": "x", "source": "video:other"})
    with open_router([settings.zenoh]):
        asked = {"glove": "filmed", "source": "video:phone", "stage": "nearest", "keep": "nothing"}
        client.post("/cameras", asked | SMALL)

        def played() -> bool:
            return "is over after 12 pictures" in client.get("/cameras/filmed")["sentence"]

        eventually(played, "it was played to its end")
    summary = client.get("/cameras/filmed")["sentence"]
    assert "12 pictures, " in summary
    assert " 0 unusable" in summary


@pytest.mark.parametrize("camera", [None, 3, {}, {"source": 5}, {"rotations": [{}]}])
def test_what_is_no_camera_is_left_out(camera: Any) -> None:
    status = {"state": "streaming", "sentence": "", "camera": camera}
    assert said_of_itself(GloveKeys("lab", "g").glove, status, started_here=False) is None
