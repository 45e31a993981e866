"""What may take long is worked out beside the web process: in blocks, with a bound, ended with its time."""

from __future__ import annotations

import re
import time
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import psutil
import pytest
from stored_service import StoredService, stored_service

from glovecal_models.errors import BadInput, BadLayout
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.layout import Layout
from glovecal_service.exports import hand_motion
from glovecal_service.exports.body_markers import read_trc
from glovecal_service.exports.formats import FORMATS
from glovecal_service.exports.hand_motion import HandMotion
from glovecal_service.exports.vendor_calibrations.calibration_format import Counts
from glovecal_service.exports.vendor_calibrations.shadow import read_xml

MANY = 100_000
SOON_S = 20.0
"""What was quadratic took minutes; a loaded computer is not at fault."""


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Iterator[StoredService]:
    with stored_service(tmp_path_factory.mktemp("stored"), "tcp/127.0.0.1:1") as service:
        yield service


def moving(frames: int) -> HandMotion:
    degrees = np.tile([10.0, 20.0], (frames, 1))
    skeleton = hand_skeleton(HandDimensions.from_measured({}), "right", "rigid")
    return HandMotion(
        "R", np.arange(frames) / 120, ("A", "B"), degrees, ("I_MCP", "I_PIP"), degrees, degrees, skeleton
    )


@pytest.mark.parametrize("suffix", [suffix for suffix in FORMATS if suffix != ".c3d"])
def test_ten_times_as_many_frames_need_no_more_memory(
    suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """But for C3D: the library that writes it holds a file whole, of 65,535 frames at most."""
    monkeypatch.setattr(hand_motion, "FRAMES_AT_ONCE", 100, raising=False)
    path = tmp_path / f"motion{suffix}"
    FORMATS[suffix].write([moving(100)], "joints", path)  # loads what it needs

    def most(frames: int) -> int:
        moved = moving(frames)
        tracemalloc.start()
        FORMATS[suffix].write([moved], "joints", path)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return peak

    assert most(1000) < 2.5 * most(100)


def test_an_export_in_a_process_of_its_own_is_the_same(
    stored: StoredService, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = {"takes": [stored.known["take"]], "hands": ["right"], "content": "joints", "format": "csv"}
    before = psutil.Process().children()
    here = stored.http.post("/motion", json=asked)
    monkeypatch.setattr("glovecal_service.exports.motion_file.SHORT", 10)
    beside = stored.http.post("/motion", json=asked)
    assert (here.status_code, beside.status_code) == (200, 200)
    assert beside.content == here.content
    assert set(psutil.Process().children()) <= set(before)


def test_an_answer_has_a_limit_and_leaves_no_process(
    stored: StoredService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("glovecal_service.rest.effect.trial.LIMIT_S", 0.2)
    deep = "c.supply_v * own"
    for _ in range(20):
        deep = f"lowpass({deep}, a + b)"
    text = f"name = deep; columns = {deep}; parameter a s 0.1 5 = 1; parameter b s 0.1 5 = 1"
    before = psutil.Process().children()
    answer = stored.http.post(
        f"/models/{stored.known['model']}/try-effect", json={"effect": {"declaration": text}}
    )
    assert answer.status_code == 422, answer.text
    assert answer.json()["type"].endswith("takes-too-long")
    assert re.search("longer than 0.2 s; ask for less", answer.json()["detail"])
    assert set(psutil.Process().children()) <= set(before)


def test_markers_by_the_hundred_thousand_are_refused_before_they_are_read(tmp_path: Path) -> None:
    path = tmp_path / "body.trc"
    names = "\t\t\t".join(f"m{number}" for number in range(MANY))
    rows = "".join(f"{row}\t{row / 60}" + "\t1\t2\t3" * MANY + "\n" for row in range(1, 4))
    head = f"PathFileType\t4\t(X/Y/Z)\tb\nUnits\nmm\nFrame#\tTime\t{names}\n\t\tX1\n"
    path.write_text(head + rows)
    tracemalloc.start()
    with pytest.raises(BadInput, match=r"markers are too many; give at most 1000|each another"):
        read_trc(path, "the body's file")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6


def test_a_hundred_thousand_names_are_refused_at_once() -> None:
    began = time.perf_counter()
    names = [f"N{number}" for number in range(MANY)]
    with pytest.raises(BadLayout, match="100000, at most 512"):
        Layout.from_document({"name": "many", "sensors": names})
    with pytest.raises(BadLayout, match="100000, at most 512"):
        Layout.from_document({"name": "many", "sensors": ["A"], "rotations": {name: ["A"] for name in names}})
    assert time.perf_counter() - began < SOON_S


def test_nested_xml_is_read_once() -> None:
    deep = 12_000
    point = '<calib raw_value="0.1" calibrated_value="0"/><calib raw_value="0.9" calibrated_value="90"/>'
    text = f'<Joint name="G_IndexMPJ">{point}' * deep + "</Joint>" * deep
    began = time.perf_counter()
    found = read_xml(f"<Cyberglove_calibration>{text}</Cyberglove_calibration>", Counts(1.0, 255.0), "right")
    assert set(found.lines) == {"I_MCP"}
    assert time.perf_counter() - began < SOON_S
