"""Calibrations of other programs: written and read again, hand-made after the known sources, and wild."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.methods import Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.simulation.protocol import evaluation_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_service.exports.vendor_calibrations import cyberglove
from glovecal_service.exports.vendor_calibrations.calibration_format import Counts, SensorLine
from glovecal_service.exports.vendor_calibrations.formats import (
    FORMATS,
    calibration_format,
    read_model,
    recognised,
    write_model,
)
from glovecal_service.exports.vendor_calibrations.shadow import lines_through

LAYOUT22, LUCID = Layout.built_in("cyberglove22"), Layout.built_in("lucidglove")
EIGHT, TWELVE = Counts(1.0, 255.0), Counts(1.0, 4095.0)
HOMUNCULUS = Layout.built_in("homunculus")
KNUCKLES = tuple(f"{finger}_MCP" for finger in "TIMRP")
LAYOUT_OF = dict.fromkeys(FORMATS, LAYOUT22) | {
    "opengloves": LUCID,
    "lerobot": Layout.from_columns("knuckles", KNUCKLES, KNUCKLES),
}
WILD = st.text(max_size=400) | st.from_regex(r"([0-3] +-?[0-9.]+ +-?[0-9.e]+ +0\n){0,30}", fullmatch=True)
LINE = st.builds(
    SensorLine,
    st.floats(0.05, 3.0) | st.floats(-3.0, -0.05),
    st.integers(0, 255).map(float),
)


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "lerobot"])
@pytest.mark.parametrize("hand", ["right", "left"])
@given(data=st.data())
@settings(max_examples=25)
def test_what_is_written_is_read_again(name: str, hand, data: st.DataObject) -> None:
    form, layout = FORMATS[name], LAYOUT_OF[name]
    lines = data.draw(st.dictionaries(st.sampled_from(layout.sensors), LINE, min_size=1))
    again = form.read(form.write(lines, EIGHT, hand), EIGHT, hand).lines
    assert set(again) == set(lines)
    for sensor, line in lines.items():
        for reading in (10.0, 128.0, 250.0):
            angle, found = (each.gain * (reading - each.zero) for each in (line, again[sensor]))
            assert found == pytest.approx(angle, abs=0.1)  # five decimals of radians a count


@pytest.mark.parametrize("name", FORMATS)
@given(data=st.data())
@settings(max_examples=25)
def test_a_file_is_recognised_by_what_it_holds_also_cut_short(name: str, data: st.DataObject) -> None:
    form, layout = FORMATS[name], LAYOUT_OF[name]
    lines = data.draw(st.dictionaries(st.sampled_from(layout.sensors), LINE, min_size=1))
    text = form.write(lines, EIGHT, "right")
    assert [one.name for one in FORMATS.values() if one.recognises(text)] == [name]
    cut = text[: data.draw(st.integers(0, len(text)))]
    assert recognised(cut) in (form, None)
    assert recognised("\ufeff" + text) in (form, None)


def test_the_makers_dialect_is_recognised_and_tables_are_not() -> None:
    rows = "".join(f"{row} 70 0.018 1\n" for row in range(4))
    dcu = "DCU calibration\n" + "".join(f"{name}\n{rows}" for name in ("Thumb", "Index", "Middle"))
    assert recognised(dcu) is FORMATS["virtualhand"]
    for text in ("", "time_s,s.A\n0,1\n", "Thumb;Index\n0 1\n", "time 10:20 10:30\n", "{}", '{"thumb": 3}'):
        assert recognised(text) is None


@pytest.mark.parametrize("name", FORMATS)
@given(
    text=st.text(max_size=400) | st.from_regex(r"([0-3] +-?[0-9.]+ +-?[0-9.e]+ +0\n){0,30}", fullmatch=True)
)
@settings(max_examples=60)
def test_wild_text_is_refused_with_a_sentence(name: str, text: str) -> None:
    try:
        model, _ = read_model(text, FORMATS[name], LAYOUT_OF[name], "anna", "right")
    except BadInput:
        return
    GlovePredictor(model).predict(np.full((1, len(LAYOUT_OF[name].sensors)), 100.0))


@pytest.mark.parametrize("name", FORMATS)
@given(data=st.data())
@settings(max_examples=40)
def test_damaged_files_give_finite_lines_or_a_sentence(name: str, data: st.DataObject) -> None:
    form, layout = FORMATS[name], LAYOUT_OF[name]
    text = form.write(dict.fromkeys(layout.sensors, SensorLine(0.7, 80.0)), EIGHT, "right")
    at = data.draw(st.integers(0, len(text) - 1))
    wild = data.draw(st.sampled_from(["", "nan", "1e400", "-", "\n", "[", "<!DOCTYPE a>", "9" * 400, ":"]))
    try:
        found = form.read(text[:at] + wild + text[at + data.draw(st.integers(0, 5)) :], EIGHT, "right")
    except BadInput:
        return
    assert found.lines
    assert all(math.isfinite(each.gain) and math.isfinite(each.zero) for each in found.lines.values())


def test_virtualhand_in_the_makers_own_words() -> None:
    """radians = (reading - offset) x (-gain), flexion negative; a gain stands with what it moves."""
    label = {0: "Thumb", 1: "Index", 2: "Middle", 3: "Ring", 4: "Pinky", 5: "Palm"}
    rows = {(1, 0): (70, 0.018), (2, 3): (200, 0.0), (1, 3): (0, 0.012), (5, 2): (120, 0.01)}
    text = "DCU calibration\n" + "".join(
        f"{label[group]}\n"
        + "".join("{} {} {} 1\n".format(row, *rows.get((group, row), (0, 0.0))) for row in range(4))
        for group in range(6)
    )
    found = cyberglove.read_virtualhand(text, EIGHT, "right").lines
    assert set(found) == {"I_MCP", "IM_ABD", "W_ABD"}
    assert found["I_MCP"].gain * (170 - found["I_MCP"].zero) == pytest.approx(math.degrees(100 * 0.018))
    assert found["IM_ABD"].gain * (150 - found["IM_ABD"].zero) == pytest.approx(math.degrees(50 * 0.012))
    left = cyberglove.read_virtualhand(text, EIGHT, "left").lines
    assert left["W_ABD"].gain == -found["W_ABD"].gain
    assert left["IM_ABD"].gain == found["IM_ABD"].gain
    finer = cyberglove.read_virtualhand(text, TWELVE, "right").lines["I_MCP"]
    assert finer.gain * (16 * 170 - finer.zero) == pytest.approx(math.degrees(100 * 0.018))


def test_asr_begins_at_the_wrist_and_bends_with_negative_radians() -> None:
    rows = ["0.0:60.0 0.0:144.0"] * 22
    rows[cyberglove.ORDER.index("I_MCP")] = "0.000000:71.000000 -1.500000:170.000000"
    found = cyberglove.read_asr("\n".join(rows), EIGHT, "right")
    assert found.lines["I_MCP"].reading(0.0) == pytest.approx(71.0)
    assert found.lines["I_MCP"].reading(math.degrees(1.5)) == pytest.approx(170.0)
    assert found.left_out["PALM_ARCH"] == "both points tell one angle or one reading"


def test_asr_abductions_fall_as_fingers_spread() -> None:
    """The signs of both published files, with numbers of our own."""
    rows = ["0.0:60.0 0.0:144.0"] * 22
    falling, rising = "-0.2:180.0 0.3:70.0", "0.4:140.0 -0.1:60.0"
    for sensor, row in (("TI_ABD", falling), ("IM_ABD", falling), ("MR_ABD", rising), ("RP_ABD", rising)):
        rows[cyberglove.ORDER.index(sensor)] = row
    found = cyberglove.read_asr("\n".join(rows), EIGHT, "right")
    assert len(found.lines) == 4
    assert all(line.gain < 0 for line in found.lines.values())


@pytest.mark.parametrize("name", FORMATS)
def test_points_that_are_hardly_apart_tell_no_line(name: str) -> None:
    form, layout = FORMATS[name], LAYOUT_OF[name]
    good, steep = layout.sensors[0], layout.sensors[1]
    text = form.write({good: SensorLine(0.7, 80.0), steep: SensorLine(1e4, 80.0)}, EIGHT, "right")
    _, found = read_model(text, form, layout, "anna", "right")
    assert steep not in found.lines
    assert "too close together" in found.left_out[steep] or "one reading" in found.left_out[steep]


def test_shadow_leaves_out_what_is_no_line_or_was_switched_off() -> None:
    points = {
        "G_IndexMPJ": [(0.25, 0.0), (0.75, 90.0)],
        "G_IndexPIJ": [(0.0, 0.0), (0.5, 10.0), (1.0, 90.0)],
        "G_PalmArch": [(-0.001, 0.0), (0.0, 40.0)],
        "G_Elbow": [(0.0, 0.0), (1.0, 1.0)],
    }
    found = lines_through(points, EIGHT)
    assert set(found.lines) == {"I_MCP"}
    assert found.lines["I_MCP"].reading(90.0) == pytest.approx(1 + 254 * 0.75)
    assert "degrees from a line" in found.left_out["I_PIP"]
    assert found.left_out["PALM_ARCH"] == "2 points tell no line"
    assert found.left_out["G_Elbow"] == "no such joint is known"


@pytest.mark.parametrize(("off_deg", "is_told"), [(0.3, False), (4.0, True), (16.0, True)])
def test_a_line_of_shadow_that_misses_its_three_points_is_told(off_deg: float, is_told: bool) -> None:
    points = {
        "G_IndexMPJ": [(0.2, 0.0), (0.5, 45.0 + off_deg), (0.8, 90.0)],
        "G_IndexPIJ": [(0.2, 0.0), (0.8, 90.0)],
    }
    text = repr(
        {"cyberglove_calibration": [[name, [list(each) for each in own]] for name, own in points.items()]}
    )
    _, found = read_model(text, FORMATS["shadow_yaml"], LAYOUT22, "anna", "right")
    told = {**found.left_out, **found.doubts}
    assert ("I_MCP" in told) == is_told
    assert "I_PIP" not in told
    if is_told:
        assert "3 points" in told["I_MCP"]
        assert f"{off_deg * 2 / 3:.0f}" in told["I_MCP"]


def test_both_styles_of_yaml_say_the_same() -> None:
    flow = "{'cyberglove_calibration': [\n['G_IndexMPJ', [[0.3,0.0],[0.5,90.0]]],\n]}"
    block = "cyberglove_calibration:\n- - G_IndexMPJ\n  - - - 0.3\n      - 0.0  # 1\n    - [0.5, 90.0]\n"
    form = calibration_format("shadow_yaml")
    assert form.read(flow, EIGHT, "right") == form.read(block, EIGHT, "right")


@pytest.mark.parametrize(
    "text",
    [
        '<!DOCTYPE a [<!ENTITY b "c">]><Cyberglove_calibration/>',
        '<?xml version="1.0"?><!DOCTYPE a SYSTEM "o"><Cyberglove_calibration>&b;</Cyberglove_calibration>',
        "<!--<!DOCTYPE a>--><Cyberglove_calibration/>",
    ],
)
def test_xml_with_a_document_type_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="document type"):
        calibration_format("shadow_xml").read(text, EIGHT, "right")


def predicted(model: CalibrationModel, readings: np.ndarray) -> dict[str, float]:
    """By rotation, of one frame."""
    mean = GlovePredictor(model).predict(readings).mean[0]
    return dict(zip(model.rotation_names, mean.tolist(), strict=True))


def test_an_imported_model_predicts_what_the_file_says_and_is_stored() -> None:
    lines = dict.fromkeys(LAYOUT22.sensors, SensorLine(0.8, 60.0))
    for name in ("virtualhand", "asr", "shadow_xml", "shadow_yaml"):
        text = FORMATS[name].write(lines, EIGHT, "right")
        model, _ = read_model(text, FORMATS[name], LAYOUT22, "anna", "right")
        again = load(dump(model))
        angles = GlovePredictor(again).predict(np.full((1, 22), 160.0))
        by_name = dict(zip(again.rotation_names, angles.mean[0], strict=True))
        assert by_name["I_MCP"] == pytest.approx(80.0, abs=0.1)
        assert by_name["T_VIR"] == pytest.approx(80.0, abs=0.1)
        assert angles.sd[0, again.rotation_names.index("I_MCP")] == pytest.approx(5.0)
        assert (again.method, again.takes, again.simulated) == ("linear", (), False)


def test_an_18_sensor_glove_gets_its_last_joints_by_rule() -> None:
    layout = Layout.built_in("cyberglove18")
    text = FORMATS["asr"].write(dict.fromkeys(LAYOUT22.sensors, SensorLine(0.8, 60.0)), EIGHT, "right")
    model, _ = read_model(text, FORMATS["asr"], layout, "anna", "right")
    angles = dict(
        zip(model.rotation_names, GlovePredictor(model).predict(np.full((1, 18), 160.0)).mean[0], strict=True)
    )
    assert angles["I_DIP"] == pytest.approx(2 / 3 * 80.0, abs=0.1)


def test_one_sensor_a_finger_moves_each_joint_through_its_own_range() -> None:
    text = '{"index": {"min": 300, "max": 3800}, "thumb": {"min": 3000, "max": 500}}'
    model, _ = read_model(text, FORMATS["opengloves"], LUCID, "anna", "right")
    assert set(model.rotation_names) == {"I_MCP", "I_PIP", "I_DIP", "T_MCP", "T_IP"}
    bent = dict(
        zip(
            model.rotation_names,
            GlovePredictor(model).predict(np.array([[500.0, 3800, 0, 0, 0]])).mean[0],
            strict=True,
        )
    )
    assert [bent[name] for name in ("I_MCP", "I_PIP", "T_IP")] == pytest.approx([90.0, 100.0, 80.0])
    assert write_model(model, FORMATS["opengloves"], "right").left_out == {}


def trained(method: Method):
    glove = SimulatedGlove(2, LAYOUT22)
    take = simulate_take(glove, evaluation_segment(2), seed=2, rate_hz=20).take
    return take, train([take], LAYOUT22, "anna", TrainingSettings(method=method, folds=0, samples=60))


def test_a_linear_model_goes_out_and_comes_back() -> None:
    take, model = trained("linear")
    written = write_model(model, FORMATS["shadow_yaml"], "right")
    again, _ = read_model(written.text, FORMATS["shadow_yaml"], LAYOUT22, "anna", "right")
    before, after = (GlovePredictor(each).predict(take.readings).mean for each in (model, again))
    for name in ("I_MCP", "RP_ABD", "T_IP", "W_FLEX"):
        columns = model.rotation_names.index(name), again.rotation_names.index(name)
        np.testing.assert_allclose(after[:, columns[1]], before[:, columns[0]], atol=1e-3)


def test_what_is_no_line_of_one_sensor_is_left_out_or_refused() -> None:
    _, model = trained("template")
    assert {"TI_ABD"} <= set(write_model(model, FORMATS["asr"], "right").left_out)
    _, process = trained("lmc_gpr")
    with pytest.raises(BadInput, match="nothing of this model can be written as ASR"):
        write_model(process, FORMATS["asr"], "right")


def test_formats_are_known_by_name() -> None:
    with pytest.raises(BadInput, match="no calibration format 'vh'; there are virtualhand, asr"):
        calibration_format("vh")


LEROBOT = """{
    "thumb_cmc": {"id": 0, "drive_mode": 1, "homing_offset": 0, "range_min": 1700, "range_max": 2600},
    "index_mcp_abduction": {"id": 4, "drive_mode": 1, "homing_offset": 0, "range_min": 150, "range_max": 900},
    "index_mcp_flexion": {"id": 5, "drive_mode": 0, "homing_offset": 0, "range_min": 1500, "range_max": 2500},
    "index_dip": {"id": 6, "drive_mode": 0, "homing_offset": 0, "range_min": 2000, "range_max": 3000},
    "ring_mcp_flexion": {"id": 11, "drive_mode": 1, "homing_offset": 0, "range_min": 1450, "range_max": 3150}
}"""


def test_a_lerobot_calibration_spans_the_hands_range_from_either_end() -> None:
    model, found = read_model(LEROBOT, FORMATS["lerobot"], HOMUNCULUS, "anna", "right")
    assert "middle" in found.left_out["I_ABD"]
    sensors = model.layout.sensors
    straight, bent = (np.full((1, len(sensors)), 2000.0) for _ in range(2))
    ends = {"I_MCP": (1500, 2500), "I_DIP": (2000, 3000), "R_MCP": (3150, 1450)}
    for sensor, (first, last) in ends.items():
        straight[0, sensors.index(sensor)] = first
        bent[0, sensors.index(sensor)] = last
    low, high = predicted(model, straight), predicted(model, bent)
    assert (low["I_MCP"], high["I_MCP"]) == pytest.approx((-10, 90))
    assert (low["I_PIP"], high["I_PIP"]) == pytest.approx((0, 100))
    assert (low["R_MCP"], high["R_MCP"]) == pytest.approx((-10, 90))
    written = json.loads(write_model(model, FORMATS["lerobot"], "right").text)
    for joint in ("index_mcp_flexion", "ring_mcp_flexion"):
        assert written[joint] == json.loads(LEROBOT)[joint]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"index_mcp_flex": {"range_min": 1, "range_max": 2}}, "did you mean 'index_mcp_flexion'"),
        ({"index_dip": {"range_min": 1}}, 'must have "range_min" and "range_max"'),
        ({"index_dip": {"range_min": 9, "range_max": 2}}, "exchange them"),
        ({"index_dip": {"range_min": 1, "range_max": 2, "drive_mode": 3}}, "drive_mode 3 must be 0 or 1"),
        ({"index_dip": {"range_min": 1, "range_max": "many"}}, "'many' is no number"),
        ({"index_dip": {"range_min": 7, "range_max": 7}}, "are one reading"),
    ],
)
def test_what_a_lerobot_calibration_cannot_say_is_refused(wrong: dict, said: str) -> None:
    with pytest.raises(BadInput, match=re.escape(said)):
        FORMATS["lerobot"].read(json.dumps(wrong), TWELVE, "right")
