"""Motion files hold against an independent reader, and two hands stand on one time."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest
import trc
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.errors import BadInput
from glovecal_models.hand.forward_kinematics import forward_kinematics
from glovecal_models.hand.rotations import HAND_ROTATIONS
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_service.exports.formats import FORMATS, format_of, require_possible
from glovecal_service.exports.hand_motion import CONTENTS, HandMotion, on_one_time
from glovecal_service.exports.marker_tables import markers, trc_text

SENSORS = Layout.built_in("cyberglove22").sensors
RIGHT, LEFT = hand_skeleton(hand="right"), hand_skeleton(hand="left")


def motion(label: str = "R", count: int = 40, rate_hz: float = 60.0, begin_s: float = 5.0) -> HandMotion:
    random = np.random.default_rng(3)
    time_s = begin_s + np.arange(count) / rate_hz
    degrees = 20 + 15 * np.sin(time_s[:, None] + np.arange(len(HAND_ROTATIONS)))
    return HandMotion(
        label, time_s, SENSORS, random.integers(0, 4096, (count, len(SENSORS))).astype(float), HAND_ROTATIONS,
        degrees, np.full_like(degrees, 0.7), RIGHT if label == "R" else LEFT,
    )  # fmt: skip


def read(path: Path) -> dict[str, np.ndarray]:
    """(N, 3) by marker, as another program understands the file."""
    data = trc.TRCData()
    data.load(str(path))
    assert data["NumFrames"] == len(data["Frame#"])
    return {name: np.array(data[name], dtype=float) for name in data["Markers"]}


@pytest.mark.parametrize("content", CONTENTS)
def test_another_reader_finds_every_marker_of_both_hands(tmp_path: Path, content) -> None:
    hands = [motion("R"), motion("L")]
    path = tmp_path / "both.trc"
    FORMATS[".trc"].write(hands, content, path)
    found = read(path)
    for hand in hands:
        for name, places in markers(hand, content).items():
            np.testing.assert_allclose(found.pop(name), places, rtol=1e-12)
    assert found == {}


def test_raw_values_are_written_as_they_came(tmp_path: Path) -> None:
    one = motion()
    FORMATS[".trc"].write([one], "raw", tmp_path / "raw.trc")
    found = read(tmp_path / "raw.trc")
    index = found["R_index"]
    for axis, sensor in enumerate(("IM_ABD", "I_MCP", "I_PIP")):
        np.testing.assert_array_equal(index[:, axis], one.readings[:, SENSORS.index(sensor)])
    written = np.concatenate(list(found.values()), axis=1)
    assert {tuple(column) for column in one.readings.T} <= {tuple(column) for column in written.T}


def test_joints_are_where_the_hand_has_them() -> None:
    one = motion()
    places = markers(one, "joints")
    frames = forward_kinematics(RIGHT, one.degrees)
    names = [joint.name for joint in RIGHT.joints]
    np.testing.assert_allclose(places["R_index_pip"], frames.joints_mm[:, names.index("I_PIP")])
    np.testing.assert_allclose(places["R_pinky_tip"], frames.tips_mm[:, 4])
    assert len(places) == 21


def test_every_line_has_the_cells_that_readers_count() -> None:
    one = motion(count=3)
    gap = one.degrees.copy()
    gap[1] = np.nan
    found = markers(replace(one, degrees=gap), "joints")
    head, keys, values, names, axes, empty, *rows = trc_text(one.time_s, found, "a.trc").split("\n")[:-1]
    assert head == "PathFileType\t4\t(X/Y/Z)\ta.trc"
    assert keys.split("\t")[4] == "Units"
    assert values.split("\t")[2:5] == ["3", "21", "mm"]
    assert float(values.split("\t")[0]) == pytest.approx(60)
    assert names.split("\t")[2::3][:21] == list(found)
    assert axes.startswith("\t\tX1\tY1\tZ1\tX2")
    assert empty == ""
    assert [len(row.split("\t")) for row in rows] == [2 + 3 * 21 + 1] * 3  # the last tab ends the last cell
    assert rows[1].split("\t")[2:] == [""] * (3 * 21 + 1)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_tables_hold_what_trc_holds(tmp_path: Path, suffix: str) -> None:
    hands = [motion("R"), motion("L")]
    path = tmp_path / f"both{suffix}"
    format_of(path.name).write(hands, "angles", path)
    if suffix == ".csv":
        table = np.genfromtxt(path, delimiter=",", names=True, deletechars="")
        columns = {name: table[name] for name in table.dtype.names or ()}
    else:
        columns = {
            name: np.array(values) for name, values in pyarrow.parquet.read_table(path).to_pydict().items()
        }
    np.testing.assert_array_equal(columns["R.p.I_PIP"], hands[0].degrees[:, HAND_ROTATIONS.index("I_PIP")])
    np.testing.assert_array_equal(columns["L.sd.I_PIP"], hands[1].sd_deg[:, 0])
    assert not any(name.startswith("r.") for name in columns), "predicted angles are no reference"


def test_hands_of_two_takes_stand_on_the_frames_of_the_first() -> None:
    right, left = motion("R"), motion("L", count=90, rate_hz=100.0, begin_s=4.9)
    one, other = on_one_time([right, left])
    np.testing.assert_array_equal(one.time_s, right.time_s[right.time_s <= left.time_s[-1]])
    np.testing.assert_array_equal(one.time_s, other.time_s)
    exact = 20 + 15 * np.sin(one.time_s[:, None] + np.arange(len(HAND_ROTATIONS)))
    assert np.abs(other.degrees - exact).max() < 0.01
    assert {tuple(row) for row in other.readings} <= {tuple(row) for row in left.readings}
    far = replace(left, time_s=left.time_s + 1000)
    with pytest.raises(BadInput, match=r"no moment in common \(R 5\.0 to .* L 1004\.9"):
        on_one_time([right, far])
    np.testing.assert_allclose(on_one_time([right, far], [0.0, -1000.0])[1].degrees, other.degrees)


@given(st.integers(2, 30), st.integers(0, 29), st.integers(0, 30))
def test_nothing_is_invented_in_a_gap(count: int, gap_at: int, seed: int) -> None:
    whole = motion(count=count)
    time = whole.time_s.copy()
    gap_at = min(gap_at, count - 1)
    time[gap_at:] += 2.0
    at = replace(motion("L", count=200), time_s=5.0 + np.arange(200) * (1 / 60) * (1 + 0.01 * seed))
    found = on_one_time([at, replace(whole, time_s=time)])[1] if time[0] <= at.time_s[-1] else None
    if found is None or not gap_at:
        return
    inside = (found.time_s > time[gap_at - 1] + 2e-6) & (found.time_s < time[gap_at] - 2e-6)
    assert np.isnan(found.degrees[inside]).all()
    outside = (found.time_s <= time[gap_at - 1]) | (found.time_s >= time[gap_at])
    assert np.isfinite(found.degrees[outside]).all()


def test_a_take_without_a_model_has_raw_readings_only(tmp_path: Path) -> None:
    bare = replace(motion(), rotations=(), degrees=np.empty((40, 0)), sd_deg=np.empty((40, 0)))
    for suffix, chosen in FORMATS.items():
        if "raw" in chosen.contents:
            chosen.write([bare], "raw", tmp_path / f"raw{suffix}")
        else:
            with pytest.raises(BadInput, match=rf"\{suffix} cannot hold raw; \.trc, \.csv, \.parquet can"):
                require_possible(chosen, "raw")
        for content in ("angles", "joints"):
            with pytest.raises(BadInput, match="need a model"):
                chosen.write([bare], content, tmp_path / f"x{suffix}")
    with pytest.raises(BadInput, match=r"must end in \.trc, \.bvh, .*\.parquet"):
        format_of("hand.stl")


def test_a_hand_whose_palm_arches_has_the_place_of_its_joint_too() -> None:
    rigid, arching = hand_skeleton(), hand_skeleton(palm="arching")
    plain = replace(motion("R"), skeleton=rigid)
    arched = replace(
        plain, skeleton=arching, rotations=(*plain.rotations, "PALM_ARCH"),
        degrees=np.column_stack([plain.degrees, np.full(len(plain.time_s), 20.0)]),
        sd_deg=np.column_stack([plain.sd_deg, np.ones(len(plain.time_s))]),
    )  # fmt: skip
    before, after = markers(plain, "joints"), markers(arched, "joints")
    assert set(after) - set(before) == {"R_pinky_cmc"}
    np.testing.assert_allclose(after["R_ring_tip"], before["R_ring_tip"])
    assert (np.linalg.norm(after["R_pinky_tip"] - before["R_pinky_tip"], axis=1) > 5).all()
