"""Identifiers are the field's terms: names that had to be read twice stay away, vague ones get fewer."""

from __future__ import annotations

import ast
import re
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = ("models", "client", "service")
NEVER = {
    "told_from_alikes", "rest_like", "also_explained_by", "beside_known", "beside_wholes", "beside_hidden",
    "beside_levels", "GloveLane", "GloveLanes", "WornGlove", "AskedPerson", "_look_around", "_sort_in",
    "TakenApart",
}  # fmt: skip
"""What each is called instead stands in the history of this file's commit."""
AT_MOST = {
    "told": 115,
    "said": 106,
    "heard": 43,
    "found": 847,
    "lane": 76,
    "lanes": 63,
    "beside": 81,
    "worn": 43,
    "nodes": 26,
    "pulls": 5,
    "doubt": 8,
    "patience": 28,
}
"""Definitions whose name has this word. Limits only fall."""


def defined() -> Counter[str]:
    """Names of functions, classes, parameters and variables, each as often as it is defined."""
    names: Counter[str] = Counter()
    for path in (path for part in PRODUCT for path in (ROOT / part).glob("glovecal*/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                names[node.name] += 1
            elif isinstance(node, ast.arg):
                names[node.arg] += 1
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names[node.id] += 1
    return names


def test_names_that_had_to_be_read_twice_do_not_come_back() -> None:
    assert NEVER & set(defined()) == set()


def test_vague_words_in_names_get_fewer() -> None:
    words: Counter[str] = Counter()
    for name, count in defined().items():
        for word in set(re.split(r"_+|(?<=[a-z])(?=[A-Z])", name)):
            words[word.lower()] += count
    assert {word: words[word] for word in AT_MOST if words[word] > AT_MOST[word]} == {}
