"""Files of movement laboratories and of robotics hold against readers that nobody here wrote."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from pathlib import Path

import c3d
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

sys.path.insert(0, str(Path(__file__).parent))

from posed_hands import RATE_HZ, moving

from glovecal_models.errors import BadInput
from glovecal_service.exports.formats import FORMATS, require_possible
from glovecal_service.exports.marker_tables import markers


def test_c3d_holds_every_joint_of_both_hands(tmp_path: Path) -> None:
    pytest.importorskip("ezc3d", reason="ezc3d has no package for Linux on ARM")
    hands = [moving("R"), moving("L")]
    gappy = replace(hands[0], degrees=hands[0].degrees.copy())
    gappy.degrees[3] = np.nan
    FORMATS[".c3d"].write([gappy, hands[1]], "joints", tmp_path / "both.c3d")
    with (tmp_path / "both.c3d").open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of no analogue data
        read = c3d.Reader(stream)
        names = [label.strip() for label in read.point_labels]
        frames = [points for _, points, _ in read.read_frames()]
        assert read.point_rate == pytest.approx(RATE_HZ, rel=1e-6)
    wanted = markers(hands[0], "joints") | markers(hands[1], "joints")
    assert names == list(wanted)
    for number, points in enumerate(frames):
        for row, (name, places) in zip(points, wanted.items(), strict=True):
            if number == 3 and name.startswith("R_"):
                assert row[3] < 0, "not seen"
            else:
                np.testing.assert_allclose(row[:3], places[number], atol=1e-3)
    assert len(frames) == len(hands[0].time_s)


def test_mcap_holds_the_angles_their_deviations_and_times(tmp_path: Path) -> None:
    hands = [moving("R"), moving("L")]
    hands[0].degrees[5, 2] = np.nan
    FORMATS[".mcap"].write(hands, "angles", tmp_path / "both.mcap")
    types = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, list] = {}
    with (tmp_path / "both.mcap").open("rb") as stream:
        for schema, channel, one in make_reader(stream).iter_messages():
            assert schema is not None
            assert (schema.name, schema.encoding) == ("sensor_msgs/msg/JointState", "ros2msg")
            message = types.deserialize_cdr(one.data, schema.name)
            found.setdefault(channel.topic, []).append((one.log_time, message))
    topics = ("joint_states", "deviations")
    assert set(found) == {f"/glovecal/{side}/{topic}" for side in ("left", "right") for topic in topics}
    for hand, side in zip(hands, ("right", "left"), strict=True):
        times, messages = zip(*found[f"/glovecal/{side}/joint_states"], strict=True)
        np.testing.assert_array_equal(times, np.round((hand.time_s - hand.time_s[0]) * 1e9))
        for frame, message in enumerate(messages):
            known = np.isfinite(hand.degrees[frame])
            assert list(message.name) == [name for at, name in enumerate(hand.rotations) if known[at]]
            np.testing.assert_allclose(np.degrees(message.position), hand.degrees[frame][known], atol=1e-9)
        deviations = found[f"/glovecal/{side}/deviations"][0][1]
        np.testing.assert_allclose(np.degrees(deviations.position), hand.sd_deg[0], atol=1e-9)


def test_what_is_not_installed_is_said_with_its_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("glovecal_service.exports.formats.find_spec", lambda _: None)
    with pytest.raises(BadInput, match=r"a \.c3d file needs ezc3d, which is not installed"):
        require_possible(FORMATS[".c3d"], "joints")


def test_more_frames_than_c3d_counts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="70000 frames are too many for C3D"):
        FORMATS[".c3d"].write([moving(count=70_000)], "joints", tmp_path / "long.c3d")
