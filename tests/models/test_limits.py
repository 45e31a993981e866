"""Limits that decide what a user is told stand in one set a stage, each with what fixed it."""

from __future__ import annotations

import ast
from collections import defaultdict
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

import glovecal_models
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.limits import ComparisonLimits
from glovecal_models.comparison.noise_floor import is_at_floor
from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.effects.base.limits import SignificanceLimits
from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS, ImprovementLimits
from glovecal_models.limit import described_limits, with_limits
from glovecal_models.sampling.limits import SamplingLimits

MODELS = Path(glovecal_models.__file__).resolve().parent
SETS: list[type[Any]] = [
    SignificanceLimits,
    DiagnosisLimits,
    ComparisonLimits,
    ImprovementLimits,
    SamplingLimits,
]
NOT_TOLD = {
    "tolerances of numerical methods": (
        "AT_LIMIT_DEG JITTER MEAN_ERROR_DEG RIDGE SD_ERROR_DEG SINGULAR STILL_DEG STUCK_DEG TOUCHING_MM"
    ),
    "how finely an algorithm looks, and how long": (
        "BLOCK_S COARSE_S DRAWS EVERY FEW FINE_S FOLDS FRAMES_A_TOUCH LONGEST_STEP_DEG LOOKED_AT MOST_FRAMES"
        " MOST_NODES MOST_STEPS SHIFTS SHORT_S STEPS_AT_MOST STRETCH_S WINDOW_S _ROWS_AT_ONCE"
    ),
    "prior spreads, each of its own quantity": "PRIOR_DEG USUAL_RANGE_DEG WIDGET_SD_DEG",
    "how a simulated person, or one who is asked, moves": "HOLD_S LONGEST_S MOVE_S",
    "sizes of input that is refused": "LARGEST LONGEST_MM LONGEST_TEXT MOST_COLUMNS SHORTEST_MM",
    "names in a row of a sentence": "MOST_NAMED",
}
"""Constants of one name and several values that may stay: none decides what is found."""
MOVED = """
    ALIKE ALLOWED_STEP AT_FLOOR BEATEN BENT_PERCENT CLEAR CLEAR_CONTRAST CLEAR_CORRELATION CONFIDENCE
    DEAD_SHARE DECIDED ENOUGH_DEG ENOUGH_STRETCHES FAR_SHARE FEWEST_OF_A_POSE FEWEST_STRETCHES FIRST_GAIN HALF
    HEALTHY_DEG HEALTHY_SHARED_DEG JOINT_PROBABILITY JUMP_DEG JUMP_PERCENT LATER_GAIN LEAST_APART_DEG
    LEAST_CONTRAST LEAST_FALL LEAST_FREEDOM LEAST_GAIN LEAST_SESSION_CONTRAST LEAST_SHARE LEAST_WEIGHT MIDDLE
    MOST_LEFT_MM MOST_MISSING MOST_RISE MOST_UNDONE MOVED_PERCENT NEEDLESS PER_TAKE_GAIN POOLED_PROBABILITY
    RADIANS_WITHIN RESTLESS SAME_PERCENT SAME_POSE_SHARE SELDOM SHARED_PROBABILITY STILL_PERCENT
    STRUCTURE_PROBABILITY STRUCTURE_SHARE SURE TIMES_APART TOUCHING_PERCENT
"""
"""Module constants that were limits."""
STAGES = ("diagnosis", "comparison", "sampling", "improvement", "effects/base", "effects/delay")


def constants() -> dict[str, dict[str, float]]:
    """Numbers at the top of modules: by name, then by file; but for forms, which limit nothing."""
    found: dict[str, dict[str, float]] = defaultdict(dict)
    for path in (path for path in MODELS.rglob("*.py") if "causes" not in path.parts):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            for name, value in _assigned(node):
                found[name][path.relative_to(MODELS).as_posix()] = value
    return found


def _assigned(node: ast.stmt) -> list[tuple[str, float]]:
    if isinstance(node, ast.Assign):
        targets = node.targets
    elif isinstance(node, ast.AnnAssign):
        targets = [node.target]
    else:
        return []
    try:
        value = ast.literal_eval(node.value) if node.value is not None else None
    except ValueError:
        return []
    pairs: list[tuple[ast.expr, Any]] = [(target, value) for target in targets]
    for target in targets:
        if isinstance(target, ast.Tuple) and isinstance(value, tuple):
            pairs += zip(target.elts, value, strict=True)
    return [
        (target.id, number)
        for target, number in pairs
        if isinstance(target, ast.Name) and isinstance(number, int | float)
    ]


def test_constants_of_one_name_and_several_values_decide_nothing_that_is_told():
    may_stay = {name for names in NOT_TOLD.values() for name in names.split()}
    several = {name: files for name, files in constants().items() if len(set(files.values())) > 1}
    unlisted = {name: files for name, files in several.items() if name not in may_stay}
    assert not unlisted, (
        "a limit belongs to its stage's limits.py, another constant needs a name of its own or a line here: "
        f"{unlisted}"
    )


def test_limits_are_gone_from_the_modules_of_their_stages():
    found = constants()
    left = {
        f"{file}: {name}" for name in MOVED.split() for file in found.get(name, ()) if file.startswith(STAGES)
    }
    assert not left


@pytest.mark.parametrize("limits", SETS, ids=lambda item: item.__name__)
def test_every_limit_says_what_it_is_and_what_fixed_it(limits):
    found = described_limits(limits)
    sets = {"diagnosis", "comparison"} if limits is ImprovementLimits else set()
    assert {item.name for item in fields(limits)} == set(found) | sets
    for name, (value, about) in found.items():
        assert isinstance(value, int | float), name
        assert about.unit, name
        assert about.meaning.endswith("."), name
        assert about.fixed_by.endswith("."), name


def test_no_name_means_two_limits():
    names = [name for limits in SETS if limits is not SignificanceLimits for name in described_limits(limits)]
    assert sorted(names) == sorted(set(names))


def test_another_set_is_made_by_name_and_unknown_names_are_refused():
    other = with_limits(DIAGNOSIS_LIMITS, {"clear_share": 0.3, "hold_fewest": 5})
    assert (other.clear_share, other.hold_fewest, other.least_share) == (0.3, 5, 0.04)
    assert with_limits(IMPROVEMENT_LIMITS, {"later_gain": 1}).diagnosis is DIAGNOSIS_LIMITS
    with pytest.raises(BadInput, match=r"no limit 'clear'; did you mean 'clear_share'\? There are alike_"):
        with_limits(DIAGNOSIS_LIMITS, {"clear": 0.3})
    with pytest.raises(BadInput, match="no limit 'diagnosis'"):
        with_limits(IMPROVEMENT_LIMITS, {"diagnosis": 0.3})
    for value in ("0.3", True, float("nan")):
        with pytest.raises(BadInput, match="has to be a number"):
            with_limits(DIAGNOSIS_LIMITS, {"clear_share": value})
    with pytest.raises(BadInput, match="has to be a whole number"):
        with_limits(DIAGNOSIS_LIMITS, {"hold_fewest": 4.5})


def test_one_rule_says_what_is_at_the_floor():
    floor = NoiseFloor(1.0, 0.9, 1.1, 0.0, "still hand", 20)
    assert is_at_floor(1.09, floor)
    assert not is_at_floor(1.11, floor), "only inside the floor's own interval"
    assert is_at_floor(1.27, floor, with_limits(ComparisonLimits(), {"at_floor_times": 1.2}))
    assert not is_at_floor(0.5, floor), "an estimate above the error is wrong"
    assert not is_at_floor(1.09, replace(floor, reasons=("the clocks are not repaired",)))
    assert not is_at_floor(0.5, NoiseFloor(1.0, 0.9, 1.1, 0.0, "spectrum", 20))
    assert not is_at_floor(0.5, None)
