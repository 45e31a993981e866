"""A name that is not known is answered in one way: the nearest that is, and which there are."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

import glovecal_client.keys
import glovecal_models.names

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("client/glovecal_client", "models/glovecal_models", "models/glovecal", "service/glovecal_service")
LISTING = re.compile(r"\b(there are|known are|installed are|built in are|it has|examined were) $")


@pytest.mark.parametrize("names", [glovecal_client.keys, glovecal_models.names])
def test_the_nearest_name_comes_first(names) -> None:
    known = ("hysteresis", "creep", "lag")
    assert names.did_you_mean("histeresis", known) == (
        "did you mean 'hysteresis'? There are hysteresis, creep, lag"
    )
    assert names.did_you_mean("Creep", known, there="it has").startswith("did you mean 'creep'? It has hyst")
    assert names.did_you_mean("zzz", known) == "there are hysteresis, creep, lag"
    assert names.did_you_mean("zzz", ()) == "there are none"
    assert names.did_you_mean("zzz", map(str, range(100))).endswith("22, 23 and 76 more")


def test_no_sentence_lists_known_names_by_itself() -> None:
    alone = []
    for path in (file for package in PRODUCT for file in (ROOT / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                for text, value in zip(node.values, node.values[1:], strict=False):
                    listing = isinstance(text, ast.Constant) and LISTING.search(str(text.value))
                    if listing and isinstance(value, ast.FormattedValue) and "join(" in ast.unparse(value):
                        alone.append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert alone == []
