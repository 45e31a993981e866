"""The offline study's table, from answers that are known; and that gloves looked at are no others."""

from __future__ import annotations

from pathlib import Path

from offline_study import (
    CONDITIONS,
    CURVE_HEAD,
    FIRST_SEED,
    GLOVES,
    HEAD,
    TUNED_SEED,
    Found,
    curve_row_of,
    draw_curves,
    row_of,
    session_of,
    split,
)


def test_the_tables_set_ratios_beside_what_is_asked(tmp_path: Path) -> None:
    found = [
        Found((1.0, 0.9, 0.7, 0.5, 0.4, 0.4), (0.95, 0.9, 0.91, 0.92, 0.94, 0.94), ""),
        Found((2.0, 1.8, 1.6, 1.4, 1.3, 1.2), (0.97, 0.9, 0.93, 0.94, 0.96, 0.96), ""),
    ]
    row, curve = row_of(CONDITIONS[0], found), curve_row_of(CONDITIONS[0], found)
    assert row == "| noise alone | 2 | 1.58 | 0.89 | 0.57 | 0.40 to 0.60 | at most 0.6 | 96.0 % | 95.0 % |"
    assert HEAD.splitlines()[0].count("|") == row.count("|")
    assert curve == "| noise alone | 1.58 | 1.42 | 1.23 | 1.05 | 0.96 | 0.89 | 90.0 to 95.0 % |"
    assert CURVE_HEAD.splitlines()[0].count("|") == curve.count("|")
    draw_curves({"noise alone": found, "lag": found[:1]}, tmp_path / "delay.png")
    assert (tmp_path / "delay.png").stat().st_size > 5_000


def test_the_last_take_of_each_wearing_is_kept_apart_and_so_are_the_gloves() -> None:
    session = session_of(CONDITIONS[2], TUNED_SEED)
    known, held = split(session)
    assert [session.takes[number].name for number in held] == ["w1-t4", "w2-t4"]
    assert not set(known) & set(held)
    assert TUNED_SEED + GLOVES < FIRST_SEED
