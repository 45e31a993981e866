"""The examples of docs/own-glove.md and docs/gloves.md do what they say."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from glovecal_client.capture.device import build_device, device_names
from glovecal_client.capture.line_glove import LineGlove
from glovecal_service.emulators.catalogue import PROTOCOLS
from glovecal_service.emulators.glove import EXPLAINED
from glovecal_service.emulators.lines import DESCRIPTION

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGE = (DOCS / "own-glove.md").read_text(encoding="utf-8")
GLOVES = (DOCS / "gloves.md").read_text(encoding="utf-8")


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_description_is_the_one_that_the_emulated_glove_has(tmp_path: Path) -> None:
    description = blocks("toml")[0]
    assert description == DESCRIPTION
    (line,) = blocks("text")
    file = tmp_path / "my-glove.toml"
    file.write_text(description)
    device = LineGlove.from_options(str(file), {"port": "nowhere"})
    (sample,) = device.new_parser().feed(b"\n" + line.encode())
    assert sample.values == (512, 340, 299, 410, 377)
    assert (sample.ticks, sample.context) == (120040, (pytest.approx(7.412),))


def test_every_key_of_a_description_is_explained() -> None:
    from glovecal_client.capture.line_glove import _KEYS

    for table, keys in _KEYS.items():
        for key in keys:
            if key not in _KEYS and key != "context":
                assert f"`{table}.{key}`" in PAGE or f"`{key}`" in PAGE, (table, key)


def test_the_driver_of_ones_own_passes_its_test(tmp_path: Path) -> None:
    driver, its_test = blocks("python")
    package = tmp_path / "my_gloves"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "wristband.py").write_text(driver)
    (tmp_path / "test_wristband.py").write_text(its_test)
    alone = ("-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), str(tmp_path))
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", *alone],
        capture_output=True, text=True, cwd=tmp_path, timeout=120,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout
    assert "3 passed" in ran.stdout


def test_every_device_and_fault_is_on_the_page_of_gloves() -> None:
    for name in set(device_names()) - {"replay", "simulated"}:
        assert f"`{name}:" in GLOVES
    for fault in EXPLAINED:
        assert f"`{fault}`" in GLOVES
    assert len(PROTOCOLS) == 7


@pytest.mark.parametrize("name", ["cyberglove3", "lucidglove", "opencyberglove"])
def test_options_and_their_defaults_on_the_page_are_those_of_the_device(name: str) -> None:
    titles = {
        "cyberglove3": "CyberGlove III",
        "lucidglove": "LucidGloves",
        "opencyberglove": "OpenCyberGlove",
    }
    section = GLOVES.split(f"## {titles[name]}\n")[1].split("\n## ")[0]
    options = dict(re.findall(r"^\| `([a-z_]+)=([\w-]+)`", section, re.MULTILINE))
    assert options
    build_device(f"{name}:nowhere", options)


def test_published_shapes_are_read_as_described(tmp_path: Path) -> None:
    """Above each description stand the lines it reads, as comments; every number in them is a reading."""
    shapes = [block for block in blocks("toml") if block.startswith("# ")]
    assert len(shapes) == 5
    for text in shapes:
        lines = "".join(f"{line[2:]}\n" for line in text.splitlines() if line.startswith("# "))
        file = tmp_path / "shape.toml"
        file.write_text(text)
        device = LineGlove.from_options(str(file), {"port": "nowhere"})
        found = device.new_parser().feed(b"cut\n" + 2 * lines.encode())
        numbers = tuple(float(number) for number in re.findall(r"(?<=[:=|~ ])-?[0-9.]+|^[0-9]+", lines))
        assert [sample.values for sample in found] == [numbers] * 2, text
        assert device.counters.bad_frames == 0
