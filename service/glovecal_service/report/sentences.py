"""What the pictures show in this data, in words."""

from __future__ import annotations

from glovecal_models.comparison.compare import Comparison
from glovecal_models.comparison.where_it_fails import WhereItFails


def counted(count: int, noun: str) -> str:
    """ "1 take", "2 takes"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def in_one_sentence(numbers: Comparison, where: WhereItFails) -> str:
    """Error with its scale, truthfulness, and where to look."""
    over_all, worst = numbers.over_all, where.rotations[0]
    floor = over_all.floor
    least = "at least " if floor is not None and floor.is_lower_bound else ""
    floor_of_all = f"the noise floor is {least}{floor.floor_deg:.2f}, and " if floor is not None else ""
    return (
        f"Over {counted(len(numbers.rotations), 'rotation')} the error is {over_all.rmse_deg:.2f} degrees "
        f"(RMSE); {floor_of_all}always answering the mean angle would be off by {over_all.baseline_deg:.1f}. "
        f"{100 * over_all.coverage:.0f} % of the errors lie within one claimed standard deviation; 68 % "
        f"would be truthful. Most is to gain at {worst.rotation}."
    )


def floors_sentence(where: WhereItFails) -> str:
    """Which rotations cannot get better."""
    done = [item.rotation for item in where.rotations if item.is_at_floor]
    if not done:
        return "No rotation is at its noise floor yet."
    return f"{len(done)} of {len(where.rotations)} rotations are at their noise floor: {', '.join(done)}."


def heat_sentence(where: WhereItFails) -> str:
    """The largest of what is no noise."""
    marked = [(item, one) for item in where.rotations for one in item.structure]
    if not marked:
        return "No recorded column explains more of any error than chance does."
    item, one = max(marked, key=lambda pair: pair[1].explained_deg)
    return (
        f"A dot marks what is no noise. The largest: {one.phrase} explains {one.explained_deg:.1f} degrees "
        f"of {item.rotation}'s {item.rmse_deg:.1f}."
    )
