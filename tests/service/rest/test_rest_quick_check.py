"""``quick-check`` over REST and on the command line: a child that knows the wearing, and what is refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

PLAN = SessionPlan(
    3, sensors=("I_MCP", "I_PIP"), wearings=2, takes_per_wearing=2, take_s=12, motions=("natural", "poses")
)
TUESDAY = "wearing-3"


@dataclass(frozen=True)
class Worn:
    """Subject ``anna`` with a linear model of two wearings, and takes of a third."""

    client: RestClient
    model: str
    folder: Path

    def check(self, take: str, **options: Any) -> dict[str, Any]:
        return self.client.post(f"/models/{self.model}/quick-check", {"takes": [take], **options})


@pytest.fixture(scope="module")
def worn(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Worn]:
    folder = tmp_path_factory.mktemp("worn")
    session = record_session(PLAN, [Cause("donning_shift", strength_deg=5, form="offset")])
    poses = session.also("poses", 10, 2).take
    mute = replace(poses, rotations=(), reference_time_s=np.empty(0), reference=np.empty((0, 0)))
    named = replace(mute, name="named", readings=poses.readings + 1e-3)
    nothing = replace(named, name="nothing", poses=None, readings=poses.readings + 2e-3)
    write_takes(list(session.takes), folder / "training.csv")
    write_takes([poses, session.also("natural", 12, 2).take], folder / "tuesday.csv")
    write_takes([named], folder / "named.csv")
    write_takes([nothing], folder / "nothing.csv")
    with in_process_client(Settings(data=folder / "data")) as client:
        client.post("/subjects", {"name": "anna"})
        layout = client.upload_takes(folder / "training.csv", subject="anna")["layout"]
        body = {"subject": "anna", "layout": layout, "method": "linear"}
        trained = client.wait_for_job(client.post("/models/train", body)["id"], poll_s=0.02)
        for name in ("tuesday", "named", "nothing"):
            client.upload_takes(folder / f"{name}.csv", subject="anna", layout=layout)
        yield Worn(client, trained["result"]["model"], folder)


def test_a_check_stores_a_child_that_predicts_the_wearing_better(worn: Worn) -> None:
    found = worn.check("w3-poses-1")
    assert (found["wearing"], found["parent"], found["active"]) == (TUESDAY, worn.model, False)
    assert len(found["poses"]) == 5
    expected = found["expected"]
    assert expected["full_calibration_deg"] < expected["after_deg"] < expected["now_deg"]
    assert "2 wearings without separating them" in found["sentences"][-1]
    child = worn.client.get(f"/models/{found['model']}")
    assert child["effects"] == ["donning_shift"]
    assert child["facts"]["quick_check"]["wearing"] == TUESDAY
    parent = worn.client.get(f"/models/{worn.model}")
    assert child["facts"]["takes"] == parent["facts"]["takes"]
    natural = next(row["id"] for row in worn.client.get("/takes") if row["name"] == "w3-natural-1")
    before, after = (
        worn.client.post(f"/models/{model}/compare", {"takes": [natural]})["overall"]["rmse_deg"]
        for model in (worn.model, child["id"])
    )
    assert after < 0.7 * before
    assert found["as_found_deg"] > found["as_left_deg"]
    assert found["sentences"][0].startswith(f"As found: {found['as_found_deg']:.1f} degrees in wearing")
    history = worn.client.get("/subjects/anna/history")
    first, checked = history["rows"][0], next(row for row in history["rows"] if row["model"] == child["id"])
    assert (first["kind"], first["as_found_deg"]) == ("calibration", None)
    assert first["rmse_unseen_wearing_deg"] > first["held_out_rmse_deg"]
    assert (checked["kind"], checked["wearing"]) == ("quick check", TUESDAY)
    assert (checked["as_found_deg"], checked["as_left_deg"]) == (found["as_found_deg"], found["as_left_deg"])
    assert not history["is_full_calibration_due"]


def test_activated_at_once_and_undone_by_rolling_back(worn: Worn) -> None:
    found = worn.check("w3-poses-1", activate=True)
    assert found["active"]
    assert worn.client.get(f"/models/{found['model']}")["active"]
    layout = worn.client.get(f"/models/{worn.model}")["layout"]
    worn.client.post("/models/rollback", {"subject": "anna", "layout": layout})
    assert worn.client.get(f"/models/{worn.model}")["active"]


def test_the_subjects_own_poses_give_names_their_angles(worn: Worn) -> None:
    found = worn.check("named")
    assert {(pose["measured"], pose["by_name"]) for pose in found["poses"]} == {(0, 2)}
    assert {"overbend", "thumb_up"} <= {item["pose"].split()[1] for item in found["poses"]}


def test_what_tells_nothing_is_refused(worn: Worn) -> None:
    count = len(worn.client.get("/models"))
    with pytest.raises(Refused, match="nothing was measured, and the pose has no name") as refused:
        worn.check("nothing")
    assert refused.value.status == 422
    with pytest.raises(Refused, match="'wearing-1' was in the model's training"):
        worn.check("w1-t2")
    with pytest.raises(Refused, match="has no take 'yesterday'"):
        worn.check("yesterday")
    assert len(worn.client.get("/models")) == count
