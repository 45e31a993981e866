"""The shape of a gloved hand from a recording of it, by command; its file."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))
pytest.importorskip("cv2")
pytest.importorskip("numba")

from camera_support import SMALL, ready_folder
from cli_running import glovecal
from other_gloves import other_hand

from glovecal_client.pictures.label_file import LabelWriter
from glovecal_models.colour_glove.hand_shape import TILTED, HandShape, read_shape, write_shape
from glovecal_models.colour_glove.pattern import printed_pattern
from glovecal_models.colour_glove.photograph import hand_motion
from glovecal_models.colour_glove.rasterise import rasterise
from glovecal_models.colour_glove.skin import RADII_MM, hand_skin, posed
from glovecal_models.errors import BadInput
from glovecal_models.takes.camera_estimates import read_estimates
from glovecal_service.camera.tracking_setup import ASSUMED

KNOWN = HandShape(
    "left", hand_skin().skeleton.dimensions.sizes_mm, dict(RADII_MM),
    dict.fromkeys(RADII_MM, (1.0, -2.0, 0.5, 0.0)), dict.fromkeys(TILTED, (1.5, -1.0)),
    0.05, {"I_proximal": 0.02},
)  # fmt: skip


def test_a_shape_is_found_and_told_with_what_one_camera_leaves_open(tmp_path: Path) -> None:
    ready_folder(tmp_path)
    hand, film, shape = other_hand(hand_skin(), 5), tmp_path / "hand.labels", tmp_path / "shape.json"
    writer = LabelWriter(film, (480, 640), {"simulated": True})
    for at, state in enumerate(hand_motion(hand, 44.0, 0.5, seed=5)[:22]):
        picture = rasterise(posed(hand, state), hand.triangles, ASSUMED).painted(printed_pattern().colour)
        writer.write(picture, 10**9 * (at + 1), 10**9 * (at + 1))
    writer.close()
    small = [part for name, value in SMALL.items() for part in (f"--{name}", value)]
    here = {"GLOVECAL_DATA": str(tmp_path)}
    done = glovecal(here, "camera", "shape", *small, film, "--out", shape)
    assert done.code == 0, done.said
    assert "One camera leaves the size open by 5 %" in done.out
    found = read_shape(shape)
    assert found.hand == "right"
    assert found.skin().skeleton.dimensions.sizes_mm == pytest.approx(found.sizes_mm)
    true, assumed = hand.skeleton.dimensions.sizes_mm, hand_skin().skeleton.dimensions.sizes_mm
    bones = [name for name in true if name.endswith(("proximal", "middle"))]
    off, before = (
        sum((sizes[name] / true[name] - 1) ** 2 for name in bones) for sizes in (found.sizes_mm, assumed)
    )
    assert off < before
    given, own = tmp_path / "given.npz", tmp_path / "own.npz"
    with_it = glovecal(here, "camera", "estimates", *small, film, "--shape", shape, "--out", given)
    by_itself = glovecal(here, "camera", "estimates", *small, film, "--out", own)
    assert "The hand's shape was fitted to 22 frames" in by_itself.out, by_itself.said
    assert "shape was fitted" not in with_it.out
    assert read_estimates(own).angles_deg == pytest.approx(read_estimates(given).angles_deg, abs=0.01)
    refused = glovecal(
        here, "camera", "estimates", film, "--hand", "left", "--shape", shape, "--out", tmp_path / "no.npz"
    )
    assert refused.code == 1
    assert "is of a right hand" in refused.said


def test_a_shape_is_read_as_it_was_written_and_another_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "shape.json"
    write_shape(file, KNOWN)
    assert read_shape(file) == KNOWN
    document = json.loads(file.read_text())
    earlier = {name: value for name, value in document.items() if name not in ("laid_mm", "tilts_deg")}
    file.write_text(json.dumps(earlier | {"format": "glovecal hand shape 1"}))
    alone = read_shape(file)
    assert (alone.sizes_mm, alone.radii_mm) == (KNOWN.sizes_mm, KNOWN.radii_mm)
    assert not any(any(row) for row in (*alone.laid_mm.values(), *alone.tilts_deg.values()))
    for change, said in (
        ({"hand": "both"}, "'both', expected right or left"),
        ({"sizes_mm": {"hand_length": 190.0}}, "sizes_mm must name"),
        ({"radii_mm": {"T_distal": [1.0]}}, "radii_mm must hold 2 numbers"),
        ({"laid_mm": document["laid_mm"] | {"T_distal": [1.0, 99.0, 0.0, 0.0]}}, "from -40 to 40"),
        ({"tilts_deg": {"T_IP": [1.0, 1.0]}}, "tilts_deg must name"),
        ({"size_sd": float("nan")}, "holds the number NaN"),
        ({"format": "another"}, "is no hand's shape"),
        ({"more": 1}, "is no hand's shape"),
    ):
        file.write_text(json.dumps(document | change))
        with pytest.raises(BadInput, match=said):
            read_shape(file)
    file.write_text("{")
    with pytest.raises(BadInput, match="is no JSON"):
        read_shape(file)
