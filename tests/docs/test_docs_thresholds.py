"""The page of thresholds is what the limits say, those that one file alone compares something with too."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(autouse=True)
def beside_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])


def test_the_page_is_what_the_limits_say() -> None:
    from thresholds_page import PAGE, thresholds_page

    assert PAGE.read_text(encoding="utf-8") == thresholds_page(), "python3 docs/thresholds_page.py writes it"


def test_a_limit_of_one_file_is_found_with_its_meaning_where_it_is_compared_or_imported() -> None:
    from thresholds_page import _compared, _constants, limits_where_used

    tree = ast.parse('LEAST = 2.0\n"""Of\nall."""\nMOST = 3\nNAME = "x"\n\ndef f(x):\n    return x < LEAST\n')
    assert _constants(tree) == {"LEAST": (2.0, "Of all."), "MOST": (3, "")}
    assert _compared(tree) == {"x", "LEAST"}
    found = {(item.file, item.name) for item in limits_where_used()}
    assert ("effects/delay/clock_wander.py", "LIKELIER_NATS") in found
    assert all(file.startswith(("diagnosis/", "effects/")) for file, _ in found)


def test_every_limit_of_the_diagnosis_itself_says_what_it_means() -> None:
    from thresholds_page import limits_where_used

    unsaid = [item for item in limits_where_used() if not item.meaning and "diagnosis/" in item.file]
    assert not [item for item in unsaid if "detectability" not in item.file]
