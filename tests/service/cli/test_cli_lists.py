"""Long lists on the command line: the newest rows, how many there are, and how to see the others."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from cli_running import Run

from glovecal_models.takes.take import Take
from glovecal_service.cli.terminal.listing import SHOWN
from glovecal_service.settings import Settings
from glovecal_service.store import Store

EVERY = 2 * SHOWN + 5


@pytest.fixture
def filled(tmp_path: Path, run: Run) -> Run:
    with Store.open(Settings(data=tmp_path / "data")) as store:
        store.subjects.create("anna")
        time_s = np.arange(3) / 100
        for number in range(EVERY):
            store.jobs.create("train" if number % 2 else "diagnose", {}, subject="anna")
            readings = np.full((3, 1), float(number))
            take = Take(f"fist-{number:03d}", "w", ("a",), time_s, readings)
            store.takes.add(take, subject="anna", layout="one", source="import")
    return run


def names(text: str) -> list[str]:
    return re.findall(r"fist-\d{3}", text)


def told(text: str) -> list[str]:
    """The command that shows what is next."""
    found = re.search(r"Next: glovecal (.*)", text)
    return [] if found is None else shlex.split(found[1])


def test_the_newest_takes_are_shown_and_the_told_commands_show_the_others(filled: Run) -> None:
    parts, command = [], ["take", "list", "--subject", "anna"]
    while command:
        shown = filled(*command)
        parts.append(names(shown.out))
        command = told(shown.err)
        if len(parts) == 1:
            assert shown.err.startswith(f"{SHOWN} rows, {EVERY} in all; --all lists every one.\nNext: ")
    assert [len(part) for part in parts] == [SHOWN, SHOWN, 5]
    expected = [f"fist-{number:03d}" for number in range(EVERY)]
    assert [name for part in reversed(parts) for name in part] == expected, "the newest is the last"
    assert names(filled("take", "list", "--all").out) == expected
    assert len(filled("take", "list", "--json").json) == EVERY, "programs get all unless they ask for fewer"
    assert [row["name"] for row in filled("take", "list", "--json", "--limit", "2").json] == expected[-2:]


def test_filters_choose_rows_and_stay_in_the_told_command(filled: Run) -> None:
    shown = filled("job", "list", "--kind", "train", "--limit", "3")
    assert shown.out.count("train") == 3
    assert "diagnose" not in shown.out
    assert told(shown.err)[:4] == ["job", "list", "--kind", "train"]
    assert len(filled("job", "list", "--kind", "train", "--json").json) == EVERY // 2
    assert filled("job", "list", "--state", "done").out.startswith("No jobs")
    assert filled("job", "list", "--since", "2100-01-01").out.startswith("No jobs")
    assert len(filled("job", "list", "--since", "2020-01-01", "--json").json) == EVERY
    assert names(filled("take", "list", "--text", "fist-007").out) == ["fist-007"]


def test_a_day_that_is_none_is_refused_in_a_sentence(filled: Run) -> None:
    refused = filled("job", "list", "--since", "monday")
    assert refused.code == 2
    assert "'monday' is no day or time" in refused.err


def test_a_place_that_is_none_is_refused_in_a_sentence(filled: Run) -> None:
    refused = filled("job", "list", "--after", "nowhere")
    assert refused.code == 1
    assert "is no place in this list" in refused.err


def test_a_take_is_found_by_its_name_among_many(filled: Run) -> None:
    assert "fist-007" in filled("take", "check", "fist-007").out
    refused = filled("take", "check", "fist-07")
    assert refused.code == 1
    assert "there is no take 'fist-07'; " in refused.err
