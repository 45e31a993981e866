"""Take tables: what is read, how takes are divided, and that a round trip loses nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.errors import BadInput, BadTakeTable
from glovecal_models.takes.raw_table import (
    LARGEST_ANGLE_DEG,
    LARGEST_VALUE,
    LONGEST_TAKE_S,
    spread_equal_times,
)
from glovecal_models.takes.reference_jumps import reference_warnings
from glovecal_models.takes.table import read_reference, read_takes
from glovecal_models.takes.take import Take
from glovecal_models.takes.write_table import write_takes


def write(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def assert_same(read: Take, written: Take) -> None:
    for what in ("name", "wearing", "sensors", "rotations", "poses", "simulated"):
        assert getattr(read, what) == getattr(written, what), what
    for what in ("time_s", "readings", "reference_time_s", "reference"):
        np.testing.assert_array_equal(getattr(read, what), getattr(written, what), err_msg=what)
    assert list(read.context) == list(written.context)
    for name, column in written.context.items():
        np.testing.assert_array_equal(read.context[name], column)


def test_one_table_holds_frames_reference_context_and_poses(tmp_path):
    path = write(
        tmp_path / "grasp.csv",
        "time_s,wearing,pose,s.I_MCP,s.I_PIP,r.I_MCP,c.supply_v\n"
        "0,w1,flat,60,90,0.5,7.4\n"
        "0.01,w1,,61,91,,7.4\n"
        "0.02,w1,fist,62,92,-1e1,\n",
    )
    (take,) = read_takes(path)
    assert (take.name, take.wearing, take.poses) == ("grasp", "w1", ("flat", "", "fist"))
    assert take.sensors == ("I_MCP", "I_PIP")
    np.testing.assert_array_equal(take.readings, [[60, 90], [61, 91], [62, 92]])
    np.testing.assert_array_equal(take.reference_at_frames(["I_MCP"])[:, 0], [0.5, np.nan, -10])
    np.testing.assert_array_equal(take.context["supply_v"], [7.4, 7.4, np.nan])
    assert not take.simulated


def test_takes_of_one_file_keep_the_order_of_their_first_rows(tmp_path):
    path = write(tmp_path / "t.csv", "take,time_s,s.A\nb,5,1\na,0,2\nb,6,3\na,1,4\n")
    takes = read_takes(path)
    assert [take.name for take in takes] == ["b", "a"]
    np.testing.assert_array_equal(takes[0].readings[:, 0], [1, 3])
    assert [take.name for take in read_takes(path, name="day1")] == ["day1-b", "day1-a"]


def test_reference_table_beside_the_frames_is_found_and_keeps_its_own_clock(tmp_path):
    frames = write(tmp_path / "walk.frames.csv", "time_s,s.A\n0,1\n0.05,2\n0.1,3\n")
    write(tmp_path / "walk.reference.csv", "time_s,r.ANKLE,pose\n-0.01,-1,still\n0.09,9,step\n")
    (take,) = read_takes(frames)
    assert take.name == "walk"
    assert take.has_own_reference_clock
    np.testing.assert_allclose(take.reference_at_frames(["ANKLE"])[:, 0], [0, 5, np.nan], atol=1e-12)
    assert take.poses == ("still", "still", "step")
    assert read_reference(tmp_path / "walk.reference.csv")[None].rotations == ("ANKLE",)


def test_references_of_several_takes_are_matched_by_name(tmp_path):
    frames = write(tmp_path / "x.csv", "time_s,take,s.A\n0,p,1\n0,q,2\n1,q,3\n")
    reference = write(tmp_path / "y.csv", "time_s,take,r.R\n7,q,10\n")
    first, second = read_takes(frames, reference)
    assert first.rotations == ()
    assert second.rotations == ("R",)
    np.testing.assert_array_equal(second.reference_time_s, [7])


def test_utf8_mark_crlf_blank_lines_and_blanks_around_numbers_are_accepted(tmp_path):
    path = tmp_path / "t.csv"
    path.write_bytes("\ufefftime_s, s.A\r\n0, 1\r\n\r\n1,2 \r\n".encode())
    (take,) = read_takes(path, wearing="second")
    np.testing.assert_array_equal(take.readings[:, 0], [1, 2])
    assert take.wearing == "second"


def test_frames_stamped_in_batches_are_spread_when_asked(tmp_path):
    path = write(tmp_path / "t.csv", "time_s,s.A\n0,1\n1,2\n1,3\n2,4\n2,5\n")
    (take,) = read_takes(path, equal_times="spread")
    np.testing.assert_allclose(take.time_s, [0.75, 1.25, 1.75, 2.25, 2.75])


@given(st.lists(st.integers(0, 20), min_size=1, max_size=50).map(sorted), st.sampled_from([1.0, 0.1, 0.3]))
def test_spread_times_increase_and_move_no_frame_past_the_next_batch(stamps, unit):
    time = np.array(stamps, float) * unit
    spread = spread_equal_times(time)
    assert (np.diff(spread) > 0).all() or len(set(stamps)) == 1
    later = np.array([min((t for t in time if t > stamp), default=np.inf) for stamp in time])
    earlier = np.array([max((t for t in time if t < stamp), default=-np.inf) for stamp in time])
    assert (spread > earlier).all()
    assert (spread < later).all()


@pytest.mark.parametrize("rate_hz", [30.0, 60.0, 100.0, 90.7])
@pytest.mark.parametrize("begun_s", [0.0, 0.25, 0.6, 0.99])
def test_whole_seconds_are_spread_to_where_the_frames_were(rate_hz, begun_s):
    true = 1_700_000_000 + begun_s + np.arange(int(12.3 * rate_hz)) / rate_hz
    assert np.abs(spread_equal_times(np.floor(true)) - true).max() < 0.02


@pytest.mark.parametrize("stamped", ["first", "last"])
def test_a_pause_between_batches_moves_no_frame_by_more_than_half_a_batch(stamped):
    """Batches of 8 at 100 Hz with the time of their first or last frame, a pause of 5 s in the middle."""
    true = np.arange(800) / 100 + np.where(np.arange(800) < 400, 0.0, 5.0) + 0.003
    batches = true.reshape(-1, 8)
    stamps = np.repeat(batches[:, 0 if stamped == "first" else -1], 8)
    spread = spread_equal_times(stamps)
    assert (np.diff(spread) > 0).all()
    assert np.abs(spread - true).max() <= 0.0401
    assert np.abs(spread - stamps).max() <= 0.0401


@pytest.mark.parametrize("equal_times", ["refuse", "spread"])
def test_times_with_too_few_digits_are_refused_and_nothing_is_made_up(tmp_path, equal_times):
    rows = "".join(f"1.73234e+09,{number}\n" for number in range(60))
    path = write(tmp_path / "t.csv", "time_s,s.A\n" + rows)
    with pytest.raises(BadTakeTable) as refused:
        read_takes(path, equal_times=equal_times)
    assert "60 frames have 1 different times: they are written with too few digits" in str(refused.value)
    assert "spread" not in str(refused.value)


names = st.text(st.characters(categories=("L", "N", "P", "S")), min_size=1, max_size=12)
channels = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}", fullmatch=True)
numbers = st.floats(-LARGEST_VALUE, LARGEST_VALUE)
maybe_numbers = st.one_of(st.just(float("nan")), numbers)
maybe_angles = st.one_of(st.just(float("nan")), st.floats(-LARGEST_ANGLE_DEG, LARGEST_ANGLE_DEG))
seconds = st.floats(-LONGEST_TAKE_S / 2, LONGEST_TAKE_S / 2)


def increasing(draw, rows: int) -> np.ndarray:
    return np.sort(np.array(draw(st.lists(seconds, min_size=rows, max_size=rows, unique=True))) + 0.0)


def matrix(draw, values, rows: int, columns: int) -> np.ndarray:
    flat = draw(st.lists(values, min_size=rows * columns, max_size=rows * columns))
    return np.array(flat, float).reshape(rows, columns)


def measured_only(labels: list[str], values: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    keep = [i for i in range(len(labels)) if np.isfinite(values[:, i]).any()]
    return tuple(labels[i] for i in keep), values[:, keep]


@st.composite
def take_lists(draw) -> list[Take]:
    """Takes as a program may build them: any names, numbers and gaps, some with a reference clock."""
    sensors = tuple(draw(st.lists(channels, min_size=1, max_size=3, unique=True)))
    own_clock = draw(st.booleans())
    takes = []
    for name in draw(st.lists(names, min_size=1, max_size=3, unique=True)):
        rows = draw(st.integers(1, 6))
        time = increasing(draw, rows)
        if len(set(time)) < rows:  # -0.0 and 0.0
            time = np.arange(rows) * 0.1
        reference_rows = draw(st.integers(1, 5)) if own_clock else rows
        labels = draw(st.lists(channels, max_size=3, unique=True))
        rotations, reference = measured_only(labels, matrix(draw, maybe_angles, reference_rows, len(labels)))
        context_names = draw(st.lists(channels.filter(lambda n: n != "simulated"), max_size=2, unique=True))
        kept, context = measured_only(context_names, matrix(draw, maybe_numbers, rows, len(context_names)))
        poses = tuple(draw(st.lists(st.one_of(st.just(""), names), min_size=rows, max_size=rows)))
        takes.append(
            Take(
                name=name,
                wearing=draw(st.one_of(st.just(""), names)),
                sensors=sensors,
                time_s=time,
                readings=matrix(draw, numbers, rows, len(sensors)),
                rotations=rotations,
                reference_time_s=(np.arange(reference_rows) / 7 if own_clock else time)
                if rotations
                else np.empty(0),
                reference=reference if rotations else np.empty((0, 0)),
                context=dict(zip(kept, context.T, strict=True)),
                poses=poses if any(poses) else None,
                simulated=draw(st.booleans()),
            )
        )
    return takes


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@settings(max_examples=60)
@given(takes=take_lists())
def test_round_trip_gives_back_every_digit(tmp_path_factory, suffix, takes):
    path = tmp_path_factory.mktemp("round") / f"export{suffix}"
    written = write_takes(takes, path)
    read = read_takes(written[0])
    assert [take.name for take in read] == [take.name for take in takes]
    for back, take in zip(read, takes, strict=True):
        order = [back.rotations.index(name) for name in take.rotations]
        assert set(back.rotations) == set(take.rotations)
        np.testing.assert_array_equal(back.reference[:, order] if order else np.empty((0, 0)), take.reference)
        contexts = {name: back.context[name] for name in take.context}
        assert set(back.context) == set(take.context)
        arrays = {"rotations": take.rotations, "reference": take.reference, "context": contexts}
        assert_same(Take(**{**vars(back), **arrays}), take)


def test_a_simulated_take_stays_marked_and_no_half_written_file_is_left(tmp_path):
    take = Take("t", "w", ("A",), np.array([0.0]), np.array([[1.0]]), simulated=True)
    write_takes([take], tmp_path / "t.csv")
    assert read_takes(tmp_path / "t.csv")[0].simulated
    assert [path.name for path in tmp_path.iterdir()] == ["t.csv"]


def test_takes_that_cannot_share_a_file_are_refused(tmp_path):
    one = Take("t", "w", ("A",), np.array([0.0]), np.array([[1.0]]))
    other = Take("u", "w", ("B",), np.array([0.0]), np.array([[1.0]]))
    empty = Take("v", "w", ("A",), np.empty(0), np.empty((0, 1)))
    with pytest.raises(BadInput, match="different files"):
        write_takes([one, other], tmp_path / "t.csv")
    with pytest.raises(BadInput, match="two takes are named 't'"):
        write_takes([one, one], tmp_path / "t.csv")
    with pytest.raises(BadInput, match="no frames"):
        write_takes([empty], tmp_path / "t.csv")
    with pytest.raises(BadInput, match=r"not to \.xlsx"):
        write_takes([one], tmp_path / "t.xlsx")
    with pytest.raises(BadInput, match="no take"):
        write_takes([], tmp_path / "t.csv")
    assert not list(tmp_path.iterdir())


def test_a_reference_that_never_moves_or_never_meets_the_frames_is_reported():
    time, readings = np.arange(10) / 10, np.arange(10.0)[:, None]
    still = Take("s", "", ("A",), time, readings, ("R",), time, np.full((10, 1), 30.0))
    apart = Take("p", "", ("A",), time, readings, ("R",), time + 100, readings)
    gappy = np.where(np.arange(10.0)[:, None] < 3, readings, np.nan)
    partly = Take("g", "", ("A",), time, readings, ("R",), time, gappy)
    good = Take("o", "", ("A",), time, readings, ("R",), time, readings)
    assert "never moves" in reference_warnings(still)[0]
    assert "clocks" in reference_warnings(apart)[0]
    assert "30 %" in reference_warnings(partly)[0]
    assert reference_warnings(good) == reference_warnings(Take("n", "", ("A",), time, readings)) == []
