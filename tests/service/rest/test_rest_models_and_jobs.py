"""From takes to models over REST: train, follow, cancel, activate, roll back, predict, compare, export."""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from realtime_support import free_endpoint

from glovecal_client.errors import ServiceError
from glovecal_client.keys import GloveKeys
from glovecal_client.rest import NoService, Refused, RestClient
from glovecal_client.session import open_router
from glovecal_models.calibration import artifact
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_service.rest.http.health import REALTIME_ALIVE
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings
from glovecal_service.store import Store

Write = Callable[..., Path]


def trained(client: RestClient, **changed: Any) -> str:
    body = {"subject": "anna", "layout": client.get("/takes")[0]["layout"], "method": "linear", **changed}
    job = client.post("/models/train", body)
    assert job["state"] == "queued"
    return client.wait_for_job(job["id"], patience_s=300)["result"]["model"]


@pytest.fixture
def client(client: RestClient, write_table: Write) -> RestClient:
    client.post("/subjects", {"name": "anna"})
    client.upload_takes(write_table(), subject="anna")
    return client


def test_the_layout_is_that_of_the_takes(client: RestClient, write_table: Write) -> None:
    takes = client.get("/takes")
    job = client.post("/models/train", {"subject": "Anna", "method": "linear", "folds": 0})
    model = client.get(f"/models/{client.wait_for_job(job['id'], patience_s=300)['result']['model']}")
    assert (model["subject"], model["layout"]) == ("anna", takes[0]["layout"])
    client.post("/subjects", {"name": "ben"})
    with pytest.raises(Refused, match="no take of subject 'ben' has reference angles"):
        client.post("/models/train", {"subject": "ben"})
    fingers = {"sensors": ["I_MCP", "I_PIP"], "rotations": {"I_MCP": ["I_MCP"], "I_PIP": ["I_PIP"]}}
    client.put("/gloves/two-fingers", fingers)
    client.put(f"/takes/{takes[0]['id']}/layout", {"layout": "two-fingers"})
    with pytest.raises(
        Refused, match=f"have layouts {takes[1]['layout']}, two-fingers; choose one"
    ) as refused:
        client.post("/models/train", {"subject": "anna"})
    assert refused.value.status == 422


def test_train_activate_roll_back(client: RestClient) -> None:
    takes = [take["id"] for take in client.get("/takes")]
    layout = client.get("/takes")[0]["layout"]
    with pytest.raises(Refused, match="nothing earlier") as refused:
        client.post("/models/rollback", {"subject": "anna", "layout": layout})
    assert refused.value.status == 409
    first = trained(client, takes=takes[:1])
    second = trained(client, takes=takes, parent=first[:12])
    third = trained(client, takes=takes[1:], activate=False)
    rows = client.get("/models", {"subject": "anna"})
    assert [(row["id"], row["active"]) for row in rows] == [(first, False), (second, True), (third, False)]
    assert all(0.3 < row["held_out_rmse_deg"] < 1.0 for row in rows)  # the noise of I_MCP is 0.5 degrees
    assert [row["id"] for row in client.get(f"/models/{second}/lineage")] == [second, first]
    assert client.post("/models/rollback", {"subject": "anna", "layout": layout})["model"] == first
    assert client.post(f"/models/{third[:10]}/activate")["model"] == third
    shown = client.get(f"/models/{third[:6]}")
    assert (shown["id"], shown["active"], shown["simulated"]) == (third, True, False)
    assert [row["rotation"] for row in shown["rotations"]] == ["I_MCP", "I_PIP"]
    with pytest.raises(Refused, match="trained on take") as refused:
        client.delete(f"/takes/{takes[0]}")
    assert refused.value.status == 409
    with pytest.raises(Refused) as refused:
        client.delete("/subjects/anna")
    assert refused.value.status == 409


def test_predict_compare_and_export_agree_with_the_artifact(client: RestClient) -> None:
    takes = [take["id"] for take in client.get("/takes")]
    model = trained(client, takes=takes[:1])
    content = client.download(f"/models/{model[:8]}/export")
    assert hashlib.sha256(content).hexdigest() == model
    predictor = GlovePredictor(artifact.load(content, expected_id=model))
    readings = np.random.default_rng(1).uniform(0, 250, (50, 2))
    expected = predictor.predict(readings)
    answer = client.post(f"/models/{model}/predict", {"readings": readings.tolist()})
    assert answer["rotations"] == list(predictor.rotations)
    np.testing.assert_array_equal(answer["mean_deg"], expected.mean)
    np.testing.assert_array_equal(answer["sd_deg"], expected.sd)
    np.testing.assert_array_equal(answer["flags"], expected.flags)
    swapped = {"readings": readings[:, ::-1].tolist(), "sensors": ["I_PIP", "I_MCP"]}
    assert client.post(f"/models/{model}/predict", swapped) == answer
    found = client.post(f"/models/{model}/compare", {"takes": takes})
    assert found["trained_on"] == takes[:1]
    assert found["overall"]["count"] == 480
    assert 0.45 < found["rotations"]["I_MCP"]["rmse_deg"] < 0.55
    assert found["rotations"]["I_PIP"]["rmse_deg"] < 1e-3


def test_a_recording_is_predicted_without_the_sensors_noise(client: RestClient) -> None:
    model = trained(client)
    time_s = np.arange(120) / 60
    clean = 120 + 40 * np.sin(2 * np.pi * 0.4 * time_s)
    noisy = np.column_stack([clean, clean]) + 2.0 * np.random.default_rng(2).standard_normal((120, 2))
    body = {"readings": noisy.tolist(), "time_s": time_s.tolist()}
    truth, live, steadied = (
        np.array(client.post(f"/models/{model}/predict", asked)["mean_deg"])
        for asked in (
            {"readings": np.column_stack([clean, clean]).tolist()},
            body,
            {**body, "steadied_s": 0.5},
        )
    )
    assert np.std(steadied - truth) < 0.5 * np.std(live - truth)
    with pytest.raises(Refused, match="steadied_s needs time_s"):
        client.post(f"/models/{model}/predict", {"readings": noisy.tolist(), "steadied_s": 0.5})


def test_readings_of_another_glove(client: RestClient) -> None:
    model = trained(client)
    for body, says in [
        ({"readings": [[1.0]]}, "frame 0 has 1 readings"),
        ({"readings": [[1.0, 2.0], [1.0, 2.0, 3.0]]}, "frame 1 has 3 readings"),
        ({"readings": [[]]}, "frame 0 has 0 readings"),
        ({"readings": [[1.0, 2.0]], "sensors": ["I_MCP", "X"]}, "I_PIP"),
    ]:
        with pytest.raises(Refused, match=says) as refused:
            client.post(f"/models/{model}/predict", body)
        assert refused.value.problem["type"] == "urn:glovecal:problem:layout-mismatch"
    huge = client.post(f"/models/{model}/predict", {"readings": [[1e308, -1e308]]})
    assert huge["flags"][0][0] & 1
    assert all(value is None or np.isfinite(value) for value in huge["mean_deg"][0])


def test_a_damaged_artifact_is_named_and_the_last_good_model_stays(
    client: RestClient, settings: Settings
) -> None:
    good = trained(client)
    bad = trained(client, takes=[client.get("/takes")[0]["id"]], activate=False)
    path = settings.artifacts_folder / bad
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    for method, route in [("POST", "activate"), ("GET", "export")]:
        with pytest.raises(Refused, match=bad) as refused:
            client.post(f"/models/{bad}/{route}") if method == "POST" else client.download(
                f"/models/{bad}/{route}"
            )
        assert refused.value.status == 500
        assert refused.value.problem["type"] == "urn:glovecal:problem:damaged"
    assert [row["id"] for row in client.get("/models") if row["active"]] == [good]
    path.unlink()
    with pytest.raises(Refused, match="missing"):
        client.post(f"/models/{bad}/activate")


def search_for_damage(settings: Settings) -> None:
    with Store.open(settings) as store:
        for _ in store.damages.search():
            pass


def test_a_damaged_active_model_is_told_with_what_to_do(client: RestClient, settings: Settings) -> None:
    first, model = trained(client), trained(client, takes=[client.get("/takes")[0]["id"]])
    layout = client.get("/takes")[0]["layout"]
    path = settings.artifacts_folder / model
    content = path.read_bytes()
    alive = settings.data / REALTIME_ALIVE  # real time is another process, which these tests do without
    alive.touch()
    os.utime(alive, (2e9, 2e9))
    assert client.get(f"/models/{model}")["damage"] is None
    assert client.get("/health/ready")["problems"] == []
    for change in (content[:-1] + bytes([content[-1] ^ 1]), content[:100], None):
        path.unlink() if change is None else path.write_bytes(change)
        search_for_damage(settings)
        [problem] = client.get("/health/ready")["problems"]
        assert problem.startswith(f"model {model[:12]} cannot be loaded: artifact {model}")
        assert problem.endswith(
            "restore that file from a backup, or return to the model before it: glovecal model rollback"
            f" --subject anna --layout {layout}, or train again: glovecal train --subject anna"
        )
        assert [row["damage"] for row in client.get("/models")] == [None, problem]
        with pytest.raises(Refused) as refused:
            client.get(f"/models/{model}")
        assert (refused.value.status, refused.value.detail) == (500, problem)
    path.write_bytes(content)
    search_for_damage(settings)
    assert client.get("/health/ready")["problems"] == []
    path.unlink()
    with pytest.raises(Refused, match="missing"):
        client.get(f"/models/{model}")
    assert len(client.get("/health/ready")["problems"]) == 1, "whoever asks for it finds it at once"
    client.post("/models/rollback", {"subject": "anna", "layout": layout})
    client.delete(f"/models/{model}")
    search_for_damage(settings)
    assert client.get("/health/ready")["problems"] == []
    assert [row["id"] for row in client.get("/models") if row["active"]] == [first]


def test_lists_go_on_without_damaged_rows_and_name_them(client: RestClient, settings: Settings) -> None:
    trained(client)
    whole = {path: client.get(path) for path in ("/takes", "/jobs", "/models")}
    with closing(sqlite3.connect(settings.data / "glovecal.sqlite3")) as connection:
        for change in ("takes SET facts = '{'", "jobs SET fraction = 0.25", "models SET method = 'spgp'"):
            table = change.split()[0]
            connection.execute(f"UPDATE {change} WHERE id = (SELECT min(id) FROM {table})")
        connection.commit()
    for path, rows in whole.items():
        assert client.warnings == []
        left = min(row["id"] for row in rows)
        assert client.get(path) == [row for row in rows if row["id"] != left]
        [sentence] = client.warnings
        assert sentence.startswith(f"row '{left}' of table {path[1:]}")
        assert sentence.endswith("restore a backup of the database")
        with pytest.raises(Refused, match=f"row '{left}' of table {path[1:]}") as refused:
            client.get(f"{path}/{left}")
        assert refused.value.problem["type"] == "urn:glovecal:problem:damaged"
        client.warnings.clear()


def test_what_cannot_be_trained_is_refused_before_a_job(client: RestClient, write_table: Write) -> None:
    layout = client.get("/takes")[0]["layout"]
    client.post("/subjects", {"name": "ben"})
    mine = client.get("/takes")[0]["id"]
    bare = client.upload_takes(write_table("bare.csv", seed=9, reference=False), subject="ben")["imported"]
    refusals = [
        ({"subject": "nobody", "layout": layout}, 404),
        ({"subject": "anna", "layout": "unknown"}, 404),
        ({"subject": "anna", "layout": "cyberglove18"}, 422),
        ({"subject": "ben", "layout": layout}, 422),
        ({"subject": "ben", "layout": layout, "takes": bare}, 422),
        ({"subject": "ben", "layout": layout, "takes": [mine]}, 409),
        ({"subject": "anna", "layout": layout, "takes": ["0123456789ab"]}, 404),
        ({"subject": "anna", "layout": layout, "parent": "abcdef"}, 404),
        ({"subject": "anna", "layout": layout, "method": "magic"}, 422),
        ({"subject": "anna", "layout": layout, "pseudo_inputs": 10**9}, 422),
        ({"subject": "anna", "layout": layout, "takes": []}, 422),
    ]
    for body, status in refusals:
        with pytest.raises(Refused) as refused:
            client.post("/models/train", body)
        assert refused.value.status == status, body
    assert client.get("/jobs") == []


def test_a_job_that_fails_says_why(client: RestClient, tmp_path: Path) -> None:
    file = tmp_path / "still.csv"
    file.write_text("time_s,s.I_MCP,s.I_PIP,r.I_MCP\n" + "".join(f"{n},7,{n},10\n" for n in range(60)))
    client.post("/subjects", {"name": "ben"})
    answer = client.upload_takes(file, subject="ben")
    job = client.post("/models/train", {"subject": "ben", "layout": answer["layout"], "method": "linear"})
    with pytest.raises(ServiceError, match="I_MCP"):
        client.wait_for_job(job["id"], patience_s=300)
    assert client.get("/jobs", {"subject": "ben"})[0]["state"] == "failed"
    assert client.get("/jobs", {"only_unfinished": True}) == []


def events_of(http: httpx.Client, job: str, **headers: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    with http.stream("GET", f"/jobs/{job}/events", headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        event: dict[str, Any] = {}
        for line in answer.iter_lines():
            key, _, value = line.partition(": ")
            if key in ("event", "id"):
                event[key] = value
            elif key == "data":
                event["data"] = json.loads(value)
            elif not line and event:
                found.append(event)
                event = {}
    return found


def test_events_and_cancel_over_real_http(serve: Callable[..., str], settings: Settings) -> None:
    """A job is played through the store, as a runner would do it."""
    with Store.open(settings) as store:
        url = serve(settings)
        job = store.jobs.create("test-kind", {})
        store.jobs.request_cancel(job.id)
        with httpx.Client(base_url=f"{url}/v1", trust_env=False, timeout=120) as http:
            events = events_of(http, job.id)
            assert [event["event"] for event in events] == ["progress", "progress", "done"]
            assert events[-1]["data"]["state"] == "cancelled"
            rest = events_of(http, job.id, **{"Last-Event-ID": events[0]["id"]})
            assert [event.get("id") for event in rest] == [events[1]["id"], None]
            assert http.get("/jobs/0123456789ab/events").status_code == 404
            assert http.post(f"/jobs/{job.id}/cancel").json()["state"] == "cancelled"
            bad = http.get(f"/jobs/{job.id}/events", headers={"Last-Event-ID": "x"})
            assert bad.status_code == 422


def test_an_answer_that_cannot_be_read_any_more_is_shown_as_stored_and_has_no_page(
    serve: Callable[..., str], settings: Settings
) -> None:
    with Store.open(settings) as store:
        ids = []
        for kind in ("ceiling", "diagnose"):
            job = store.jobs.create(kind, {})
            claimed = store.jobs.claim("a runner")
            assert claimed is not None
            store.jobs.finish(job.id, claimed.attempt, {"verdict": ["of old"]})
            ids.append(job.id)
        with httpx.Client(base_url=f"{serve(settings)}/v1", trust_env=False, timeout=120) as http:
            for id in ids:
                assert http.get(f"/jobs/{id}").json()["result"] == {"verdict": ["of old"]}
                page = http.get(f"/jobs/{id}/report")
                assert page.status_code == 409
                assert "ask again" in page.json()["detail"]


def test_events_of_a_training_job_arrive_while_it_runs(
    serve: Callable[..., str], settings: Settings, write_table: Write
) -> None:
    url = serve(settings)
    with RestClient(url) as client, httpx.Client(base_url=f"{url}/v1", trust_env=False, timeout=120) as http:
        client.post("/subjects", {"name": "anna"})
        layout = client.upload_takes(write_table(), subject="anna")["layout"]
        answer = http.post("/models/train", json={"subject": "anna", "layout": layout, "method": "linear"})
        assert answer.status_code == 202
        assert answer.headers["location"] == f"/v1/jobs/{answer.json()['id']}"
        events = events_of(http, answer.json()["id"])
        fractions = [event["data"]["fraction"] for event in events if event["event"] == "progress"]
        assert fractions == sorted(fractions)
        assert events[-1]["event"] == "done"
        assert events[-1]["data"]["result"]["model"] == client.get("/models")[0]["id"]


def test_recordings(client: RestClient, settings: Settings) -> None:
    with pytest.raises(Refused, match="ever seen") as refused:
        client.post("/recordings", {"glove": "left", "name": "wave"})
    assert refused.value.status == 404
    seen = client.put("/gloves/left/wearer", {"subject": "anna", "wearing": "morning"})
    assert (seen["subject"], seen["wearing"]) == ("anna", "morning")
    recording = client.post("/recordings", {"glove": "left", "name": "wave"})
    assert (recording["state"], recording["subject"], recording["wearing"]) == (
        "requested",
        "anna",
        "morning",
    )
    assert recording["facts"]["pre_roll"] == {"asked_s": 60.0}
    with pytest.raises(Refused) as refused:
        client.post("/recordings", {"glove": "left", "name": "again"})
    assert refused.value.status == 409
    with pytest.raises(Refused, match="lead_s") as refused:
        client.post("/recordings", {"glove": "left", "name": "again", "lead_s": 601})
    assert refused.value.status == 422
    running = {"time_code": "10:00:00:05", "rate": "25", "source": "LTC of a line", "computer": "here"}
    running |= {"wall_s": 1.7e9, "monotonic_s": 12.5}
    place = f"/recordings/{recording['id']}/time-code"
    assert client.put(place, running)["facts"]["time_code"] == running
    with pytest.raises(Refused, match="there is no time code 10:00:00:25 at 25") as refused:
        client.put(place, {**running, "time_code": "10:00:00:25"})
    assert refused.value.status == 422
    assert client.post(f"/recordings/{recording['id']}/stop")["state"] == "stopping"
    assert client.get("/recordings", {"only_open": True})[0]["id"] == recording["id"]
    assert client.get(f"/recordings/{recording['id']}")["name"] == "wave"
    with pytest.raises(Refused) as refused:
        client.put("/gloves/left/wearer", {"subject": "nobody"})
    assert refused.value.status == 404
    assert client.put("/gloves/left/wearer", {"subject": None})["subject"] is None
    with pytest.raises(Refused, match="is stopping; remove the glove once that is done") as refused:
        client.delete("/gloves/left")
    assert refused.value.status == 409


def test_a_glove_is_forgotten_unless_it_streams(settings: Settings) -> None:
    settings = settings.model_copy(update={"zenoh": free_endpoint()})
    with open_router([settings.zenoh]) as router, in_process_client(settings) as client:
        client.put("/gloves/right/wearer", {"subject": None})
        token = router.liveliness().declare_token(GloveKeys(settings.site, "right").alive)
        with pytest.raises(Refused, match="'right' streams; stop its capture first") as refused:
            client.delete("/gloves/right")
        assert refused.value.status == 409
        token.undeclare()
        client.delete("/gloves/right")
        assert "right" not in [each["name"] for each in client.get("/gloves")["seen"]]
        with pytest.raises(Refused, match="'right' was ever seen") as refused:
            client.delete("/gloves/right")
        assert refused.value.status == 404


def test_layouts_over_rest(client: RestClient, tmp_path: Path) -> None:
    given = {
        "name": "half",
        "sensors": ["A", "B"],
        "rotations": {"A": ["A", "B"]},
        "simulated": {"C": "2/3 * A"},
    }
    stored = client.put("/gloves/half", given)
    assert stored["rotations"] == ["A", "C"]
    assert client.put("/gloves/half", stored["document"])["document"] == stored["document"]
    for wrong, says in [
        ({**given, "name": "other"}, "the path names layout"),
        ({**given, "rotations": {"A": ["Z"]}}, "'Z'"),
        ({**given, "simulated": {"C": "__import__('os')"}}, "C"),
        ({**given, "simulated": {"C": "A" + "*A" * 900}}, "C"),
        ({**given, "counts": [5, 1]}, "counts"),
    ]:
        with pytest.raises(Refused, match=says) as refused:
            client.put("/gloves/half", wrong)
        assert refused.value.status == 422
    for name in ("cyberglove18", "cyberglove22"):
        document = client.get(f"/gloves/{name}")["document"]
        with pytest.raises(Refused, match="built in") as refused:
            client.put(f"/gloves/{name}", {**document, "title": "mine"})
        assert refused.value.status == 409
    bad = tmp_path / "bad.toml"
    bad.write_text('name = "bad"\nsensors = ["A"')
    with pytest.raises(Refused, match="not valid TOML"):
        client.add_layout(bad)


def test_the_same_folder_again(settings: Settings, write_table: Write) -> None:
    with in_process_client(settings) as client:
        client.post("/subjects", {"name": "anna"})
        client.upload_takes(write_table(), subject="anna")
        model = trained(client)
    with in_process_client(settings) as client:
        assert [row["id"] for row in client.get("/models") if row["active"]] == [model]
        assert client.post(f"/models/{model}/predict", {"readings": [[100, 100]]})["rotations"]


def test_no_service_is_said_with_its_address() -> None:
    with (
        RestClient("http://127.0.0.1:9") as client,
        pytest.raises(NoService, match=r"127\.0\.0\.1:9.*glovecal serve") as no,
    ):
        client.get("/subjects")
    assert no.value.exit_code == 3
    with pytest.raises(ValueError, match="not the address"):
        RestClient("localhost:8600")


def test_an_answer_that_is_no_problem_document_is_still_an_error() -> None:
    class Proxy(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(502)
            self.end_headers()
            self.wfile.write(b"<html>proxy</html>")

        def log_message(self, format: str, *args: Any) -> None:
            pass

    with HTTPServer(("127.0.0.1", 0), Proxy) as proxy:
        thread = threading.Thread(target=proxy.handle_request)
        thread.start()
        with (
            RestClient(f"http://127.0.0.1:{proxy.server_port}") as client,
            pytest.raises(ServiceError) as error,
        ):
            client.get("/subjects")
        thread.join(120)
    assert error.value.status == 502
    assert "proxy" in error.value.detail
