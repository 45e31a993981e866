"""One definition of the error in what is said of an effect, and a name of its own for any other."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from glovecal_models.calibration.leave_out import HeldOutErrors
from glovecal_models.improvement.addition import Addition
from glovecal_models.improvement.text import addition_sentence

ROOT = Path(__file__).resolve().parents[3]
OF_DIAGNOSES = (
    "models/glovecal_models/diagnosis",
    "models/glovecal/_diagnosis.py",
    "service/glovecal_service/questions/diagnose.py",
    "service/glovecal_service/studio/pages/diagnose.py",
    "service/glovecal_service/studio/findings",
)


def addition(*judged: str, added: bool = True) -> Addition:
    before = HeldOutErrors({"I_PIP": 1600.0, "M_PIP": 100.0}, {"I_PIP": 100, "M_PIP": 100})
    after = HeldOutErrors({"I_PIP": 400.0, "M_PIP": 100.0}, {"I_PIP": 100, "M_PIP": 100})
    rotations = [SimpleNamespace(rotation=name, regressor=None) for name in before.square]
    model = cast(Any, SimpleNamespace(rotations=rotations))
    return Addition("hysteresis", judged, added, before, after, model, (), judged=judged, least_gain=0.1)


def test_the_error_of_some_rotations_is_not_told_as_the_models() -> None:
    assert addition_sentence(addition("I_PIP")) == (
        "hysteresis on I_PIP reduces the held-out error there from 4.00 to 2.00 degrees (50 %)."
    )
    of_all = addition_sentence(replace(addition("I_PIP"), of_all_deg=(2.92, 1.58)))
    assert of_all.endswith("2.00 degrees (50 %). Over all rotations it was 2.92 and is 1.58 degrees.")
    everywhere = addition_sentence(addition("I_PIP", "M_PIP"))
    assert "reduces the held-out error from 2.92 to 1.58 degrees (46 %)" in everywhere
    assert "held-out error there 4.00 degrees before" in addition_sentence(addition("I_PIP", added=False))


@pytest.mark.parametrize("place", OF_DIAGNOSES)
def test_a_diagnosis_calls_its_smoothed_errors_so(place: str) -> None:
    """They lie below the noise floor where they are good: no held-out error can."""
    path = ROOT / place
    for file in path.rglob("*.py") if path.is_dir() else [path]:
        tree = ast.parse(file.read_text(encoding="utf-8"))
        docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
                assert "held-out error" not in node.value.lower(), f"{file}:{node.lineno}"
