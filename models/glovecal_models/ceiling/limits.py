"""When something is left to gain from what was recorded, and when nothing is."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_models.limit import limit


@dataclass(frozen=True)
class CeilingLimits:
    """Of the verdict on the black-box ceiling."""

    none_below: float = limit(
        0.05,
        "share of the RMSE",
        "With the upper bound of the gain below this, nothing is left to gain.",
        "Chosen: a fall that a user would not notice.",
    )
    gain_p_value: float = limit(
        0.01,
        "p value",
        "Of the gain, by flipping the sign of whole takes; of a rotation, divided by their number.",
        "Chosen.",
    )
    least_gain: float = limit(
        0.02,
        "share of the RMSE",
        "A smaller gain is not told, however significant.",
        "Chosen.",
    )
    most_by_take: float = limit(
        0.5,
        "share of a rotation's squared error",
        "With more of it changing from take to take, it is not said that nothing is left to gain.",
        "At most 0.35 in 8 simulated clean gloves, 0.66 to 0.84 in 15 with a cause that changes from take to"
        " take at 1.3 noise floors (2026-11-22).",
    )
    fewest_takes: int = limit(
        6,
        "takes",
        "With fewer there is no verdict.",
        "Flipping the signs of five takes cannot give p below 0.03.",
    )


CEILING_LIMITS = CeilingLimits()
