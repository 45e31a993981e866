"""The table of ``docs/exports.md`` says what the formats say of themselves."""

from __future__ import annotations

from pathlib import Path

from glovecal_service.exports.formats import FORMATS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "exports.md"
HEAD = "|---|---|---|---|---|---|---|---|\n"


def test_every_format_has_its_row() -> None:
    rows = [
        f"| `{one.suffix}` | {one.name} | {', '.join(one.contents)} | {one.unit} | {one.axes} "
        f"| {one.times} | {one.accuracy} | {one.read_by} |"
        for one in FORMATS.values()
    ]
    page = PAGE.read_text(encoding="utf-8")
    table = page.split(HEAD)[1].split("\n\n")[0].splitlines()
    assert table == rows, "write these rows into docs/exports.md:\n" + "\n".join(rows)
