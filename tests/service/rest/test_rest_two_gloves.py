"""One subject with two gloves: each hand has takes and models of its own, and none reads the other's."""

from __future__ import annotations

from pathlib import Path

import pytest
import trc
from stored_takes import LAYOUT, make_take

from glovecal_client.rest import Refused, RestClient
from glovecal_service.realtime.model_watcher import choose
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

HANDS = ("right", "left")


@pytest.fixture
def takes(client: RestClient, settings: Settings) -> dict[str, list[str]]:
    """Two takes of each of anna's hands, by hand; both her gloves were seen."""
    client.post("/subjects", {"name": "anna"})
    found: dict[str, list[str]] = {}
    with Store.open(settings) as store:
        store.layouts.put(LAYOUT)
        for number, hand in enumerate(("right", "right", "left", "left")):
            row = store.takes.add(
                make_take(number, f"{hand}-{number}"), subject="anna", layout=LAYOUT.name,
                source="recording", accounting={"hand": hand},
            )  # fmt: skip
            found.setdefault(hand, []).append(row.id)
        for hand in HANDS:
            store.gloves.seen(hand, {"layout": LAYOUT.name, "subject": "anna", "hand": hand})
    return found


def trained(client: RestClient, hand: str) -> str:
    job = client.post("/models/train", {"subject": "anna", "method": "linear", "hand": hand})
    return client.wait_for_job(job["id"], patience_s=300)["result"]["model"]


def served(settings: Settings, hand: str) -> tuple[str | None, str]:
    """What the glove of that hand is served with, and what is said of it."""
    with Store.open(settings) as store:
        meta = {"layout": LAYOUT.name, "subject": "anna", "hand": hand, "sensors": list(LAYOUT.sensors)}
        serving = choose(store, hand, meta, {})
    return serving.model and serving.model.model_id, serving.sentence


def test_a_model_is_of_one_hand_and_active_beside_the_others(
    client: RestClient, settings: Settings, takes: dict[str, list[str]]
) -> None:
    with pytest.raises(Refused, match=r"each hand has models of its own: choose the hand \(--hand left"):
        client.post("/models/train", {"subject": "anna", "method": "linear"})
    right = trained(client, "right")
    assert [each["id"] for each in client.get(f"/models/{right}")["facts"]["takes"]] == takes["right"]
    model, why = served(settings, "left")
    assert model is None
    assert "wrong hand: left is a left glove and every model of anna is of the right hand" in why
    left = trained(client, "left")
    assert {hand: served(settings, hand) for hand in HANDS} == {"right": (right, ""), "left": (left, "")}
    assert {row["id"]: (row["hand"], row["active"]) for row in client.get("/models")} == {
        right: ("right", True),
        left: ("left", True),
    }
    assert [row["id"] for row in client.get("/models", {"hand": "left"})] == [left]
    assert [row["id"] for row in client.get("/takes", {"hand": "left"})] == takes["left"]


def test_a_hands_model_is_rolled_back_by_itself(
    client: RestClient, settings: Settings, takes: dict[str, list[str]]
) -> None:
    first = {hand: trained(client, hand) for hand in HANDS}
    second = client.post("/models/train", {"subject": "anna", "method": "raw", "takes": takes["left"]})
    second = client.wait_for_job(second["id"], patience_s=300)["result"]["model"]
    assert served(settings, "left")[0] == second
    which = {"subject": "anna", "layout": LAYOUT.name}
    with pytest.raises(Refused, match="has an active model of each hand"):
        client.post("/models/rollback", which)
    assert client.post("/models/rollback", which | {"hand": "left"})["model"] == first["left"]
    with pytest.raises(Refused, match="nothing earlier was active"):
        client.post("/models/rollback", which | {"hand": "right"})
    assert {hand: served(settings, hand)[0] for hand in HANDS} == first


def test_takes_of_the_other_hand_are_refused_and_a_child_keeps_its_hand(
    client: RestClient, takes: dict[str, list[str]]
) -> None:
    left = trained(client, "left")
    with pytest.raises(Refused, match=r"is of the right hand, model .* of the left one"):
        client.post(f"/models/{left}/diagnose", {"takes": takes["right"]})
    change = {"I_PIP": {"scale": 1.1, "offset_deg": 0.0}}
    child = client.post(f"/models/{left}/refine", {"rotations": change, "activate": True})
    assert (child["hand"], child["parent"]) == ("left", left)


def test_a_motion_of_both_hands_is_predicted_by_both_models(
    client: RestClient, takes: dict[str, list[str]], tmp_path: Path
) -> None:
    models: list[str] = []
    for hand in HANDS:
        models.append(trained(client, hand))
    both = {"takes": [takes["right"][0], takes["left"][0]], "content": "angles"}
    chosen, named = trc.TRCData(), trc.TRCData()
    for data, more in ((chosen, {}), (named, {"models": models})):
        (tmp_path / "both.trc").write_bytes(client.made("/motion", both | more))
        data.load(str(tmp_path / "both.trc"))
    assert [name[0] for name in chosen["Markers"]] == ["R", "R", "L", "L"]
    for marker in chosen["Markers"]:
        assert chosen[marker] == named[marker]


def test_where_nobody_said_the_hand_one_model_reads_both(
    client: RestClient, settings: Settings, takes: dict[str, list[str]]
) -> None:
    """Until a hand has a model of its own: then the other's glove is not read by either."""
    with Store.open(settings) as store:
        row = store.takes.add(make_take(7, "table"), subject="anna", layout=LAYOUT.name, source="import")
    job = client.post("/models/train", {"subject": "anna", "method": "linear", "takes": [row.id]})
    table = client.wait_for_job(job["id"], patience_s=300)["result"]["model"]
    assert {served(settings, hand)[0] for hand in HANDS} == {table}
    right = trained(client, "right")
    assert served(settings, "right")[0] == right
    model, why = served(settings, "left")
    assert model is None
    assert f"activate one, such as: glovecal model activate {table[:12]}" in why
    assert [row["id"] for row in client.get("/models") if row["active"]] == [right]
    client.post(f"/models/{table}/activate")
    assert {served(settings, hand)[0] for hand in HANDS} == {table}


def test_a_calibration_that_is_due_for_one_hand_is_told_whatever_the_other_did_since(
    client: RestClient, settings: Settings, takes: dict[str, list[str]]
) -> None:
    models = {hand: trained(client, hand) for hand in HANDS}
    assert not client.get("/subjects/anna/history")["is_full_calibration_due"]
    due = {"quick_check": {"is_full_calibration_due": True}}
    with Store.open(settings) as store:
        for content, hand, facts in ((b"left, checked", "left", due), (b"right, checked", "right", {})):
            store.models.add(
                content, subject="anna", layout=LAYOUT.name, method="linear", parent=models[hand], facts=facts
            )
    found = client.get("/subjects/anna/history")
    assert [row["hand"] for row in found["rows"]] == ["right", "left", "left", "right"]
    assert found["is_full_calibration_due"]
    job = client.post("/models/train", {"subject": "anna", "method": "raw", "hand": "left"})
    client.wait_for_job(job["id"], patience_s=300)
    assert not client.get("/subjects/anna/history")["is_full_calibration_due"]
