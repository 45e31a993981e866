"""Repeated samples: padding is found and taken out; a hand at rest repeats itself and is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from glovecal_models.effects.repeated_samples import RepeatedSamples, repeats

REPEATED = RepeatedSamples()


def padded(values: np.ndarray, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Values in which ``share`` of the rows repeat the one before, and which those are."""
    lost = np.random.default_rng(4).random(len(values)) < share
    lost[0] = False
    return values[np.maximum.accumulate(np.where(lost, 0, np.arange(len(values))))], lost


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_padded_frames_are_found_and_dropped(glove, share):
    takes, lost = [], []
    for take in glove.takes():
        readings, rows = padded(take.readings, share)
        poses = tuple(f"pose{row}" for row in range(len(rows)))
        takes.append(replace(take, readings=readings, context={"supply_v": take.time_s}, poses=poses))
        lost.append(rows)
    [finding] = REPEATED.find(takes, glove.sensor_of)
    assert finding.kind == "frames"
    assert finding.where == ("take0", "take1", "take2", "take3")
    assert finding.evidence["repeated_share_of_moving_pct"] == pytest.approx(100 * share, rel=0.3)
    mended = REPEATED.repaired(takes)
    for take, before, rows in zip(mended, takes, lost, strict=True):
        kept = np.isin(before.time_s, take.time_s)
        assert kept[~rows].mean() > 0.95
        assert kept[rows].mean() < 0.25
        assert take.context["supply_v"].shape == take.time_s.shape
        assert take.poses is not None
        assert take.poses[5] == f"pose{int(np.flatnonzero(kept)[5])}"
        known = np.isfinite(take.reference_at_frames(["I_PIP"]))
        assert known.all()
    assert REPEATED.find(mended, glove.sensor_of) == ()


def test_a_stream_that_halts_now_and_then_leaps_when_it_goes_on(glove):
    takes, held = [], np.zeros(1800, dtype=bool)
    for start in range(60, 1800, 120):
        held[start : start + 9] = True
    for take in glove.takes():
        rows = np.maximum.accumulate(np.where(held, 0, np.arange(1800)))
        takes.append(replace(take, readings=take.readings[rows]))
    [finding] = REPEATED.find(takes, glove.sensor_of)
    assert finding.evidence["leaps_after_halts_count"] > 20
    mended = REPEATED.repaired(takes)
    dropped = [~np.isin(old.time_s, new.time_s) for old, new in zip(takes, mended, strict=True)]
    assert np.mean([rows[held].mean() for rows in dropped]) > 0.7
    assert np.mean([rows[~held].mean() for rows in dropped]) < 0.05
    assert REPEATED.find(mended, glove.sensor_of) == ()


def test_padded_reference_rows_become_unknown(glove):
    takes = [replace(take, reference=padded(take.reference, 0.2)[0]) for take in glove.takes()]
    [finding] = REPEATED.find(takes, glove.sensor_of)
    assert finding.kind == "reference rows"
    mended = REPEATED.repaired(takes)
    assert 0.15 < np.mean([np.isnan(take.reference[:, 0]).mean() for take in mended]) < 0.22
    assert all(len(take.time_s) == len(old.time_s) for take, old in zip(mended, takes, strict=True))


def test_a_hand_at_rest_repeats_itself(glove):
    """Noiseless sensors and long holds: a third of all frames repeat, none of them in a movement."""
    takes = []
    for take in glove.takes(noise_deg=0.0):
        readings = take.readings.copy()
        for start in range(0, len(readings), 300):
            readings[start : start + 100] = readings[start]
        takes.append(replace(take, readings=readings))
    assert np.mean([(np.diff(take.readings, axis=0) == 0).all(axis=1).mean() for take in takes]) > 0.3
    assert REPEATED.find(takes, glove.sensor_of) == ()
    assert REPEATED.repaired(takes) == tuple(takes)


def test_nothing_to_look_at():
    assert not repeats(np.empty((0, 0))).rows.any()
    assert repeats(np.full((50, 2), np.nan)).share == 0.0
    assert repeats(np.ones((50, 2))).share == 0.0


def in_turn(readings: np.ndarray, every: int) -> np.ndarray:
    """Each column new in one of ``every`` frames, each at another one."""
    rows = np.arange(len(readings))
    newest = [np.maximum((rows - first) // every * every + first, 0) for first in range(readings.shape[1])]
    return np.column_stack([column[at] for column, at in zip(readings.T, newest, strict=True)])


def test_sensors_that_are_read_in_turn_are_found_and_follow_straight_lines(glove):
    plain = glove.takes()
    takes = [replace(take, readings=in_turn(take.readings, 6)) for take in plain]
    [finding] = REPEATED.find(takes, glove.sensor_of)
    assert finding.kind == "sensors"
    mended = REPEATED.repaired(takes)
    errors = [
        np.sqrt(np.mean((np.stack([t.readings for t in some]) - np.stack([t.readings for t in plain])) ** 2))
        for some in (takes, mended)
    ]
    assert errors[1] < 0.4 * errors[0]
    assert REPEATED.find(mended, glove.sensor_of) == ()


def test_a_buffer_that_is_played_again_is_found_and_taken_out(glove):
    takes, again = [], np.zeros(1800, dtype=bool)
    shown = np.arange(1800)
    for start in range(100, 1700, 200):
        shown[start : start + 27] = start - 9 + np.arange(27) % 9
        again[start : start + 27] = True
    for take in glove.takes():
        takes.append(replace(take, readings=take.readings[shown]))
    [finding] = REPEATED.find(takes, glove.sensor_of)
    assert finding.kind == "runs"
    assert "a buffer was played again" in finding.sentence
    mended = REPEATED.repaired(takes)
    for old, new in zip(takes, mended, strict=True):
        dropped = ~np.isin(old.time_s, new.time_s)
        assert not dropped[~again].any()
        assert dropped[again].mean() > 0.6
    assert REPEATED.find(mended, glove.sensor_of) == ()


def test_few_repeats_of_many_fine_columns_are_found(glove):
    """Of 12-bit readings of several sensors in a movement not one frame equals the one before by chance."""
    random, takes = np.random.default_rng(2), []
    time = np.arange(1800) / 60.0
    for take in glove.takes():
        fine = [np.round(2000 + 1500 * np.sin(time * rate)) for rate in (1.3, 2.1, 0.7)]
        shown = np.arange(1800)
        for start in random.choice(np.arange(20, 1780, 12), 20, replace=False).tolist():
            shown[start : start + 3] = start - 1
        readings = np.column_stack(fine)[shown]
        takes.append(replace(take, sensors=("A", "B", "C"), readings=readings))
    [finding] = REPEATED.find(takes, {})
    assert finding.kind == "frames"
    assert finding.evidence["repeated_share_of_moving_pct"] < 2.0
