"""When a sampled step is good, when hands are still, and when enough is known."""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_models.limit import limit
from glovecal_models.takes.still_hand import STILL_SHARE

_FIRST = "Not tuned; chosen with the first guided sampling (2026-11-21)."


@dataclass(frozen=True)
class SamplingLimits:
    """Of verdicts on the steps of a sampling."""

    still_percent: float = limit(
        100 * STILL_SHARE,
        "% of the active range",
        "A hand whose sensors move less is still.",
        "The same number as for poses that are found held in takes; not tuned.",
    )
    moving_times_still: float = limit(
        3.0, "times `still_percent`", "A hand that moves more has moved on purpose.", _FIRST
    )
    settle_timeout_s: float = limit(
        8.0, "s", "A hand that does not come to rest so long makes a pose bad.", _FIRST
    )
    lost_after_s: float = limit(1.0, "s", "A glove that is silent so long is said to be gone.", _FIRST)
    back_after_s: float = limit(0.3, "s", "A glove that is heard so long without a pause is back.", _FIRST)

    fewest_frames: int = limit(10, "frames", "A step with fewer is bad.", _FIRST)
    most_missing_share: float = limit(0.2, "share of the frames", "A step that lacks more is bad.", _FIRST)
    longest_silence_s: float = limit(0.3, "s", "A longer silence makes a step bad.", _FIRST)
    jump_percent: float = limit(
        12.0,
        "% of the active range",
        "A larger step between two frames is a jump, unless `fastest_percent_s` allows more.",
        _FIRST,
    )
    fastest_percent_s: float = limit(
        1500.0,
        "% of the active range/s",
        "No hand moves faster.",
        "A finger's hundred degrees in a fifteenth of a second.",
    )
    moved_percent: float = limit(
        25.0, "% of the active range", "A sensor that had to move went at least so far.", _FIRST
    )
    touching_percent: float = limit(
        12.0,
        "% of the active range",
        "The same of a finger whose tip stays on the thumb's.",
        "Ring and little finger get no further than 20 % (2026-11-21).",
    )
    bent_percent: float = limit(
        10.0, "% of the active range", "A finger that is nearer to flat did not touch the thumb.", _FIRST
    )
    dead_share: float = limit(
        0.2,
        "share of the smallest sensible range",
        "A sensor that shows less while everything moves is dead.",
        _FIRST,
    )

    widget_fewest: int = limit(
        3, "widgets", "Of one rotation that can contradict.", "Two angles always agree."
    )
    widget_step_share: float = limit(
        0.7,
        "share of the smallest step between widgets",
        "A widget that reads further from its angle is doubted.",
        "No sensor is quite straight; the value is chosen, not tuned.",
    )
    same_percent: float = limit(
        8.0,
        "% of the active range",
        "A sensor that differs by more in every pose at the end has moved on the hand.",
        "With 2.5 degrees from time to time, a hundred degrees repeat within 3.5 %.",
    )
    repeat_deg: float = limit(
        2.5,
        "degrees",
        "A person repeats a pose about so well; the scale of a step that is asked twice.",
        "The same as for held poses in training.",
    )
    repeat_percent: float = limit(
        3.5,
        "% of the active range",
        "The same where the sampling knows no counts per degree.",
        "2.5 degrees from time to time, of a hundred.",
    )
    repeat_times: float = limit(
        2.0,
        "times `repeat_deg` or `repeat_percent`",
        "A step that differs by more the second time tells of slip or drift.",
        "Not tuned; chosen with the random order (2026-11-22).",
    )
    touch_most_left_mm: float = limit(
        8.0,
        "mm",
        "Between tips that touched, under the likeliest calibration; with more the touch is refused.",
        "A true touch leaves 1 to 2 mm (2026-11-22).",
    )

    enough_deg: float = limit(
        0.02,
        "degrees",
        "A step that lowers the expected error of a frame by less is not worth its time.",
        "Not tuned; chosen with the first active sampling (2026-11-22).",
    )
    longest_capture_s: float = limit(
        240.0,
        "s",
        "Active sampling ends after so much capture, whatever is still to be gained.",
        "Not longer than the fixed protocol.",
    )


SAMPLING_LIMITS = SamplingLimits()
