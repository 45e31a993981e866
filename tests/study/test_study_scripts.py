"""What a script has worked off in other processes is found there: none of them knows its ``__main__``."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
SCRIPTS = sorted(
    path
    for folder in ("study", "paper", "bench")
    for path in (TESTS / folder).glob("*.py")
    if '\nif __name__ == "__main__":' in path.read_text(encoding="utf-8")
)


def own_work(tree: ast.Module) -> set[str]:
    """Functions of the script that it passes to ``work_off``, or binds arguments to."""
    own = {each.name for each in tree.body if isinstance(each, ast.FunctionDef)}
    calls = [each for each in ast.walk(tree) if isinstance(each, ast.Call) and each.args]
    passed = [
        each.args[0].id
        for each in calls
        if isinstance(each.func, ast.Name)
        and each.func.id in ("work_off", "partial")
        and isinstance(each.args[0], ast.Name)
    ]
    return own.intersection(passed)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_work_of_its_own_is_found_by_the_name_of_its_module(script: Path) -> None:
    tree = ast.parse(script.read_text(encoding="utf-8"))
    begun = next(
        each for each in tree.body if isinstance(each, ast.If) and "__main__" in ast.unparse(each.test)
    )
    imported = {name.name for each in ast.walk(begun) if isinstance(each, ast.Import) for name in each.names}
    assert not own_work(tree) or script.stem in imported, own_work(tree)
