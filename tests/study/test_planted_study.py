"""The marking of planted faults: what counts as found, and as a false word."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import pytest
from planted_faults import FAULTS, UNTOUCHED, Marked, asked, sessions
from planted_study import HEAD, row_of


def test_a_row_counts_what_was_found_and_what_was_false() -> None:
    some = [
        Marked("dead", "one", 0, True, (), (), None),
        Marked("dead", "two", 0, False, ("B is dead",), (), None),
    ]
    row = row_of("dead", some)
    assert row == "| dead | 1 of 2 | 1.3 to 98.7 % | 1 of 2 | 1.3 to 98.7 % | 0 |"
    assert HEAD.splitlines()[0].count("|") == row.count("|")


@pytest.mark.needs_shared_data
def test_faults_of_a_real_sleeve_are_told_and_nothing_of_it_as_it_came(
    not_here: Callable[[str], NoReturn],
) -> None:
    """One of those on which the rules were tuned; docs/study-tried.md has the others."""
    session = next((item for item in sessions() if item.name == "P302-placement1"), None)
    if session is None:
        not_here("the ankle recordings are not here")
    assert asked(session, UNTOUCHED, 0).false == ()
    often_missed = ("two references swapped", "a wandering reference", "somebody else's take")
    found = {fault: asked(session, fault, 0) for fault in FAULTS if fault not in often_missed}
    assert [fault for fault, marked in found.items() if not marked.found] == []
    assert [sentence for marked in found.values() for sentence in marked.false] == []
