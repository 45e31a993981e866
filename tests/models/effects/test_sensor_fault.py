"""Sensor faults: each kind is found with its stretch, and a sound glove, however odd, has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.diagnosis.diagnose import diagnose
from glovecal_models.effects.base.findings import Recorded, frames_inside
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.catalogue import stored_correction
from glovecal_models.effects.sensor_fault.sensor_fault import SensorFault
from glovecal_models.layout import Layout
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan

FAULT = SensorFault()


def broken(glove, change):
    """Takes in which the first sensor of the third take was changed in place."""
    takes = glove.takes()
    readings = takes[2].readings.copy()
    change(readings[:, 0])
    return [*takes[:2], replace(takes[2], readings=readings), takes[3]]


def stuck(readings):
    readings[600:900] = 130


def spiked(readings):
    readings[[100, 500, 501, 900, 1400, 1700]] += 90


def dropped(readings):
    readings[200:203] = 0
    readings[700:730] = 0
    readings[1300:1310] = 0


def shifted(readings):
    readings[900:] += 16


def louder(readings):
    readings[900:] = 40 + 1.25 * (readings[900:] - 40)


@pytest.mark.parametrize(
    ("change", "kind", "first_s", "frames"),
    [
        (stuck, "stuck", 10.0, 300),
        (spiked, "spikes", 100 / 60, 6),
        (dropped, "dropouts", 200 / 60, 43),
        (shifted, "jump", 15.0, 900),
        (louder, "jump", 15.0, 900),
    ],
)
def test_a_fault_is_found_where_it_is(glove, change, kind, first_s, frames):
    takes = broken(glove, change)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("I_PIP",), kind)
    assert {item.take for item in finding.stretches} == {"take2"}
    assert finding.stretches[0].start_s == pytest.approx(first_s, abs=0.1)
    assert frames_inside(takes[2], finding.stretches).sum() == pytest.approx(frames, abs=6)
    assert not frames_inside(takes[1], finding.stretches).any()
    assert "I_PIP" in finding.sentence
    assert "take2" in finding.sentence
    if kind == "jump":
        assert finding.size_deg == pytest.approx(8 if change is shifted else 11, abs=2.5)


def briefly_stuck(readings):
    """A third of a second in the middle of a quick movement, five times."""
    moving = np.abs(readings[12:] - readings[:-12])
    for place in (0, 360, 720, 1080, 1440):
        start = place + int(moving[place : place + 300].argmax())
        readings[start : start + 13] = readings[start]


def briefly_away(readings):
    """A tenth of the range lower for a tenth of a second, five times."""
    for start in (200, 500, 800, 1100, 1500):
        readings[start : start + 6] -= 18


def spiked_often(readings):
    readings[[*range(50, 1750, 11)]] += 30


@pytest.mark.parametrize(
    ("change", "kind", "times"), [(briefly_stuck, "stuck", 5), (briefly_away, "dropouts", 5)]
)
def test_short_faults_are_found_when_there_are_several(glove, change, kind, times):
    takes = broken(glove, change)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("I_PIP",), kind)
    assert finding.count == pytest.approx(times, abs=1)
    mended = FAULT.repaired(takes)
    assert mended[1] is takes[1]
    left_out = ~np.isfinite(mended[2].reference_at_frames(["I_PIP", "M_PIP"]))
    assert left_out[:, 0].sum() == frames_inside(takes[2], finding.stretches).sum() > 0
    assert not left_out[:, 1].any()


def test_many_spikes_are_no_dropouts(glove):
    [finding] = FAULT.find(broken(glove, spiked_often), glove.sensor_of)
    assert finding.kind == "spikes"


def test_frames_that_all_sensors_repeat_are_not_stuck(glove):
    takes = []
    for take in glove.takes():
        held = np.arange(len(take.readings)) // 12 * 12
        takes.append(replace(take, readings=take.readings[held]))
    assert "stuck" not in [item.kind for item in FAULT.find(takes, glove.sensor_of)]


def drift(counts, generator):
    return counts + np.linspace(0, 20, len(counts))[:, None]


def coupled(counts, generator):
    return counts + 0.25 * np.roll(counts, 1, axis=1)


def sticky(counts, generator):
    time = np.arange(len(counts)) / 60
    plays = stored_correction("hysteresis", {}).columns(Signals(time, counts / 2), {}, np.full((3, 1), 10.0))
    return counts + 2 * plays @ np.array([0.3, 0.3, 0.4])


def in_switches(counts, generator):
    """Cloth of many switches, each with its own closing and opening angle (Preisach): it stands and jumps."""
    closes = np.arange(30.0, 230.0, 6.0)
    closes += generator.uniform(0, 6, len(closes))
    opens, state = closes - 16.0, counts[0, :, None] > closes - 8.0
    sums = np.empty_like(counts)
    for frame, now in enumerate(counts[:, :, None]):
        state = (state | (now >= closes)) & (now > opens)
        sums[frame] = 30.0 + 6.0 * state.sum(axis=1)
    return sums


def clipped(counts, generator):
    return np.minimum(counts, 180)


@pytest.mark.parametrize("distortion", [None, drift, coupled, sticky, in_switches, clipped])
def test_what_is_no_fault_is_not_called_one(glove, distortion):
    assert FAULT.find(glove.takes(shape_counts=distortion), glove.sensor_of) == ()


def test_a_sensor_that_stands_still_with_the_hand_is_sound(glove):
    takes = []
    for take in broken(glove, stuck):
        reference = take.reference.copy()
        reference[600:900] = 45.0
        takes.append(replace(take, reference=reference))
    assert [item.kind for item in FAULT.find(takes, glove.sensor_of)] == []


def stretched(takes, gains):
    """Two wearings; the first sensor answers so many times as much in each take."""
    return [
        replace(
            take,
            wearing="w1" if number < len(takes) // 2 else "w2",
            readings=take.readings * [gain, 1.0, 1.0] + [40.0 * (1.0 - gain), 0.0, 0.0],
        )
        for number, (take, gain) in enumerate(zip(takes, gains, strict=True))
    ]


def test_a_gain_that_changes_between_takes_is_a_fault_from_there_on(glove):
    takes = stretched(glove.takes(count=10), [1.0] * 7 + [1.08] * 3)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("I_PIP",), "changed")
    assert finding.evidence["gain_change_share"] == pytest.approx(0.08, abs=0.02)
    assert [item.take for item in finding.stretches] == [f"take{number}" for number in range(7)]
    mended = FAULT.repaired(takes)
    assert not np.isfinite(mended[6].reference_at_frames(["I_PIP"])).any()
    assert mended[7] is takes[7]


@pytest.mark.parametrize(
    "gains",
    [
        [1.0] * 5 + [1.08] * 5,  # just where the glove was put on again
        np.linspace(1.0, 1.1, 10),  # as the battery below
        [1.0, 0.99, 0.96, 0.91, 0.84, 1.0, 0.99, 0.96, 0.91, 0.84],  # a sheath that turns while it is worn
        [1.0] * 10,
    ],
)
def test_gains_that_a_wearing_or_a_column_explains_are_no_fault(glove, gains):
    takes = stretched(glove.takes(count=10), gains)
    volts = np.linspace(4.1, 3.8, 10)
    takes = [
        replace(take, context={"supply_v": np.full(len(take.time_s), volt)})
        for take, volt in zip(takes, volts, strict=True)
    ]
    assert FAULT.find(takes, glove.sensor_of) == ()


def test_a_late_glove_that_is_swung_fast_has_no_fault():
    plan = SessionPlan(
        seed=2, wearings=1, takes_per_wearing=11, take_s=20.0, motions=("natural",) * 8 + ("fast",) * 3
    )
    session = record_session(plan, (Cause("glove_latency", strength_deg=2.5),))
    assert FAULT.find(session.takes, {name: name for name in plan.sensors}) == ()


def with_sensor(glove, change, rotation=0, **choices):
    """Takes in whose readings of one sensor ``change(time_s, degrees, generator)`` adds degrees."""
    generator = np.random.default_rng(7)
    takes = []
    for take in glove.takes(**choices):
        readings = take.readings.copy()
        added = change(take.time_s, take.reference[:, rotation], generator)
        readings[:, rotation] = np.clip(np.round(readings[:, rotation] + 2.0 * added), 0, 255)
        takes.append(replace(take, readings=readings))
    return takes


def railway(time_s, angles, generator):
    """16.7 Hz, with a second harmonic and a phase that no take shares."""
    turned = 2 * np.pi * 16.7 * time_s + generator.uniform(0, 7)
    return 0.8 * np.sin(turned) + 0.3 * np.sin(2 * turned)


def folded_switching_supply(time_s, angles, generator):
    """1 kHz and a little, seen at 60 frames a second; its strength swells and falls."""
    return (1.0 + 0.3 * np.sin(time_s)) * np.sin(2 * np.pi * 1008.3 * time_s)


@pytest.mark.parametrize(("tone", "frequency_hz"), [(railway, 16.7), (folded_switching_supply, 11.7)])
def test_a_tone_of_one_sensor_is_hum(glove, tone, frequency_hz):
    takes = with_sensor(glove, tone, rotation=1)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("M_PIP",), "hum")
    assert finding.evidence["frequency_hz"] == pytest.approx(frequency_hz, abs=0.2)
    assert finding.size_deg == pytest.approx(0.65, abs=0.15)
    assert all(mended is take for mended, take in zip(FAULT.repaired(takes), takes, strict=True))


def three_states(time_s, angles, generator):
    """A contact with three resistances, each left after a second or two."""
    state, now, until = np.zeros(len(time_s)), 0, 0
    for frame in range(len(time_s)):
        if frame == 0 or frame >= until:
            until = frame + generator.integers(50, 120)
            now = generator.choice([each for each in (0, 1, 2) if each != now]) if now == 0 else 0
        state[frame] = now
    return 2.5 * state * np.where(state == 2, -1.0, 1.0)


def far_states(time_s, angles, generator):
    """Twice as far apart: some stays look like dropouts."""
    return 2.0 * three_states(time_s, angles, generator)


def opens_above(time_s, angles, generator):
    """A track that parts above 55 degrees in every fourth bend, the further the bend the wider."""
    above = np.convolve(angles > 55, np.ones(15) / 15, mode="same") > 0.5
    bend = np.cumsum(np.diff(above.astype(int), prepend=0) > 0)
    return np.where(above & (bend % 4 == 1), 3.5 + 0.04 * (angles - 55), 0.0)


@pytest.mark.parametrize("contact", [three_states, far_states, opens_above])
def test_a_contact_that_goes_to_and_fro_switches(glove, contact):
    takes = with_sensor(glove, contact, count=8)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("I_PIP",), "switching")
    assert finding.evidence["switches_count"] > 40
    assert finding.size_deg == pytest.approx(7.0 if contact is far_states else 3.0, abs=1.0)
    assert all(mended is take for mended, take in zip(FAULT.repaired(takes), takes, strict=True))


def recharges(time_s, angles, generator):
    """Sinks away within seconds and is charged anew at random: all jumps go one way."""
    charged = np.maximum.accumulate(np.where(generator.random(len(time_s)) < 1 / 150, time_s, 0.0))
    return 4.0 * np.exp(-(time_s - charged) / 2.0)


def sparks(time_s, angles, generator):
    """Kicked to either side at random, and back within a second."""
    kicks = (generator.random(len(time_s)) < 1 / 150) * generator.choice([-4.0, 4.0], len(time_s))
    return np.convolve(kicks, np.exp(-np.arange(120) / 30.0))[: len(time_s)]


@pytest.mark.parametrize("fault", [recharges, sparks])
def test_a_sensor_that_jumps_without_taking_turns_is_faulty(glove, fault):
    takes = with_sensor(glove, fault, count=8)
    [finding] = FAULT.find(takes, glove.sensor_of)
    assert (finding.where, finding.kind) == (("I_PIP",), "switching")
    assert "jumps" in finding.sentence


def unequal_steps(time_s, angles, generator):
    """The heaviest bits of a converter weigh too much, so that a step is made up for between two of them."""
    return 3.0 * (np.mod(angles, 20.0) / 20.0 - 0.5)


def test_unequal_steps_of_a_converter_are_no_fault(glove):
    kinds = [item.kind for item in FAULT.find(with_sensor(glove, unequal_steps, count=8), glove.sensor_of)]
    assert "switching" not in kinds


def vibrates(time_s, angles, generator):
    return 0.8 * np.sin(2 * np.pi * 9.3 * time_s)


def in_first(takes, tone):
    """The tone in the first sensor's readings."""
    return [
        replace(take, readings=np.round(take.readings + 2.0 * each * [1.0, 0.0, 0.0]))
        for take, each in zip(takes, tone, strict=True)
    ]


def test_what_all_sensors_or_the_reference_have_is_no_hum(glove):
    takes = glove.takes()
    tone = [vibrates(take.time_s, None, None)[:, None] for take in takes]
    every = [
        replace(take, readings=np.round(take.readings + 2.0 * each))
        for take, each in zip(takes, tone, strict=True)
    ]
    shaken = [
        replace(take, reference=take.reference + each * [1.0, 0.0, 0.0])
        for take, each in zip(takes, tone, strict=True)
    ]
    followed_late = [
        replace(take, reference=take.reference + np.roll(each, -2) * [1.0, 0.0, 0.0])
        for take, each in zip(in_first(takes, tone), tone, strict=True)
    ]
    moved = [
        replace(take, reference=take.reference + each * [1.0, 0.0, 0.0])
        for take, each in zip(in_first(takes, tone), tone, strict=True)
    ]
    for takes in (every, shaken, moved, followed_late):
        assert FAULT.find(takes, glove.sensor_of) == ()


def tremor(time_s, angles, generator):
    """2 Hz wide."""
    noise = generator.normal(size=len(time_s))
    return (
        12.0
        * np.convolve(noise, np.hanning(31) * np.cos(2 * np.pi * 9 * np.arange(31) / 60) / 15, "same")
        / 4
    )


def slips(time_s, angles, generator):
    """Steps that stay, each to a side of its own."""
    moments = generator.random(len(time_s)) < 1 / 90
    return np.cumsum(moments * generator.normal(0, 1.5, len(time_s)))


def quick_lag(time_s, angles, generator):
    return 0.03 * -np.gradient(angles, time_s)


@pytest.mark.parametrize("change", [tremor, slips, quick_lag])
def test_other_quick_errors_are_neither_hum_nor_switching(glove, change):
    kinds = [item.kind for item in FAULT.find(with_sensor(glove, change, count=6), glove.sensor_of)]
    assert "hum" not in kinds
    assert "switching" not in kinds


def test_a_reference_that_switches_is_no_fault_of_a_sensor(glove):
    takes, generator = glove.takes(count=8), np.random.default_rng(7)
    swapped = []
    for take in takes:
        away = three_states(take.time_s, None, generator)
        swapped.append(replace(take, reference=take.reference + away[:, None] * [1.0, 0.0, 0.0]))
    assert "switching" not in [item.kind for item in FAULT.find(swapped, glove.sensor_of)]


def snaps_over(time_s, angles, generator):
    """A strip that goes over at 52 degrees and back at 38."""
    decided = np.where(angles > 52, 1.0, np.where(angles < 38, -1.0, 0.0))
    decided[0] = -1.0 if decided[0] == 0 else decided[0]
    return 2.0 * decided[np.maximum.accumulate(np.where(decided != 0, np.arange(len(angles)), 0))]


def test_a_strip_that_snaps_over_is_no_contact(glove):
    takes = with_sensor(glove, snaps_over, count=8)
    assert "switching" not in [item.kind for item in FAULT.find(takes, glove.sensor_of)]


def test_large_spikes_of_a_sensor_that_hums_are_left_out(glove):
    first, *others = with_sensor(glove, railway, rotation=1)
    readings = first.readings.copy()
    readings[[200, 700, 1200, 1500], 1] += 60.0
    takes = [replace(first, readings=readings), *others]
    found = {item.kind: item for item in FAULT.find(takes, glove.sensor_of)}
    assert set(found) == {"hum", "spikes"}
    assert [found[kind].is_only_told for kind in ("hum", "spikes")] == [True, False]
    mended = FAULT.repaired(takes)
    assert np.isnan(mended[0].reference_at_frames(["M_PIP"])).sum() == 4
    assert mended[1] is takes[1]


def test_what_is_only_told_is_not_proposed(glove):
    takes = with_sensor(glove, railway, rotation=1)
    recorded = Recorded(tuple(takes), glove.sensor_of, list)
    assert FAULT.find(takes, glove.sensor_of)
    assert FAULT.proposed(recorded) is None
    layout = Layout.from_columns("plain", takes[0].sensors, takes[0].rotations)
    named = diagnose(takes, layout).named
    assert named is not None
    assert (named.effect, named.where, named.kind) == ("sensor_fault", ("M_PIP",), "finding")


def test_a_step_that_noise_takes_back_is_no_jump(glove):
    """The reading drifts over within seconds; the largest step of noise lies in the middle of that, and is
    forgotten within a tenth of a second."""
    takes = glove.takes()
    number = np.arange(len(takes[2].readings))
    readings = takes[2].readings.copy()
    readings[:, 0] += 16.0 / (1.0 + np.exp(-(number - 900) / 60.0))
    readings[900:905, 0] += [14.0, 9.0, 5.0, 2.0, 0.5]
    takes = [*takes[:2], replace(takes[2], readings=readings), takes[3]]
    assert "jump" not in [item.kind for item in FAULT.find(takes, glove.sensor_of)]
