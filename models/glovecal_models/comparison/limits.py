"""When a noise floor is known, when it is reached, and when an error depends on something."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_models.limit import limit

_CHOSEN = "Not tuned; chosen."
_PLANTED = (
    "Tuned with faults planted into real takes of three people's ankle sleeves and one's gait, of which no"
    " take may be odd as it came; then asked of three other people, and changed once more (2026-11-28)."
)
_ODD = (
    "Tuned on flex gloves of five sensors and simulated sessions with every known cause, of which no take"
    " may be odd; then none in 24 sessions of another seed (2026-11-25)."
)


@dataclass(frozen=True)
class ComparisonLimits:
    """Of noise floors and of what is said where a model fails."""

    at_floor_times: float = limit(
        1.0,
        "times the upper end of the floor's interval",
        "An error up to this is at the noise floor: nothing is left to gain.",
        "An error is called noise only where it lies within the floor's own interval; 1.15 before.",
    )
    restless_times: float = limit(
        1.5,
        "times the reference's noise",
        "A prediction that jitters by more follows its sensors too closely.",
        _CHOSEN,
    )
    structure_p_value: float = limit(
        0.005, "p value", "That errors shifted in time depend on a column as much.", _CHOSEN
    )
    structure_share: float = limit(
        0.04,
        "share of the mean squared error",
        "A column must explain so much to be worth a user's time.",
        _CHOSEN,
    )
    mostly_bias_share: float = limit(
        0.6, "share of the RMSE", "A constant error of so much is said to be most of it.", _CHOSEN
    )
    wearing_p_value: float = limit(
        0.05, "p value", "That takes dealt to wearings in other ways differ as much.", "The usual level."
    )
    wearing_fewest_deals: int = limit(
        20,
        "ways to deal the takes",
        "With fewer nothing is said of wearings.",
        "No answer could be better than one in twenty.",
    )

    cross_validation_ratio: float = limit(
        3.0,
        "times the root of the summed claimed variances",
        "Two models of disjoint takes that differ by more in a posture: the model is wrong there.",
        "Largest in 56 clean simulated gloves (linear and lmc_gpr, 1 and 3 wearings): 2.3.",
    )
    still_deg_per_s: float = limit(6.0, "degrees/s", "A joint that moves less over a hold is still.", _CHOSEN)
    still_share: float = limit(
        0.1,
        "share of the sensor's standard deviation",
        "A sensor that changes by less over a hold is still; the hand is when all are.",
        _CHOSEN,
    )
    shortest_hold_s: float = limit(0.5, "s", "A shorter rest is no hold.", _CHOSEN)
    settled_s: float = limit(
        0.2,
        "s",
        "The beginning of a hold that is left out.",
        "Lag and creep are no noise; the value is chosen, not tuned.",
    )
    fewest_hold_frames: int = limit(5, "frames", "A hold with fewer is not used.", _CHOSEN)
    fewest_holds: int = limit(4, "holds", "With fewer there is no floor from holds.", _CHOSEN)
    enough_holds: int = limit(
        8, "holds", "A floor from fewer is not reliable.", "Chosen: with 8 the interval spans about 20 %."
    )
    disturbed_hold_times: float = limit(
        4.0,
        "times the median variance of all holds",
        "A hold that spreads more is left out: something happened in it.",
        "Of holds of 5 white frames 2 % spread as much by chance; the value is chosen, not tuned.",
    )
    slowest_hz: float = limit(
        15.0,
        "frames/s",
        "A floor from fewer frames a second is not reliable.",
        "At 9 Hz a hold of half a second has 5 frames, and the hand moves between any two of them.",
    )
    clock_least_s: float = limit(
        0.08, "s", "Readings and angles so far apart in time are not aligned.", _CHOSEN
    )
    clock_least_share: float = limit(
        0.25,
        "share of the unexplained variance",
        "Moving the reference must save so much.",
        "The value is chosen, not tuned.",
    )
    wander_times: float = limit(
        2.0,
        "times the floor",
        "A reference that moves more within holds in which no sensor moves wanders.",
        _CHOSEN,
    )
    fewest_repeats: int = limit(
        4,
        "repeats beyond the first of their pose",
        "With fewer there is no floor from repeated poses.",
        "The spread would be a guess; the value is chosen, not tuned.",
    )
    fewest_spectrum_blocks: int = limit(
        4, "blocks of 4 s without a gap", "With fewer there is no floor from the spectrum.", _CHOSEN
    )
    fewest_pairs: int = limit(
        10, "pairs of frames", "With fewer there is no floor from near readings.", _CHOSEN
    )
    neighbours_s: float = limit(
        0.25,
        "s",
        "Frames further apart are no neighbours.",
        "The hand may be anywhere else; the value is chosen, not tuned.",
    )
    odd_least_deg: float = limit(
        5.0, "degrees", "A take less far off a line through the others fits them.", _ODD
    )
    odd_times: float = limit(
        2.5, "times the largest error of the others", "A take that is less far off fits them.", _ODD
    )
    odd_share: float = limit(
        0.35,
        "share of the standard deviation of its angles",
        "A take fits if the line through the others leaves less of it.",
        _ODD,
    )
    odd_level_deg: float = limit(
        20.0,
        "degrees",
        "Readings of a take that lie so far elsewhere at the same angles are odd.",
        "A glove that is put on again is off by up to 15 degrees.",
    )
    odd_level_other_wearing_deg: float = limit(
        30.0, "degrees", "The same where no other take is of its wearing.", _ODD
    )
    odd_level_times: float = limit(3.0, "times the others", "The same.", _ODD)
    odd_level_told_share: float = limit(
        0.5,
        "share of the standard deviation of its angles",
        "A level is judged only where the line leaves less of a take.",
        "Four real takes of an ankle with clocks 0.4 to 0.8 s off; their lines follow nothing.",
    )
    odd_fitted_times: float = limit(
        1.6, "times the largest error of the others", "A change that leaves more makes no take fit.", _ODD
    )
    odd_alike_share: float = limit(
        0.8, "share of the error", "Changes that leave errors nearer to each other are not told apart.", _ODD
    )
    exchanged_share: float = limit(
        0.4,
        "share of the squared difference",
        "Columns are exchanged where that leaves so little between a take and the others, in like postures.",
        _PLANTED + " As they came, exchanging left 1.1 at least; two of three exchanged columns leave 0.5.",
    )
    exchanged_times: float = limit(
        4.0,
        "times the squared difference of the others",
        "Sensors of a take that differ less from the others', in like postures, are not exchanged; once they"
        " are, they must.",
        _PLANTED,
    )
    exchanged_least: float = limit(
        1.2, "times the squared difference of the others", "The same of reference columns.", _PLANTED
    )
    other_level_least: float = limit(
        0.65,
        "standard deviations",
        "Most sensors of a take must be so far from the others', in like postures, to be somebody else's.",
        _PLANTED,
    )
    other_level_times: float = limit(1.5, "times the others' distance", "The same.", _PLANTED)
    wandering_deg: float = limit(
        5.0,
        "degrees",
        "A reference that wanders less within a take is not told.",
        _PLANTED + " One of the three others seems to wander by 4 as it came: this was 4 before.",
    )
    wandering_times: float = limit(1.5, "times the other takes'", "The same.", _PLANTED)
    wandering_share: float = limit(
        0.6,
        "share of the error",
        "A slow change with time must leave so little of what sensors do not explain of a take.",
        _PLANTED,
    )


COMPARISON_LIMITS = ComparisonLimits()
