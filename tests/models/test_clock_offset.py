"""Clock offsets: planted ones come back, clocks that agree are left alone, real recordings are aligned."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.simulation.protocol import evaluation_segment, sampling_protocol
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.clock_scan import ClockOffset, aligned, clock_offsets
from glovecal_models.takes.table import read_takes, reference_beside
from glovecal_models.takes.take import Take

RECORDINGS = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    """A simulated glove's evaluation and free motion, with noise and couplings."""
    glove = SimulatedGlove(seed=3)
    segments = [evaluation_segment(3), sampling_protocol(3)[-1]]
    return [simulate_take(glove, segment, seed=3).take for segment in segments]


def shifted(take: Take, seconds: float) -> Take:
    return replace(take, reference_time_s=take.reference_time_s + seconds)


@pytest.mark.parametrize("offset", [0.04, -0.65, 2.0])
def test_a_planted_offset_comes_back_for_each_take_by_itself(takes: list[Take], offset: float) -> None:
    found = clock_offsets([shifted(takes[0], offset), takes[1]])
    assert [item.verdict for item in found] == ["offset", "agrees"]
    assert found[0].offset_s == pytest.approx(offset, abs=0.01)
    assert found[0].low_s <= offset <= found[0].high_s
    assert found[1].offset_s == 0.0
    assert found[0].unexplained_after < 0.5 * found[0].unexplained_reversed
    side = "ahead of" if offset > 0 else "behind"
    assert f"{abs(offset):.2f} s {side} the glove's" in found[0].sentence
    back = aligned(shifted(takes[0], offset), offset)
    np.testing.assert_allclose(back.reference_time_s, takes[0].reference_time_s, atol=1e-9)


def test_a_slow_sensor_is_not_hidden_behind_a_small_offset(takes: list[Take]) -> None:
    [found] = clock_offsets([shifted(takes[0], -0.05)])
    assert "Slow sensors look the same" in found.sentence


def test_what_cannot_be_judged_is_said(takes: list[Take]) -> None:
    take = takes[0]
    still = replace(take, reference=np.full_like(take.reference, 12.0))
    brief = replace(take, time_s=take.time_s[:60], readings=take.readings[:60], poses=None, context={})
    generator = np.random.default_rng(0)
    unrelated = replace(take, readings=np.cumsum(generator.normal(size=take.readings.shape), axis=0))
    for one in (still, brief, unrelated, replace(take, reference=np.full_like(take.reference, np.nan))):
        [found] = clock_offsets([one])
        assert (found.verdict, found.offset_s) == ("not identifiable", 0.0)
        assert "cannot be judged" in found.sentence


@pytest.mark.needs_shared_data
def test_every_ankle_recording_has_an_offset_of_its_own_and_is_repaired() -> None:
    """12 to 19 degrees of error become 1.5 to 4: the largest effect in these recordings is the clock."""
    files = sorted((RECORDINGS / "ankle").glob("*.frames.csv"))
    takes = [take for file in files for take in read_takes(file, reference_beside(file))]
    found = clock_offsets(takes)
    assert len(found) == 59
    assert {item.verdict for item in found} == {"offset"}
    offsets = np.array([item.offset_s for item in found])
    assert np.median(offsets) == pytest.approx(-0.65, abs=0.03)
    assert not (np.abs(offsets) < 0.12).any()
    for wearing in dict.fromkeys(take.wearing for take in takes):
        pairs = [(take, item) for take, item in zip(takes, found, strict=True) if take.wearing == wearing]
        before, after = (
            error_left_out([take for take, _ in pairs]),
            error_left_out([repaired(take, item) for take, item in pairs]),
        )
        assert before > 11
        assert after < 4
        assert after < before / 4


def repaired(take: Take, found: ClockOffset) -> Take:
    return aligned(take, found.offset_s)


def error_left_out(takes: list[Take]) -> float:
    """RMSE in degrees of a linear map on quarters of each take that it has not seen."""
    inputs, targets, quarters = [], [], []
    for take in takes:
        reference = take.reference_at_frames(take.rotations)
        known = np.isfinite(reference).all(axis=1)
        inputs.append(np.column_stack([np.ones(known.sum()), take.readings[known]]))
        targets.append(reference[known])
        quarters.append(np.arange(known.sum()) * 4 // known.sum())
    x, y, quarter = (np.concatenate(parts) for parts in (inputs, targets, quarters))
    error = np.empty_like(y)
    for left_out in range(4):
        rest, out = quarter != left_out, quarter == left_out
        error[out] = y[out] - x[out] @ np.linalg.lstsq(x[rest], y[rest], rcond=None)[0]
    return float(np.sqrt(np.mean(error**2)))
