"""Another program's calibration over REST: in as a model, out as the same text; wrong files are named."""

from __future__ import annotations

import pytest

from glovecal_client.rest import Refused, RestClient
from glovecal_models.layout import Layout
from glovecal_service.exports.vendor_calibrations import cyberglove
from glovecal_service.exports.vendor_calibrations.calibration_format import Counts, SensorLine

SENSORS = Layout.built_in("cyberglove22").sensors
TEXT = cyberglove.write_asr(dict.fromkeys(SENSORS, SensorLine(0.8, 60.0)), Counts(1.0, 255.0), "right")
BODY = {"format": "asr", "text": TEXT, "layout": "cyberglove22", "subject": "anna"}


def test_in_and_out_again(client: RestClient) -> None:
    with pytest.raises(Refused, match="anna"):
        client.post("/models/calibrations", BODY)
    found = client.post("/models/calibrations", BODY | {"create_subject": True})
    assert (found["is_new"], found["subject_created"]) == (True, True)
    model = found["model"]["id"]
    assert not found["model"]["active"]
    line = next(each for each in client.get(f"/models/{model}")["rotations"] if each["rotation"] == "I_MCP")[
        "line"
    ]
    assert list(line["scale_deg"]) == ["I_MCP"]
    assert line["scale_deg"]["I_MCP"] == pytest.approx(0.8)
    assert line["offset_deg"] == pytest.approx(-0.8 * 60.0)
    assert client.get(f"/models/{model}/calibration", {"format": "asr"})["text"] == TEXT
    assert client.post("/models/calibrations", BODY)["is_new"] is False


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"text": "no calibration"}, "1 line; an ASR calibration has 22"),
        ({"format": "excel"}, "format"),
        ({"layout": "nobodys"}, "nobodys"),
        ({"text": "x" * 3_000_000}, "text"),
        ({"format": "shadow_xml", "text": '<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>'}, r"\w"),
    ],
)
def test_what_is_none_is_refused(client: RestClient, change: dict[str, str], says: str) -> None:
    client.post("/subjects", {"name": "anna"})
    with pytest.raises(Refused, match=says) as refused:
        client.post("/models/calibrations", BODY | change)
    assert refused.value.status in (404, 422)
    assert client.get("/models") == []
