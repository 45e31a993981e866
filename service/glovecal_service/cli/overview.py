"""``glovecal`` alone: what there is, and what to do next."""

from __future__ import annotations

from collections.abc import Sequence

from glovecal_service.cli.terminal.connection import connect, is_remote, settings_of_environment
from glovecal_service.cli.terminal.printing import out
from glovecal_service.plain import read
from glovecal_service.rest.overview.answer import FIRST_STEPS, NextStep, Overview


def print_overview() -> None:
    """A folder that is not there yet is not made."""
    folder = None if is_remote() else settings_of_environment().data
    if folder is not None and not folder.exists():
        _print(f"Nothing is in {folder} yet.", FIRST_STEPS)
        return
    with connect() as service:
        found = read(Overview, service.get("/overview"))
    where = "" if folder is None else f"{folder}: "
    running = f" {found.unfinished_jobs} under way: glovecal job list." if found.unfinished_jobs else ""
    _print(f"{where}{found.sentence}{running}", found.steps)


def _print(sentence: str, steps: Sequence[NextStep]) -> None:
    out.print(sentence)
    for step in steps:
        out.print(f"  {step.command}\n      {step.sentence}", highlight=False, soft_wrap=True)
    out.print("All verbs: glovecal -h")
