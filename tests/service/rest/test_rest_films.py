"""The service films by a process of its own: one at a time; what the camera says is passed on."""

from __future__ import annotations

import time

import numpy as np
import pytest

from glovecal_client.clock import computer_id
from glovecal_client.rest import Refused, RestClient
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_service.settings import Settings
from glovecal_service.store import Store

pytest.importorskip("cv2")
LAYOUT = Layout.built_in("cyberglove18")


def test_a_video_is_kept_whole_and_shown_beside_its_take(client: RestClient, settings: Settings) -> None:
    assert client.get("/films") is None
    begun = client.post("/films", {"source": "rendered"})
    assert begun["is_on"]
    assert begun["pictures"] >= 1
    with pytest.raises(Refused, match="rendered films already"):
        client.post("/films", {"source": "rendered"})
    time_s = np.arange(time.monotonic(), time.monotonic() + 0.5, 1 / 60)
    time.sleep(0.5)
    client.post("/subjects", {"name": "anna"})
    with Store.open(settings) as store:
        readings = np.full((len(time_s), len(LAYOUT.sensors)), 100.0)
        ids = [
            store.takes.add(
                Take(name, "w", LAYOUT.sensors, time_s + later_s, readings), subject="anna",
                layout=LAYOUT.name, source="recording", accounting={"computer": computer_id()},
            ).id
            for name, later_s in (("fist", 0.0), ("later", 900.0))
        ]  # fmt: skip
    ended = client.post("/films/stop", {"takes": ids})
    assert not ended["is_on"]
    assert ended["pictures"] > begun["pictures"]
    assert ended["sentences"][0].startswith("fist: ")
    assert "no moment in common" in ended["sentences"][1]
    assert client.get(f"/videos/{ids[0]}")["simulated"] is True
    kept = sorted(path.suffix for path in settings.films_folder.iterdir())
    assert kept == [".csv", ".json", ".mkv"]
    client.post("/films", {"source": "rendered"})
    client.post("/films/stop", {})


def test_no_camera_is_said(client: RestClient) -> None:
    with pytest.raises(Refused, match="camera:63 does not film"):
        client.post("/films", {"source": "camera:63"})
    with pytest.raises(Refused):
        client.post("/films", {"source": "video:/etc/passwd"})
    with pytest.raises(Refused, match=r"nothing was filmed|cannot be shown"):
        client.post("/films/stop", {})
