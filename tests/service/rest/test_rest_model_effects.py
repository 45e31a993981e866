"""The loop over REST: catalogue, diagnosis, an effect added and taken out, and what is refused."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pytest
from small_session import CAUSE, ROTATIONS, write_sticky

from glovecal_client.errors import ServiceError
from glovecal_client.rest import Refused, RestClient
from glovecal_models.effects.catalogue import catalogue
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

STICKY = "name = sticky; columns = tanh(own_deg - lowpass(own_deg, 0.1))"


@dataclass(frozen=True)
class Walk:
    """A service with subjects ``anna`` (eight takes, one without reference) and ``ben`` (none)."""

    client: RestClient
    layout: str
    takes: list[dict[str, Any]]
    mute: dict[str, Any]
    model: str
    """Linear, trained on the eight."""

    def result(self, job: dict[str, Any]) -> dict[str, Any]:
        return self.client.wait_for_job(job["id"], poll_s=0.02, patience_s=300)["result"]

    def add(self, effect: Any, *, model: str | None = None, **options: Any) -> dict[str, Any]:
        body = {"effect": effect, **options}
        return self.result(self.client.post(f"/models/{model or self.model}/effects", body))

    def models(self) -> list[str]:
        return [row["id"] for row in self.client.get("/models")]


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Walk]:
    folder = tmp_path_factory.mktemp("loop")
    table = write_sticky(folder)
    with in_process_client(Settings(data=folder / "data")) as client:
        for name in ("anna", "ben"):
            client.post("/subjects", {"name": name})
        answer = client.upload_takes(table, subject="anna")
        mute = client.upload_takes(folder / "mute.csv", subject="anna", layout=answer["layout"])
        body = {"subject": "anna", "layout": answer["layout"], "method": "linear"}
        trained = client.wait_for_job(client.post("/models/train", body)["id"], poll_s=0.02)
        model = trained["result"]["model"]
        yield Walk(client, answer["layout"], answer["takes"], mute["takes"][0], model)


def test_the_catalogue_tells_every_effect_in_full(walk: Walk) -> None:
    rows = walk.client.get("/effects")
    assert {row["name"] for row in rows} == set(catalogue())
    for row in rows:
        assert row["explanation"].endswith(".")
        assert row["source"]
        assert row["control"]
        assert not row["own"]
    one = walk.client.get("/effects/hysteresis")
    assert one in rows
    assert one["kind"] == "correction"
    assert [item["unit"] for item in one["parameters"]] == ["deg"]
    assert walk.client.get("/effects/temperature")["context"] == ["temperature_c"]
    with pytest.raises(Refused, match=r"there is no effect 'glue'; there are .*hysteresis") as refused:
        walk.client.get("/effects/glue")
    assert refused.value.status == 404


def test_a_diagnosis_names_the_hidden_cause_and_has_a_page(walk: Walk) -> None:
    job = walk.client.post(f"/models/{walk.model}/diagnose", {})
    found = walk.result(job)
    assert found["named"]["effect"] == CAUSE
    assert found["named"]["verdict"] == "named"
    assert set(found["named"]["where"]) == set(ROTATIONS)
    assert found["named"]["saved_deg"] > 4 * max(found["named"]["control_saved_deg"], 0.05)
    assert [take["name"] for take in found["takes"]] == [take["name"] for take in walk.takes]
    for values in found["rotations"].values():
        assert values["noise_floor_deg"] < values["rmse_deg"]
    assert {"contact_pressure"} <= {item["effect"] for item in found["not_identifiable"]}
    page = walk.client.download(f"/jobs/{job['id']}/report").decode()
    assert page.startswith("<!doctype html>")
    assert "hysteresis is missing." in page
    assert "hysteresis reduces the error of the sensors by" in page
    assert page.count("<figure") == page.count("<figcaption>") == page.count("<svg")


def test_the_same_question_again_is_answered_at_once(walk: Walk) -> None:
    body = {"takes": [take["name"] for take in walk.takes[:7]], "seed": 5}
    first = walk.result(walk.client.post(f"/models/{walk.model}/diagnose", body))
    again = walk.client.post(f"/models/{walk.model}/diagnose", body)
    assert walk.result(again) == first
    assert len(first["takes"]) == 7


def test_what_few_takes_cannot_decide_is_one_plan(walk: Walk) -> None:
    body = {"takes": [take["name"] for take in walk.takes[:2]]}
    plan = walk.result(walk.client.post(f"/models/{walk.model}/diagnose", body))["take_plan"]
    anew = [step for step in plan["steps"] if step["is_put_on_anew"]]
    assert all("donning_shift" not in step["opens"] for step in plan["steps"] if step not in anew)
    assert "donning_shift" in anew[-1]["opens"]
    assert all(len(step["take_names"]) >= 1 and step["seconds"] >= 20 for step in plan["steps"])


def test_an_added_effect_is_a_child_and_comes_out_again(walk: Walk) -> None:
    before = walk.models()
    job = walk.client.post(f"/models/{walk.model}/effects", {"effect": CAUSE, "rotations": ["M_PIP"]})
    result = walk.result(job)
    assert result["added"]
    assert result["after"]["M_PIP"] < 0.75 * result["before"]["M_PIP"]
    child = walk.client.get(f"/models/{result['model']}")
    assert child["parent"] == walk.model
    assert child["effects"] == [CAUSE]
    assert child["effect_details"][0]["rotations"] == ["M_PIP"]
    assert child["facts"]["addition"]["sentence"] == result["sentence"]
    lineage = walk.client.get(f"/models/{child['id']}/lineage")
    assert [row["id"] for row in lineage] == [child["id"], walk.model]
    told = walk.client.download(f"/jobs/{job['id']}/events").decode()
    assert "reduces the held-out error there from" in told
    assert f'"after":{{"M_PIP":{result["after"]["M_PIP"]:.3f}'[:-2] in told.replace(" ", "")

    with pytest.raises(Refused, match="has hysteresis on all of these rotations already") as refused:
        walk.add(CAUSE, model=child["id"], rotations=["M_PIP"])
    assert refused.value.status == 409
    both = walk.add(CAUSE, model=child["id"], activate=True)
    assert walk.client.get(f"/models/{both['model']}")["active"]
    grown = walk.client.get(f"/models/{both['model']}")["effect_details"]
    assert {name for item in grown for name in item["rotations"]} == set(ROTATIONS)

    removed = walk.result(walk.client.delete(f"/models/{both['model']}/effects/{CAUSE}"))
    assert removed["after"] > removed["before"]
    without = walk.client.get(f"/models/{removed['model']}")
    assert without["effects"] == []
    assert without["parent"] == both["model"]
    assert set(walk.models()) - set(before) == {child["id"], both["model"], removed["model"]}


def test_what_does_not_help_is_undone_and_nothing_is_stored(walk: Walk) -> None:
    before = walk.models()
    result = walk.add("supply_sag")
    assert not result["added"]
    assert result["model"] is None
    assert "was undone" in result["sentence"]
    assert walk.models() == before


def test_an_effect_of_ones_own_lives_with_its_model_only(walk: Walk) -> None:
    result = walk.add({"declaration": STICKY})
    assert result["added"], result["sentence"]
    assert "sticky" not in {row["name"] for row in walk.client.get("/effects")}
    child = walk.client.get(f"/models/{result['model']}")
    assert child["effect_details"][0]["declaration"]["columns"] == "tanh(own_deg - lowpass(own_deg, 0.1))"
    angles = walk.client.post(
        f"/models/{child['id']}/predict", {"readings": [[100.0, 100.0]] * 3, "time_s": [0, 0.1, 0.2]}
    )
    assert len(angles["mean_deg"]) == 3

    grown = walk.add(CAUSE, model=child["id"], rotations=["I_PIP"])
    assert grown["added"], grown["sentence"]
    assert set(walk.client.get(f"/models/{grown['model']}")["effects"]) == {"sticky", CAUSE}
    listed = {row["id"]: row["effects"] for row in walk.client.get("/models")}
    assert set(listed[grown["model"]]) == {"sticky", CAUSE}
    found = walk.result(walk.client.post(f"/models/{child['id']}/diagnose", {}))
    assert found["named"]["effect"] == CAUSE
    with pytest.raises(Refused, match="it has sticky"):
        walk.client.delete(f"/models/{child['id']}/effects/lag")
    assert walk.result(walk.client.delete(f"/models/{child['id']}/effects/sticky"))["model"]


def test_a_hypothesis_is_tried_beside_the_catalogue(walk: Walk) -> None:
    body = {"effects": [{"declaration": STICKY}], "takes": [take["id"] for take in walk.takes]}
    found = walk.result(walk.client.post(f"/models/{walk.model}/diagnose", body))
    assert "sticky" in {item["effect"] for item in found["candidates"]}


@pytest.mark.parametrize(
    ("effect", "status", "sentence"),
    [
        ("glue", 422, "no effect 'glue'; there are"),
        ("no_effect", 422, "it is the null hypothesis"),
        ("contact_pressure", 422, "needs the context column c.contact_n; these takes have c.humidity_pct"),
        (
            {"declaration": "name = strap; columns = c.strap_n"},
            422,
            "no context column 'c.strap_n'; known are",
        ),
        ({"declaration": "columns = own"}, 422, "effect: name is missing"),
        ({"declaration": "name = lag; columns = own"}, 422, "there is an effect 'lag' already"),
        ({"declaration": "name = x; columns = own +"}, 422, "effect 'x'"),
        (3, 422, "body.effect"),
    ],
)
def test_effects_that_cannot_be_are_refused_before_any_work(
    walk: Walk, effect: Any, status: int, sentence: str
) -> None:
    jobs = len(walk.client.get("/jobs"))
    with pytest.raises(Refused) as refused:
        walk.add(effect)
    assert refused.value.status == status
    assert sentence in str(refused.value)
    assert len(walk.client.get("/jobs")) == jobs


def test_a_single_take_says_what_it_cannot_show(walk: Walk) -> None:
    body = {"takes": [walk.takes[0]["id"]]}
    found = walk.result(walk.client.post(f"/models/{walk.model}/diagnose", body))
    why = {item["effect"]: item["why"] for item in found["not_identifiable"]}
    assert "one wearing" in why["donning_shift"]
    with pytest.raises(ServiceError, match="cannot be learned from these 1 takes: all takes are of one"):
        walk.add("donning_shift", takes=[walk.takes[0]["name"]])


def test_a_division_by_zero_is_named_with_its_frame(walk: Walk) -> None:
    with pytest.raises(ServiceError, match=r"division by zero in .* at frame 0 of take w1-t"):
        walk.add({"declaration": "name = zero; columns = 1 / (c.supply_v - c.supply_v)"})


def test_takes_that_cannot_be_used_are_named(walk: Walk) -> None:
    post = walk.client.post
    with pytest.raises(Refused, match="has no reference angles; attach some"):
        post(f"/models/{walk.model}/diagnose", {"takes": [walk.mute["name"]]})
    with pytest.raises(Refused, match="subject 'anna' has no take 'tuesday'; there are w1-t1"):
        post(f"/models/{walk.model}/effects", {"effect": CAUSE, "takes": ["tuesday"]})
    with pytest.raises(Refused, match="no rotation 'W_FLEX' is trained in this model; it has I_PIP, M_PIP"):
        post(f"/models/{walk.model}/effects", {"effect": CAUSE, "rotations": ["W_FLEX"]})
    body = {"subject": "ben", "layout": walk.layout, "takes": [walk.takes[0]["id"]]}
    with pytest.raises(Refused, match="is of subject 'anna', not 'ben'") as refused:
        post("/improve", body)
    assert refused.value.status == 409


def test_a_job_cancelled_in_the_middle_leaves_nothing(walk: Walk) -> None:
    before = walk.models()
    names = [take["name"] for take in walk.takes]
    body = {"subject": "anna", "layout": walk.layout, "takes": names, "method": "lmc_gpr", "seed": 9}
    job = walk.client.post("/improve", body)["id"]
    until = time.monotonic() + 300
    while not (document := walk.client.get(f"/jobs/{job}"))["sentence"].startswith(("measuring", "looking")):
        assert document["state"] in ("queued", "running")
        assert time.monotonic() < until
        time.sleep(0.01)
    assert 0 < document["fraction"] < 1
    with pytest.raises(Refused, match=f"job {job} is running; it has a page once it is done"):
        walk.client.download(f"/jobs/{job}/report")
    walk.client.post(f"/jobs/{job}/cancel")
    with pytest.raises(ServiceError, match="cancelled"):
        walk.client.wait_for_job(job, poll_s=0.02, patience_s=300)
    assert walk.models() == before
    trained = next(row["id"] for row in walk.client.get("/jobs") if row["kind"] == "train")
    assert "Training of anna" in walk.client.download(f"/jobs/{trained}/report").decode()


def test_what_takes_could_have_shown_stops_when_it_is_asked_to(walk: Walk) -> None:
    body = {"effects": [CAUSE], "rotations": ["I_PIP"], "sizes_deg": [4.0], "trials": 20}
    job = walk.client.post(f"/models/{walk.model}/detectability", body)["id"]
    until = time.monotonic() + 300
    while not walk.client.get(f"/jobs/{job}")["fraction"]:
        assert time.monotonic() < until
        time.sleep(0.02)
    walk.client.post(f"/jobs/{job}/cancel")
    with pytest.raises(ServiceError, match="cancelled"):
        walk.client.wait_for_job(job, poll_s=0.02, patience_s=300)
    with pytest.raises(Refused, match="no rotation 'GLUE' in this layout"):
        walk.client.post(f"/models/{walk.model}/detectability", {"rotations": ["GLUE"]})
    with pytest.raises(Refused, match="no effect 'glue'"):
        walk.client.post(f"/models/{walk.model}/detectability", {"effects": ["glue"]})


def test_improve_walks_the_loop_and_keeps_every_step(walk: Walk) -> None:
    names = [take["name"] for take in walk.takes]
    body = {"subject": "anna", "layout": walk.layout, "takes": names, "method": "linear", "max_steps": 1}
    job = walk.client.post("/improve", body)
    found = walk.result(job)
    told = walk.client._send("GET", f"/jobs/{job['id']}/events").text
    assert f"base {found['steps'][0]['rmse_deg']:.2f}" in told, "the fall so far"
    base, step = found["steps"]
    assert base["added"] is None
    assert step["added"]["effect"] == CAUSE
    assert step["rmse_deg"] < 0.75 * base["rmse_deg"]
    assert set(step["per_rotation"]) == set(found["noise_floor_deg"]) == set(ROTATIONS)
    assert all({"is_reliable", "is_lower_bound"} <= set(floor) for floor in found["noise_floors"].values())
    lineage = walk.client.get(f"/models/{step['model']}/lineage")
    assert [row["id"] for row in lineage] == [step["model"], base["model"]]
    page = walk.client.download(f"/jobs/{job['id']}/report").decode()
    assert "The error falls from" in page
    takes = [take["id"] for take in walk.takes]
    compared = walk.client.page(f"/models/{step['model']}/report", {"takes": takes[:2]})
    assert "How the error falls" in compared


def test_learning_from_what_is_held_out_is_refused(walk: Walk) -> None:
    body = {"subject": "anna", "layout": walk.layout, "takes": ["w1-t1", "w1-t2"], "holdout": ["w1-t2"]}
    with pytest.raises(Refused, match="'w1-t2' is to be learned from and held out"):
        walk.client.post("/improve", body)
