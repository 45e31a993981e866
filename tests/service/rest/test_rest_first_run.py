"""Without a glove: a simulated one that ends with the service, and a hidden effect that nothing betrays."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[2] / "client"))

from realtime_support import eventually, free_endpoint, linear_model

from glovecal_client.capture.cyberglove import find_port
from glovecal_client.clock import clock_ns
from glovecal_client.keys import GloveKeys
from glovecal_client.rest import Refused, RestClient
from glovecal_client.session import open_router
from glovecal_client.wire.frame import Frame, FrameFlag, decode_frame
from glovecal_models.calibration.artifact import dump
from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES
from glovecal_service.emulators.cyberglove import EmulatedBox
from glovecal_service.first_run.hidden_effect import HiddenEffect
from glovecal_service.first_run.hidden_session import RANDOM_EFFECTS, hidden_session
from glovecal_service.first_run.simulated_glove import GLOVE, SUBJECT
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store

SEED = 1
SERVICE = """
import sys, time
from pathlib import Path
from glovecal_service.first_run.simulated_glove import StreamedGlove
from glovecal_service.settings import Settings
StreamedGlove(Settings(data=Path(sys.argv[1]), zenoh=sys.argv[2])).start()
time.sleep(600)
"""


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Settings:
    return Settings(data=tmp_path_factory.mktemp("first") / "data", zenoh=free_endpoint())


@pytest.fixture(scope="module")
def client(settings: Settings) -> Iterator[RestClient]:
    """Jobs that are begun wait: the walk in a browser has them done."""
    with patch.object(Dispatcher, "start"), in_process_client(settings) as client:
        yield client


@contextmanager
def frames_of(settings: Settings) -> Iterator[list[Frame]]:
    """Those of the simulated glove, as they come."""
    came: list[Frame] = []
    with open_router([settings.zenoh]) as session:
        heard = session.declare_subscriber(
            GloveKeys(settings.site, GLOVE).raw,
            lambda sample: came.append(decode_frame(sample.payload.to_bytes())),
        )
        yield came
        heard.undeclare()


def test_the_simulated_glove_streams_once_and_is_trained_for_once(
    client: RestClient, settings: Settings
) -> None:
    assert client.get("/simulated-glove")["is_on"] is False
    with frames_of(settings) as came:
        begun = client.put("/simulated-glove", {"is_on": True})
        assert (begun["is_on"], begun["model"]) == (True, None)
        assert 1700 < begun["left_s"] <= 1800
        job = client.get(f"/jobs/{begun['job']}")
        assert (job["kind"], job["subject"]) == ("train", SUBJECT)
        assert client.put("/simulated-glove", {"is_on": True})["job"] == begun["job"]
        eventually(lambda: len(came) > 20, "its frames come")
        assert len({frame.run_id for frame in came}) == 1
        assert all(frame.flags & FrameFlag.SIMULATED for frame in came)
        stopped = client.put("/simulated-glove", {"is_on": False})
        assert (stopped["is_on"], stopped["left_s"]) == (False, 0.0)
        assert not (settings.data / "simulated-glove").exists()
        again = client.put("/simulated-glove", {"is_on": True})
        assert (again["is_on"], again["job"]) == (True, begun["job"])
        client.put("/simulated-glove", {"is_on": False})
    takes = client.get("/takes", {"subject": SUBJECT})
    assert all(take["simulated"] for take in takes)
    assert len(takes) == 5


def test_it_ends_when_the_service_is_killed(settings: Settings, tmp_path: Path) -> None:
    with frames_of(settings) as came:
        service = subprocess.Popen([sys.executable, "-c", SERVICE, str(tmp_path / "data"), settings.zenoh])
        try:
            eventually(lambda: came, "its frames come")
        finally:
            service.send_signal(signal.SIGKILL)
            service.wait()
        eventually(
            lambda: clock_ns() - came[-1].monotonic_ns > 2e9,
            "no frame has come for two seconds",
            deadline_s=30,
        )
    assert not (tmp_path / "data" / "simulated-glove").exists()


def test_what_is_hidden_is_not_told_before_an_effect_was_added(
    client: RestClient, settings: Settings
) -> None:
    truth = hidden_session("random", SEED).truth
    assert truth is not None
    with pytest.raises(Refused, match="no effect was hidden for subject"):
        client.get("/hidden-effects/anna")
    walk = client.post("/hidden-effects", {"seed": SEED})
    subject = walk["subject"]
    with pytest.raises(Refused, match="give another seed"):
        client.post("/hidden-effects", {"seed": SEED})
    takes = client.get("/takes", {"subject": subject})
    job = client.get(f"/jobs/{walk['job']}")
    assert (len(takes), len(job["payload"]["takes"])) == (12, 9)
    assert (walk["verdict"], walk["sentences"], walk["added"]) == (None, [], [])
    shown = [
        walk,
        takes,
        job,
        client.get("/hidden-effects"),
        client.get("/subjects"),
        client.get("/overview"),
    ]
    for word in (truth.name, truth.form, truth.description):
        assert word not in json.dumps(shown)
    assert truth.name in " ".join(client.get(f"/hidden-effects/{subject}", {"reveal": True})["sentences"])

    with Store.open(settings) as store:
        facts = {"effects": [truth.name]}
        model = dump(linear_model(subject, degrees_per_count=0.5))
        added = store.models.add(
            model, subject=subject, layout=takes[0]["layout"], method="linear", parent=None, facts=facts
        )
    [told] = client.get("/hidden-effects")
    assert (told["verdict"], told["added"], told["models"]) == ("right", [truth.name], [added.id])
    assert told["sentences"][0] == f"Right: {truth.name} was hidden."
    assert truth.description in told["sentences"][1]


def test_the_verdict_is_of_all_that_was_added() -> None:
    truth = hidden_session("lag", 3, take_s=5.0).truth
    assert truth is not None
    kept = HiddenEffect(3, truth)
    assert kept.verdict(["lag"]) == ("right", "Right: lag was hidden.")
    assert kept.verdict(["creep", "lag"])[0] == "partly right"
    assert kept.verdict(["creep"]) == ("wrong", "Wrong: you added creep; lag was hidden.")


def test_the_page_counts_what_can_be_hidden() -> None:
    """It says ten."""
    assert len(RANDOM_EFFECTS) == 10
    assert set(RANDOM_EFFECTS) <= set(KNOWN_CAUSES)


@pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are a POSIX thing")
def test_a_port_with_a_glove_is_told_with_its_device(client: RestClient, tmp_path: Path) -> None:
    from cyberglove_emulator import CyberGloveEmulator

    path = str(tmp_path / "glove")
    listed = {path: ("USB Serial", "0403:6001"), str(tmp_path / "gone"): ("", "")}
    with (
        CyberGloveEmulator(tmp_path / "glove", EmulatedBox(22)),
        patch.object(find_port, "_listed_ports", lambda: dict(listed)),
    ):
        glove, gone = sorted(client.post("/serial-ports", {}), key=lambda port: port["kind"])
    assert (glove["kind"], glove["device"]) == ("cyberglove", f"cyberglove:{path}")
    assert "CyberGlove with 22 sensors" in glove["sentence"]
    assert (gone["kind"], gone["device"]) == ("unusable", None)


def test_every_installed_device_has_a_command(client: RestClient, settings: Settings) -> None:
    devices = {each["name"]: each for each in client.get("/glove-devices")}
    assert {"cyberglove", "lucidglove", "line", "replay", "simulated"} <= devices.keys()
    for name, device in devices.items():
        assert device["sentence"].endswith(".")
        assert device["command"].startswith(f"glovecal capture --device {name}")
        assert device["command"].endswith(f"--glove GLOVE --subject SUBJECT --connect {settings.zenoh}")
