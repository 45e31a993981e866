"""Flat lines, clipping, channels that read the same: planted into real readings, told of no sound glove."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.diagnosis.text import diagnosis_sentences, missing_effects
from glovecal_models.layout import Layout
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import TAKE_MOTIONS, SessionPlan
from glovecal_models.takes.channel_faults import channel_faults, session_faults
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.take_check import check_take

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
Plant = Callable[[np.ndarray, int, int], None]


def stand_still(readings: np.ndarray, sensor: int, other: int) -> None:
    """For a third of the take, where the others move most."""
    width = len(readings) // 3
    moved = np.abs(np.diff(np.delete(readings, sensor, axis=1), axis=0)).sum(axis=1)
    first = int(np.argmax(np.convolve(moved, np.ones(width), "valid")))
    readings[first : first + width, sensor] = readings[first, sensor]


def cut_off(readings: np.ndarray, sensor: int, other: int) -> None:
    values = readings[:, sensor]
    readings[:, sensor] = np.minimum(values, np.quantile(values, 0.8))


def wire_together(readings: np.ndarray, sensor: int, other: int) -> None:
    readings[:, sensor] = readings[:, other]


def wire_noisily(readings: np.ndarray, sensor: int, other: int) -> None:
    noise = 0.005 * np.ptp(readings[:, other]) * np.random.default_rng(0).normal(size=len(readings))
    readings[:, sensor] = readings[:, other] + np.round(noise, 1)


def exchange_plugs(readings: np.ndarray, sensor: int, other: int) -> None:
    """Where they are farthest apart."""
    first = 10 + int(np.argmax(np.abs(readings[10:-10, sensor] - readings[10:-10, other])))
    readings[first:, [sensor, other]] = readings[first:, [other, sensor]]


PLANTS: dict[str, tuple[Plant, str]] = {
    "stuck": (stand_still, "while others move"),
    "clipped": (cut_off, "is cut off at"),
    "same": (wire_together, "read the same"),
    "nearly the same": (wire_noisily, "read the same"),
    "exchanged": (exchange_plugs, "exchange their readings"),
}


def real_takes() -> Iterator[list[Take]]:
    """Motions of one person with the sleeve placed once: 20 s or more, four stretch sensors, 26 Hz."""
    for person in range(300, 305):
        for placement in range(1, 4):
            files = sorted((DATA / "ankle").glob(f"P{person}-placement{placement}-*.frames.csv"))
            takes = [take for file in files for take in read_takes(file)]
            if len(takes) == 4:
                yield takes


def told(takes: Sequence[Take]) -> list[str]:
    return [sentence for take in takes for sentence in check_take(take).sentences if "gap" not in sentence]


@pytest.mark.needs_shared_data
@pytest.mark.parametrize("kind", PLANTS)
def test_a_fault_planted_into_real_readings_is_told_and_no_other(kind: str) -> None:
    """In one take of four, of a sensor drawn at random; clipping is in all."""
    random, (plant, words), found, tried = np.random.default_rng(1), PLANTS[kind], 0, 0
    for takes in real_takes():
        sensor, other = (int(each) for each in random.permutation(4)[:2])
        wrong = int(random.integers(4))
        planted = []
        for number, take in enumerate(takes):
            readings = take.readings.copy()
            if number == wrong or kind == "clipped":
                plant(readings, sensor, other)
            planted.append(replace(take, readings=readings))
        sentences, name = told(planted), takes[0].sensors[sensor]
        tried += 1
        found += any(name in sentence and words in sentence for sentence in sentences)
        assert all(name in sentence for sentence in sentences), sentences
    assert tried >= 10
    assert found >= 0.95 * tried


@pytest.mark.needs_shared_data
def test_nothing_is_told_of_channels_of_real_recordings() -> None:
    files = sorted(file for file in DATA.glob("*/*.csv") if "reference" not in file.name)
    takes = [take for file in files if "holds" not in str(file) for take in read_takes(file)]
    assert len(takes) > 80
    assert [str(fault) for take in takes for fault in channel_faults(take)] == []


def sound_gloves() -> Iterator[SessionPlan]:
    random = np.random.default_rng(5)
    while True:
        yield SessionPlan(
            seed=int(random.integers(10**6)), wearings=1, takes_per_wearing=1, take_s=20.0,
            rate_hz=float(random.choice([15, 30, 60, 90, 120])), motions=(random.choice(TAKE_MOTIONS),),
            bits=int(random.choice([7, 8, 10, 12])),
            sensor_noise_deg=float(random.choice([0, 0.05, 0.1, 0.3])),
        )  # fmt: skip


def test_nothing_is_told_of_sound_gloves_whatever_they_do() -> None:
    takes = [record_session(plan, ()).takes[0] for plan in islice(sound_gloves(), 60)]
    assert [str(fault) for take in takes for fault in channel_faults(take)] == []


def test_a_channel_that_is_dead_is_told_while_the_hand_moves_and_not_while_it_rests() -> None:
    takes = list(record_session(SessionPlan(seed=3, wearings=1, takes_per_wearing=2), ()).takes)
    readings = takes[1].readings.copy()
    readings[:, 2] = readings[0, 2]
    broken = [takes[0], replace(takes[1], readings=readings)]
    [(take, fault)] = session_faults(broken)
    assert take.name == takes[1].name
    assert str(fault).startswith(f"{takes[0].sensors[2]} is dead: always")
    resting = replace(broken[1], readings=np.tile(readings[:1], (len(readings), 1)))
    assert session_faults([takes[0], resting]) == ()


def test_a_diagnosis_tells_what_readings_show_first_and_reads_the_others() -> None:
    plan = SessionPlan(seed=8, wearings=2, takes_per_wearing=3, take_s=20.0, bits=12, sensor_noise_deg=0.2)
    takes = list(record_session(plan, ()).takes)
    number = int(np.argmax(np.ptp(takes[1].readings, axis=0)))
    readings = takes[1].readings.copy()
    readings[400:700, number] = np.median(readings[:, number])
    takes[1] = replace(takes[1], readings=readings)
    takes = [replace(take, sensors=tuple(f"S{each}" for each in range(len(plan.sensors)))) for take in takes]
    layout = Layout.from_columns("unknown", takes[0].sensors, takes[0].rotations)
    found = ModelOnTakes(tuple(takes), layout).diagnosed(effects=())
    [sentence] = found.sensor_problems
    assert sentence.startswith(f"Take {takes[1].name!r}: S{number} reads")
    assert diagnosis_sentences(found)[0] == sentence
    faulty = {name for name in takes[0].sensors if f" {name} " in sentence}
    assert all(faulty.isdisjoint(item.sensors) for item in layout.read_without(faulty).correspondences)


def test_an_effect_that_is_named_is_the_next_step_though_readings_are_cut_off() -> None:
    plan = SessionPlan(seed=900, wearings=2, takes_per_wearing=3, take_s=30.0)
    whole = record_session(plan, ()).takes
    level = float(np.percentile(np.concatenate([take.readings[:, 0] for take in whole]), 70))
    takes = [replace(take, readings=np.minimum(take.readings, [level, *[np.inf] * 4])) for take in whole]
    layout = Layout.from_columns("five", plan.sensors, plan.sensors)
    found = missing_effects(ModelOnTakes(tuple(takes), layout).diagnosed())
    assert found.sensor_problems
    assert found.named is not None
    assert found.next_command.startswith("glovecal add-effect MODEL saturation")
    assert replace(found, named=None).next_command.startswith("glovecal take check")
