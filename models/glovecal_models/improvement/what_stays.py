"""What is left at the end of a walk, beside how small it could get: in one sentence."""

from __future__ import annotations

from collections.abc import Mapping

from glovecal_models.comparison.floor_estimate import NoiseFloor

MOST_NAMED = 4


def what_stays(per_rotation: Mapping[str, float], floors: Mapping[str, NoiseFloor]) -> str:
    """``per_rotation``: errors (deg) of the last step. The largest first."""
    worst = sorted(per_rotation, key=lambda name: -per_rotation[name])
    told = ", ".join(
        f"{per_rotation[name]:.2f} on {name}{_floor(floors.get(name))}" for name in worst[:MOST_NAMED]
    )
    more = f" and less on {len(worst) - MOST_NAMED} more" if len(worst) > MOST_NAMED else ""
    return f"What stays, in degrees on takes not trained on: {told}{more}."


def repeats_sentence(floors: Mapping[str, NoiseFloor]) -> str | None:
    """How well single poses repeat; None where that was measured in another way."""
    found = {name: floor for name, floor in floors.items() if floor.how == "near readings"}
    if not found:
        return None
    worst = sorted(found, key=lambda name: -found[name].floor_deg)[:MOST_NAMED]
    told = ", ".join(f"{found[name].floor_deg:.1f} on {name}" for name in worst)
    return (
        f"The reference repeats itself only to about so many degrees: {told}. Frames that read nearly the"
        " same differ by so much, and no model of these takes can be better."
    )


def _floor(floor: NoiseFloor | None) -> str:
    if floor is None:
        return " (noise floor unknown)"
    return f" (noise floor {'at least ' if floor.is_lower_bound else ''}{floor.floor_deg:.2f})"
