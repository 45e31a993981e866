"""The table of ``docs/bridges.md`` says what the bridges say of themselves."""

from __future__ import annotations

from pathlib import Path

from glovecal_service.bridges.catalogue import BRIDGES

PAGE = Path(__file__).resolve().parents[2] / "docs" / "bridges.md"
HEAD = "|---|---|---|---|---|\n"


def test_every_bridge_has_its_row() -> None:
    rows = [
        f"| `{name}` | {one.about} | {one.to_set_there} | {one.units} | {one.when_stale} |"
        for name, one in BRIDGES.items()
    ]
    page = PAGE.read_text(encoding="utf-8")
    table = page.split(HEAD)[1].split("\n\n")[0].splitlines()
    assert table == rows, "write these rows into docs/bridges.md:\n" + "\n".join(rows)
