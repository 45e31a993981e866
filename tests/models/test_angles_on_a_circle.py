"""A reference that begins again after a full turn is unwrapped, told, and blamed on no sensor."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import glovecal
from glovecal_models.effects.catalogue import effect
from glovecal_models.effects.sensor_fault.sensor_fault import SensorFault
from glovecal_models.takes.angles_on_a_circle import unwrapped
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes

SENSORS = ("I_PIP", "M_PIP", "R_PIP")


def bent(number: int, centre_deg: float = 40.0) -> Take:
    """15 s at 60 Hz: three flex sensors with 12 counts of noise, fingers that bend by 40 degrees."""
    random = np.random.default_rng(number)
    time = np.arange(900) / 60
    phases = random.uniform(0, 6, (3, 2))
    waves = np.sin(time[:, None, None] * np.array([0.9, 2.3]) + phases).sum(axis=2)
    angles = centre_deg + 20 * waves + 0.4 * random.normal(size=(900, 3))
    readings = np.round(900 + 18 * (angles - centre_deg + 40) + 12 * random.normal(size=(900, 3)))
    return Take(f"t{number}", "w", SENSORS, time, readings, SENSORS, time, angles)


def shown_as(take: Take, shown: Callable[[np.ndarray], np.ndarray]) -> Take:
    """The take whose I_PIP an exporter wrote so."""
    reference = take.reference.copy()
    reference[:, 0] = shown(reference[:, 0])
    return replace(take, reference=reference)


def half_turn(values: np.ndarray) -> np.ndarray:
    return np.mod(values + 180, 360) - 180


def full_turn(values: np.ndarray) -> np.ndarray:
    return np.mod(values, 360)


@pytest.mark.parametrize(("shown", "centre"), [(half_turn, 175.0), (half_turn, -170.0), (full_turn, 5.0)])
def test_angles_are_counted_on_past_a_turn_and_told(shown, centre):
    takes = [bent(number, centre) for number in range(3)]
    found = unwrapped([shown_as(take, shown) for take in takes])
    pairs = zip(found.takes, takes, strict=True)
    off = {float(turn) for one, two in pairs for turn in np.round((one.reference - two.reference)[:, 0], 6)}
    assert len(off) == 1, "the same for all takes"
    assert off <= {-360.0, 0.0, 360.0}
    assert all("I_PIP" in sentence and "unwrapped" in sentence for sentence in found.sentences)
    assert found.sentences[0].startswith("Take 't0'")


def test_takes_on_either_side_of_the_place_where_angles_begin_again():
    takes = [
        shown_as(bent(number, 178.0), lambda v, side=side: half_turn(180 + side * (2 + np.abs(v - 178))))
        for number, side in enumerate((1, -1))
    ]
    assert all(np.abs(np.diff(take.reference[:, 0])).max() < 90 for take in takes)
    assert np.ptp(np.concatenate([take.reference[:, 0] for take in unwrapped(takes).takes])) < 120


def test_a_later_file_is_counted_as_the_takes_that_are_there():
    first = unwrapped([shown_as(bent(0, 178.0), half_turn)]).takes
    later = unwrapped([shown_as(bent(1, 182.0), half_turn), bent(2, 178.0)], first).takes
    assert abs(np.mean(later[0].reference[:, 0]) - np.mean(first[0].reference[:, 0])) < 30


@pytest.mark.parametrize("centre", [40.0, 120.0, -120.0])
def test_angles_that_do_not_begin_again_stay_as_they_are(centre):
    takes = [bent(number, centre) for number in range(3)]
    assert unwrapped(takes).sentences == ()
    assert all(one is other for one, other in zip(unwrapped(takes).takes, takes, strict=True))


def test_wild_rows_and_a_value_for_nothing_measured_are_no_circle():
    def lost(values: np.ndarray) -> np.ndarray:
        values = 1.5 * values
        values[200:260] = -180.0
        return values

    def wild(values: np.ndarray) -> np.ndarray:
        values[::83] = np.random.default_rng(1).uniform(-180, 180, len(values[::83]))
        return values

    for shown in (lost, wild):
        assert unwrapped([shown_as(bent(number), shown) for number in range(3)]).sentences == ()


def test_the_library_reads_and_tells_it(tmp_path: Path):
    for number in range(2):
        write_takes([shown_as(bent(number, 175.0), half_turn)], tmp_path / f"{number}.csv")
    takes = glovecal.read_takes(tmp_path / "0.csv", tmp_path / "1.csv")
    assert np.ptp(np.concatenate([take.reference[:, 0] for take in takes])) < 120
    assert "I_PIP steps by a full turn" in str(takes)


@pytest.mark.parametrize(
    "kind", ["wraps", "swaps for a while", "stays swapped", "jumps while the hand rests"]
)
def test_no_sensor_is_blamed_where_its_reading_is_smooth(kind):
    def shown(values: np.ndarray) -> np.ndarray:
        if kind == "wraps":
            return half_turn(values + 140)
        for start in range(60, 840, 90):
            values[start : start + 7] += 70.0 * (kind == "swaps for a while")
        values[450:] += 60.0 * (kind == "stays swapped")
        return values

    takes = [shown_as(bent(number), shown) for number in range(4)]
    if kind == "jumps while the hand rests":
        still = [slice(300, 400), np.arange(300, 400) >= 350]
        takes = [rested(take, *still) for take in takes]
    fault = effect("sensor_fault")
    assert isinstance(fault, SensorFault)
    assert fault.find(takes, dict(zip(SENSORS, SENSORS, strict=True))) == ()


def rested(take: Take, rest: slice, away: np.ndarray) -> Take:
    """The finger rests at one reading of a coarse sensor; there the reference steps away."""
    readings, reference = take.readings.copy(), take.reference.copy()
    readings[rest] = readings[rest.start]
    reference[rest] = reference[rest.start] + 30.0 * away[:, None]
    return replace(take, readings=readings, reference=reference)
