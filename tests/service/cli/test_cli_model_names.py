"""``glovecal model name``, ``remove`` and ``restore``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from foreign_tables import semicolons


def test_a_model_is_named_removed_and_restored(run: Any, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 4, seconds=3.0)
    assert run("take", "import", path, "-s", "dora", "--columns", "guess").code == 0
    trained = run("train", "-s", "dora", "--method", "linear", "--folds", "0", "--no-activate", "--json")
    assert trained.code == 0, trained.err
    [model] = json.loads(run("model", "list", "--json").out)
    assert "is called Monday" in run("model", "name", model["id"], "Monday").out
    assert "Monday" in run("model", "list").out
    removed = run("model", "remove", model["id"])
    assert f"glovecal model restore {model['id'][:12]}" in removed.out
    assert json.loads(run("model", "list", "--json").out) == []
    assert run("model", "restore", model["id"][:12]).code == 0
    [again] = json.loads(run("model", "list", "--json").out)
    assert (again["id"], again["name"]) == (model["id"], "Monday")
