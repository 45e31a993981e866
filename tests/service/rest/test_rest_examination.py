"""``takes/examination``: documents, pages, refusals; takes and gloves with another layout."""

from __future__ import annotations

from pathlib import Path

import pytest
from still_take import still_take

from glovecal_client.errors import ServiceError
from glovecal_client.rest import RestClient
from glovecal_models.layout import Layout
from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.takes.write_table import write_takes
from glovecal_service.realtime.model_watcher import choose
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store


@pytest.fixture
def takes(client: RestClient, tmp_path: Path) -> list[str]:
    """A take with the wrist's deviation still and one with its range, both with measured angles."""
    glove = SimulatedGlove(1)
    made = [
        still_take(glove, "W_ABD", ("W_FLEX",), name="still-W_ABD", rate_hz=30, with_reference=True),
        still_take(glove, None, ("W_ABD",), name="range-W_ABD", seconds=6, rate_hz=30, with_reference=True),
    ]
    write_takes(made, tmp_path / "takes.csv")
    client.post("/subjects", {"name": "anna"})
    return client.upload_takes(tmp_path / "takes.csv", subject="anna", layout="cyberglove18")["imported"]


def refusal(call, *arguments) -> ServiceError:
    with pytest.raises(ServiceError) as caught:
        call(*arguments)
    return caught.value


def test_an_examination_and_its_page(client: RestClient, takes: list[str]) -> None:
    found = client.post("/takes/examination", {"takes": takes[:1]})
    (item,) = found["rotations"]
    (share,) = item["affecting"]
    assert (item["sensor"], share["sensor"], share["affects"]) == ("W_ABD", "W_FLEX", "yes")
    assert item["still"]["is_still"]
    assert found["proposed_layout"]["name"] == "cyberglove18-examined"
    assert not any(proposal["is_change"] for proposal in found["proposals"])
    page = client.page("/takes/examination/report", {"takes": takes[:1]})
    assert page.startswith("<!doctype html>")
    assert "Which sensor affects which" in page
    nothing = client.post("/takes/examination", {"takes": takes[:1], "range_takes": []})
    assert nothing["rotations"][0]["active_range"]["source"] == "what the glove can send"


def test_what_does_not_fit_is_refused(client: RestClient, takes: list[str]) -> None:
    assert refusal(client.post, "/takes/examination", {"takes": ["0" * 12]}).status == 404
    assert refusal(client.post, "/takes/examination", {"takes": []}).status == 422
    still = {"takes": takes[1:], "still": {takes[1]: "I_DIP"}}
    assert "has no sensor of its own" in str(refusal(client.post, "/takes/examination", still))
    assert refusal(client.put, f"/takes/{takes[0]}/layout", {"layout": "nowhere"}).status == 404
    assert refusal(client.put, f"/takes/{takes[0]}/layout", {"layout": "lucidglove"}).status == 422


def test_a_glove_is_served_by_the_newest_model_of_its_sensors(
    client: RestClient, takes: list[str], settings: Settings
) -> None:
    document = Layout.built_in("cyberglove18").to_document() | {"name": "mine"}
    client.put("/gloves/mine", document)
    models = {}
    for layout in ("cyberglove18", "mine", "cyberglove18"):
        client.put(f"/takes/{takes[0]}/layout", {"layout": layout})
        body = {"subject": "anna", "layout": layout, "method": "linear", "takes": takes[:1], "folds": 0}
        job = client.wait_for_job(
            client.post("/models/train", body | {"activate": layout not in models})["id"], patience_s=120
        )
        models.setdefault(layout, job["result"]["model"])
        if layout == "mine":
            break
    with Store.open(settings) as store:
        store.gloves.seen("right", {"layout": "cyberglove18"})
        store.gloves.assign("right", "anna", None)
        assert served(store) == models["mine"]
        store.models.activate(models["cyberglove18"])
        assert served(store) == models["cyberglove18"]


def served(store: Store) -> str | None:
    model = choose(store, "right", None, {}).model
    return None if model is None else model.model_id
