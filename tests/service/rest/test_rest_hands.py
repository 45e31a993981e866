"""Hand dimensions of subjects over REST, and the skeleton that viewers get."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton, skeleton_document


def test_the_skeleton_is_that_of_the_subject(client: RestClient) -> None:
    measured = {"hand_length": 176.0, "I_distal": 20.0}
    client.post("/subjects", {"name": "ben", "dimensions": measured, "hand": "left"})
    assert client.get("/subjects/ben")["hand"] == "left"
    dimensions = HandDimensions.from_measured(measured)
    assert client.get("/subjects/ben/skeleton") == skeleton_document(hand_skeleton(dimensions, "left"))
    other = client.get("/subjects/ben/skeleton", {"hand": "right"})
    assert other == skeleton_document(hand_skeleton(dimensions, "right"))
    changed = client.put("/subjects/ben/hand", {"dimensions": {"hand_length": 180}, "hand": "right"})
    assert (changed["dimensions"], changed["hand"]) == ({"hand_length": 180.0}, "right")
    sizes = client.get("/subjects/ben/skeleton")["dimensions"]
    assert sizes["measured"] == ["hand_length"]
    assert np.isclose(sizes["sizes"]["I_distal"], 0.097 * 180)


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ({"dimensions": {"hand_length": 19}, "hand": "right"}, "hand_length is 19 mm; a hand's length lies"),
        ({"dimensions": {"I_middle": 30}, "hand": "right"}, "hand_length is missing: measure in mm"),
        ({"dimensions": {"nose": 30}, "hand": "right"}, "a hand has no dimension 'nose'"),
        ({"dimensions": {"hand_length": 190}, "hand": "third"}, "hand"),
        ({"dimensions": {"hand_length": "190"}, "hand": "left"}, "hand_length"),
    ],
)
def test_what_no_hand_is_gets_a_sentence(shared: RestClient, body: dict, sentence: str) -> None:
    with pytest.raises(Refused) as refused:
        shared.put("/subjects/anna/hand", body)
    assert refused.value.status == 422
    assert sentence in str(refused.value.problem)
    assert shared.get("/subjects/anna")["dimensions"] == {}


def test_nobody_has_no_hand(shared: RestClient) -> None:
    for call in (
        lambda: shared.get("/subjects/nobody/skeleton"),
        lambda: shared.put("/subjects/nobody/hand", {"dimensions": {}, "hand": "left"}),
    ):
        with pytest.raises(Refused) as refused:
            call()
        assert refused.value.status == 404
    with pytest.raises(Refused) as refused:
        shared.get("/subjects/anna/skeleton", {"hand": "both"})
    assert refused.value.status == 422


def test_errors_in_mm_are_those_of_the_subjects_hand(
    client: RestClient, write_table: Callable[..., Path]
) -> None:
    client.post("/subjects", {"name": "anna"})
    takes = client.upload_takes(write_table(), subject="anna")["takes"]
    body = {"subject": "anna", "layout": takes[0]["layout"], "method": "linear", "folds": 0}
    job = client.wait_for_job(client.post("/models/train", {**body, "takes": [takes[0]["id"]]})["id"])
    model, against = job["result"]["model"], {"takes": [takes[1]["id"]]}
    assumed = client.post(f"/models/{model}/compare", against)["fingertips"]
    assert (assumed["hand_length_mm"], assumed["is_assumed"]) == (190.0, True)
    assert set(assumed["fingers"]) == {"index"}
    assert assumed["fingers"]["index"]["assumed_equal"] == ["I_DIP", "IM_ABD"]
    assert assumed["thumb_index"] is None
    client.put("/subjects/anna/hand", {"dimensions": {"hand_length": 95}, "hand": "left"})
    own = client.post(f"/models/{model}/compare", against)["fingertips"]
    assert own["is_assumed"] is False
    assert own["overall"]["rmse_mm"] == pytest.approx(assumed["overall"]["rmse_mm"] / 2)
    page = client.page(f"/models/{model}/report", against)
    assert ">Fingertips</h2>" in page
    assert own["sentence"] in page
    assert "largest error, take b at" in page


def test_a_hand_whose_palm_arches_has_one_joint_more(client: RestClient) -> None:
    client.post("/subjects", {"name": "arne", "dimensions": {"hand_length": 176.0}})
    dimensions = HandDimensions.from_measured({"hand_length": 176.0})
    expected = skeleton_document(hand_skeleton(dimensions, "right", "arching"))
    assert client.get("/subjects/arne/skeleton", {"palm": "arching"}) == expected
    with pytest.raises(Refused, match="palm"):
        client.get("/subjects/arne/skeleton", {"palm": "cupped"})
