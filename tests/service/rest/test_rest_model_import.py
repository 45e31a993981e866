"""A model that was exported is imported elsewhere, and a file that is none leaves nothing behind."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy
from effect_models import MODEL
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from glovecal_client.rest import Refused, RestClient
from glovecal_models.calibration.artifact import dump, load, model_id, read_manifest
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

ARTIFACT = dump(MODEL)
JUNK = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-3, 10**9),
    st.floats(),
    st.text(max_size=5),
    st.just([]),
    st.just({}),
)


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[RestClient]:
    with in_process_client(Settings(data=tmp_path / "elsewhere")) as client:
        yield client


@pytest.fixture
def kept(tmp_path: Path) -> Callable[[bytes], Path]:
    def keep(content: bytes) -> Path:
        file = tmp_path / "model.safetensors"
        file.write_bytes(content)
        return file

    return keep


def changed(manifest: dict) -> bytes:
    """The artifact with another manifest."""
    arrays = safetensors.numpy.load(ARTIFACT)
    return safetensors.numpy.save(arrays, metadata={"manifest": json.dumps(manifest)})


def everything(client: RestClient) -> tuple:
    return tuple(client.get(path) for path in ("/models", "/subjects", "/gloves"))


def test_it_predicts_as_where_it_was_trained(
    client: RestClient, elsewhere: RestClient, write_table: Callable[..., Path], kept
) -> None:
    client.post("/subjects", {"name": "anna"})
    client.upload_takes(write_table(), subject="anna")
    job = client.post("/models/train", {"subject": "anna", "method": "linear"})
    model = client.wait_for_job(job["id"], patience_s=300)["result"]["model"]
    file = kept(client.download(f"/models/{model}/export"))
    with pytest.raises(Refused, match="no subject 'anna'"):
        elsewhere.import_model(file)
    found = elsewhere.import_model(file, create_subject=True)
    assert (found["is_new"], found["layout_is_new"], found["subject_created"]) == (True, True, True)
    here = client.get(f"/models/{model}")
    there = elsewhere.get(f"/models/{model}")
    assert not there["active"]
    assert {**there, "facts": 0, "created_at": 0} == {**here, "facts": 0, "created_at": 0, "active": False}
    readings = {"readings": np.random.default_rng(1).uniform(0, 250, (20, 2)).tolist()}
    assert elsewhere.post(f"/models/{model}/predict", readings) == client.post(
        f"/models/{model}/predict", readings
    )
    assert elsewhere.post(f"/models/{model}/activate")["model"] == model
    again = elsewhere.import_model(file, create_subject=True)
    assert (again["is_new"], again["model"]["active"]) == (False, True)
    with pytest.raises(Refused, match="belongs to subject 'anna'") as refused:
        elsewhere.import_model(file, subject="ben", create_subject=True)
    assert refused.value.status == 409
    takes = elsewhere.upload_takes(write_table(), subject="anna", layout=there["layout"])["imported"]
    compared = elsewhere.post(f"/models/{model}/compare", {"takes": takes})
    assert compared["trained_on"] == takes, "they are known by their bytes"


def test_takes_that_it_was_trained_on_are_known_again(
    client: RestClient, elsewhere: RestClient, write_table: Callable[..., Path], kept
) -> None:
    for service in (client, elsewhere):
        service.post("/subjects", {"name": "anna"})
        service.upload_takes(write_table(), subject="anna")
    job = client.post("/models/train", {"subject": "anna", "method": "linear"})
    model = client.wait_for_job(job["id"], patience_s=300)["result"]["model"]
    found = elsewhere.import_model(kept(client.download(f"/models/{model}/export")))["model"]
    takes = [take["id"] for take in elsewhere.get("/takes")]
    assert [take["id"] for take in found["facts"]["takes"]] == takes
    assert elsewhere.post(f"/models/{model}/compare", {"takes": takes})["trained_on"] == takes


def test_a_layout_of_the_same_name_with_other_sensors_is_refused(elsewhere: RestClient, kept) -> None:
    document = read_manifest(ARTIFACT)["layout"]
    other = {"sensors": ["A", "B"], "rotations": {"I_MCP": ["A"]}}
    elsewhere.put(f"/gloves/{document['name']}", other)
    before = everything(elsewhere)
    with pytest.raises(Refused, match="has other sensors or rotations here") as refused:
        elsewhere.import_model(kept(ARTIFACT), subject="anna", create_subject=True)
    assert refused.value.status == 409
    assert everything(elsewhere) == before


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "header of 0 bytes"),
        (b"time_s,s.I_MCP\n0,1\n", "not a model artifact"),
        (ARTIFACT[:-1], "cannot be restored"),
        (ARTIFACT[: len(ARTIFACT) // 2], "not a model artifact"),
        (changed({"format": "other"}), "not a glovecal.model.v1 artifact"),
        (changed({**read_manifest(ARTIFACT), "rotations": [], "effects": []}), "no rotation"),
        (dump(replace(MODEL, sensor_centre=np.zeros(7))), "no model was imported"),
        (changed({**read_manifest(ARTIFACT), "subject": "../../etc"}), "subject"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_model_changes_nothing(
    elsewhere: RestClient, tmp_path: Path, kept, content: bytes, why: str
) -> None:
    before = everything(elsewhere)
    with pytest.raises(Refused, match=why) as refused:
        elsewhere.import_model(kept(content), create_subject=True)
    assert refused.value.status == 422
    assert everything(elsewhere) == before
    assert list((tmp_path / "elsewhere" / "uploads").iterdir()) == []


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_manifest_with_anything_in_it_is_refused_or_works(elsewhere: RestClient, kept, data) -> None:
    manifest = read_manifest(ARTIFACT)
    place: dict | list = manifest
    for _ in range(data.draw(st.integers(0, 3))):
        keys = list(place) if isinstance(place, dict) else range(len(place))
        inner = [key for key in keys if isinstance(place[key], dict | list) and place[key]]
        if not inner:
            break
        place = place[data.draw(st.sampled_from(inner))]
    keys = list(place) if isinstance(place, dict) else list(range(len(place)))
    place[data.draw(st.sampled_from(keys))] = data.draw(JUNK)
    content = changed(manifest)
    try:
        model = elsewhere.import_model(kept(content), subject="anna", create_subject=True)["model"]
    except Refused as refused:
        if refused.status not in (409, 422):
            raise
        return
    assert model["id"] == model_id(content)
    assert elsewhere.get(f"/models/{model['id']}")["layout"] == load(content).layout.name


def test_the_senders_id_is_compared(elsewhere: RestClient, kept: Callable[[bytes], Path]) -> None:
    """A flipped bit may well give a model that predicts: only its name tells that it is another one."""
    id = model_id(ARTIFACT)
    flipped = bytearray(ARTIFACT)
    flipped[-3] ^= 1  # the last bits of a weight
    file = kept(bytes(flipped))
    with pytest.raises(Refused, match=f"the sender's is {id[:12]}, this file is .* send it again"):
        elsewhere.import_model(file, create_subject=True, id=id)
    named = file.rename(file.with_name(f"anna-glove-{id[:12]}.safetensors"))
    with pytest.raises(Refused, match="changed on its way"):
        elsewhere.import_model(named, create_subject=True)
    assert elsewhere.get("/models") == []
    named.write_bytes(ARTIFACT)
    assert elsewhere.import_model(named, create_subject=True)["is_new"]


@pytest.mark.parametrize(
    ("where", "value"),
    [
        ("uncertain_above_deg", -1.0), ("uncertain_above_deg", 1e300), ("held_out_rmse_deg", -2.0),
        ("held_out_rmse_deg", 1e12), ("held_out_rmse_deg", "2"), ("samples", -5), ("samples", 1e15),
    ],
)  # fmt: skip
def test_absurd_numbers_are_refused(
    elsewhere: RestClient, kept: Callable[[bytes], Path], where: str, value: object
) -> None:
    manifest = read_manifest(ARTIFACT)
    manifest["rotations"][0][where] = value
    with pytest.raises(Refused, match=rf"{where} is .*; it lies between 0 and"):
        elsewhere.import_model(kept(changed(manifest)), create_subject=True)
    assert elsewhere.get("/models") == []


def test_a_weight_beyond_any_trained_one_is_refused(
    elsewhere: RestClient, kept: Callable[[bytes], Path]
) -> None:
    arrays = safetensors.numpy.load(ARTIFACT)
    name = next(iter(arrays))
    arrays[name] = np.full_like(arrays[name], 1e20)
    metadata = {"manifest": json.dumps(read_manifest(ARTIFACT))}
    with pytest.raises(Refused, match="must be finite float64, at most 1e"):
        elsewhere.import_model(kept(safetensors.numpy.save(arrays, metadata=metadata)), create_subject=True)
