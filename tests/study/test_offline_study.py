"""The offline study's table, from answers that are known; and that gloves looked at are no others."""

from __future__ import annotations

from offline_study import CONDITIONS, FIRST_SEED, GLOVES, HEAD, TUNED_SEED, Found, row_of, session_of, split


def test_the_table_sets_ratios_beside_what_is_asked() -> None:
    row = row_of(CONDITIONS[0], [Found(1.0, 0.4, 0.95, 0.94, ""), Found(2.0, 1.2, 0.97, 0.96, "")])
    assert row == "| noise alone | 2 | 1.58 | 0.89 | 0.57 | 0.40 to 0.60 | at most 0.6 | 96.0 % | 95.0 % |"
    assert HEAD.splitlines()[0].count("|") == row.count("|")


def test_the_last_take_of_each_wearing_is_kept_apart_and_so_are_the_gloves() -> None:
    session = session_of(CONDITIONS[2], TUNED_SEED)
    known, held = split(session)
    assert [session.takes[number].name for number in held] == ["w1-t4", "w2-t4"]
    assert not set(known) & set(held)
    assert TUNED_SEED + GLOVES < FIRST_SEED
