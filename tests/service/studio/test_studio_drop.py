"""Anything dropped on a page: what it is by its content, one button; and a sentence for the rest."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import pytest
from dropping import FINGERS, LATE_S, drop, motion_file, readings_table, takes_without_angles
from foreign_tables import JOINTS
from playwright.sync_api import expect
from studio_support import Open, serious

from glovecal_client.rest import RestClient
from glovecal_models.layout import Layout
from glovecal_service.emulators.cyberglove3 import EmulatedCyberGlove3
from glovecal_service.exports.vendor_calibrations.calibration_format import Counts, SensorLine
from glovecal_service.exports.vendor_calibrations.formats import FORMATS

pytestmark = pytest.mark.needs_chromium


@pytest.fixture(scope="module")
def client(address: str) -> Iterator[RestClient]:
    with RestClient(address) as client:
        yield client


@pytest.mark.parametrize("name", FORMATS)
def test_a_calibration_of_another_program_becomes_a_model(
    opened: Open, client: RestClient, tmp_path: Path, name: str
) -> None:
    layouts = {"opengloves": "lucidglove", "lerobot": "homunculus"}
    layout = Layout.built_in(layouts.get(name, "cyberglove22"))
    sensors = [each for each in layout.sensors if name != "lerobot" or not each.endswith("ABD")]
    counts = Counts(*(layout.counts or (1.0, 255.0)))
    line = SensorLine(0.5 / counts.per_8_bit, 90.0 * counts.per_8_bit)
    file = tmp_path / "calibration.txt"  # its name says nothing
    file.write_text(FORMATS[name].write(dict.fromkeys(sensors, line), counts, "right"))
    seen = opened("jobs")
    drop(seen.page, [file])
    told = seen.page.get_by_role("status").filter(has_text=FORMATS[name].title)
    expect(told).to_contain_text(f"of glove {layout.name}, right hand")
    if name == "virtualhand":
        assert serious(seen.page) == []
    person = f"vera-{name.replace('_', '-')}"
    seen.page.get_by_label("Whose calibration").fill(person)
    seen.page.get_by_role("button", name="Import the calibration").click()
    expect(seen.page.get_by_role("heading", name=f"of {person} was imported")).to_be_visible()
    expect(seen.page.get_by_label("Person")).to_have_value(person)
    [model] = client.get("/models", {"subject": person})
    assert (model["layout"], model["active"]) == (layout.name, False)
    assert seen.complaints == []


@pytest.mark.parametrize("suffix", [".trc", ".bvh"])
def test_a_motion_file_becomes_the_reference_of_its_take(
    opened: Open, client: RestClient, tmp_path: Path, suffix: str
) -> None:
    person = f"mona-{suffix[1:]}"
    angles = takes_without_angles(client, person, tmp_path, first=10 if suffix == ".trc" else 20)
    seen = opened(f"takes?who={person}")
    drop(seen.page, [motion_file(tmp_path / f"optical{suffix}", angles[1], from_s=LATE_S)])
    told = seen.page.get_by_role("status").filter(has_text="It belongs to take")
    expect(told).to_contain_text(f"It belongs to take {person}-1 and begins 7.3")
    expect(seen.page.get_by_text("of the right hand")).to_be_visible()
    assert serious(seen.page) == []
    seen.page.get_by_role("button", name="Attach to the take").click()
    expect(seen.page.get_by_role("heading", name=f"Train a model of {person}")).to_be_visible()
    takes = {take["name"]: take for take in client.get("/takes", {"subject": person})}
    assert takes[f"{person}-0"]["rotations"] == []
    assert set(FINGERS) <= set(takes[f"{person}-1"]["rotations"])
    assert seen.complaints == []


@pytest.mark.parametrize("together", [True, False])
def test_readings_and_angles_in_two_files_become_one_take(
    opened: Open, client: RestClient, tmp_path: Path, together: bool
) -> None:
    person = "nora" if together else "nele"
    readings, measured = tmp_path / f"{person} glove.csv", tmp_path / f"{person} optical.csv"
    angles = readings_table(readings, 1 + together, 25.0)
    with measured.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream, delimiter=";")
        rows.writerow(["seconds", *(f"{name} angle [deg]" for name in JOINTS)])
        rows.writerows(
            [f"{at / 60:.4f}", *(f"{each:.3f}" for each in row)] for at, row in enumerate(angles[438:])
        )
    seen = opened("takes")
    if together:
        drop(seen.page, [measured, readings])
    else:
        drop(seen.page, [readings])
        expect(seen.page.get_by_text("Drop the file with the angles too")).to_be_visible()
        drop(seen.page, [measured])
    expect(seen.page.get_by_text(f"It belongs to take {readings.stem} and begins 7.3")).to_be_visible()
    seen.page.get_by_label("Whose takes").fill(person)
    seen.page.get_by_role("button", name="Import 1 take").click()
    expect(seen.page.get_by_role("heading", name=f"Train a model of {person}")).to_be_visible()
    expect(seen.page.get_by_label("Person")).to_have_value(person)
    [take] = client.get("/takes", {"subject": person})
    assert take["rotations"] == list(FINGERS)
    assert seen.complaints == []


def test_a_memory_cards_recording_becomes_a_take(opened: Open, client: RestClient, tmp_path: Path) -> None:
    glove = EmulatedCyberGlove3()
    glove.feed(b"1Amonday\x01", 0.0)
    glove.feed(b"subject anna\x01", 0.0)
    glove.feed(b"1es1m\x03", 0.0)
    glove.feed(b"1S", 1.0)
    glove.due(3.0)
    glove.feed(b"\x03", 3.0)
    card = tmp_path / "MONDAY.DAT"
    card.write_bytes(glove.feed(b"1D", 3.2)[2:])
    page = opened("start").page
    drop(page, [card])
    expect(page.get_by_text("Memory card of a CyberGlove III, cyberglove3-22: 180 records")).to_be_visible()
    page.get_by_label("Whose takes").fill("karla")
    page.get_by_role("button", name="Import 1 take").click()
    expect(page.get_by_role("heading", name="1 take imported")).to_be_visible()
    [take] = client.get("/takes", {"subject": "karla"})
    assert (take["layout"], take["frames"], take["name"]) == ("cyberglove3-22", 180, "MONDAY")


def test_what_cannot_be_read_gets_a_sentence_each(opened: Open, tmp_path: Path) -> None:
    cut = FORMATS["virtualhand"].write({}, Counts(1, 255), "right")[:150]
    wrong = {
        "cut.cal": (cut.encode(), "rows of offset"),
        "cut.bvh": (b"HIERARCHY\nROOT Hips\n{\n\tOFFSET 0 0 0\n", "the file ends in its skeleton"),
        "huge.bvh": (b"HIERARCHY\n" + b"ROOT a\n{\nOFFSET 0 0 0\n" * 1500, "more than 1000 bones"),
        "head.trc": (b"PathFileType\t4\n", "unit '' must be one of"),
        "markers.trc": (TRC.encode(), "tells no rotation of a hand: its points are called LASI"),
        "hers.safetensors": (b'\x10\0\0\0\0\0\0\0{"a', "no model was imported"),
        "table.safetensors": (b"\xff" * 40, "table.safetensors: no table of numbers"),
        "empty.csv": (b"", "the file is empty"),
        "ranges.json": (b'{"thumb": {"min": 3', "the calibration"),
    }
    files = []
    for name, (content, _) in wrong.items():
        (tmp_path / name).write_bytes(content)
        files.append(tmp_path / name)
    seen = opened("live")
    drop(seen.page, files)
    for name, (_, sentence) in wrong.items():
        expect(seen.page.get_by_text(sentence).first, name).to_be_visible()
    assert seen.complaints == []


TRC = (
    "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tUnits\n100\tmm\nFrame#\tTime\tLASI\t\t\n\t\tX1\tY1\tZ1\n\n"
    "1\t0.0\t1\t2\t3\n2\t0.01\t1\t2\t3\n"
)
