"""Tables of other programs at the command line: looked at, corrected in a file, imported."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from foreign_tables import logger, semicolons

SHORT = {"count": 5, "seconds": 3.0}


def test_a_foreign_table_is_looked_at_and_imported_as_it_was_shown(run: Any, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, **SHORT)
    refused = run("take", "import", path, "-s", "dora")
    assert refused.code == 1
    assert "glovecal take look FILE" in refused.err
    seen = run("take", "look", path)
    assert seen.code == 0, seen.err
    assert "5 takes in 2 wearings of 5 sensors" in seen.out
    assert "--subject NAME --columns guess" in seen.out.replace("\n", " ")
    assert json.loads(run("take", "list", "--json").out) == []
    found = run("take", "import", path, "-s", "dora", "--columns", "guess", "--json")
    assert found.code == 0, found.err
    assert [row["wearing"] for row in json.loads(found.out)] == ["w1"] * 4 + ["w2"]


def test_what_a_file_of_columns_says_is_done(run: Any, tmp_path: Path) -> None:
    files = logger(tmp_path, **SHORT)
    [seen] = json.loads(run("take", "look", files[0], "--json").out)
    for column in seen["mapping"]["columns"]:
        if column["header"] in ("A1", "joint1"):
            column["name"] = "I_PIP"
    corrected = tmp_path / "columns.json"
    corrected.write_text(json.dumps([seen]))
    found = run("take", "import", *files, "-s", "emil", "--columns", corrected, "--json")
    assert found.code == 0, found.err
    assert {row["rotations"][1] for row in json.loads(found.out)} == {"I_PIP"}


@pytest.mark.parametrize(
    ("content", "words"), [(None, "there is no such file"), ("[]", "not what `glovecal")]
)
def test_a_file_that_says_no_columns_is_refused(
    run: Any, tmp_path: Path, content: str | None, words: str
) -> None:
    [path] = semicolons(tmp_path, **SHORT)
    columns = tmp_path / "columns.json"
    if content is not None:
        columns.write_text(content)
    refused = run("take", "import", path, "-s", "dora", "--columns", columns)
    assert refused.code == 1
    assert words in refused.err.replace("\n", " ")
