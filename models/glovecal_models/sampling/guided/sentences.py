"""What a guided calibration tells a user of what it learned from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from glovecal_models.hand.rotations import FINGERS
from glovecal_models.hand.skeleton import Skeleton
from glovecal_models.inverse_kinematics.contact import Rod
from glovecal_models.sampling.guided.seen_touches import RefusedTouch, SeenTouch
from glovecal_models.sampling.guided.touch_posterior import TouchPosterior

SHOWN = 4


def guided_sentences(
    seen: Sequence[SeenTouch],
    refused: Sequence[RefusedTouch],
    told: Mapping[str, float],
    posterior: TouchPosterior,
    skeleton: Skeleton | None,
) -> list[str]:
    """Of touches: what each closed, what they told most of, and which were refused."""
    said = [_closed(touch, posterior, skeleton) for touch in seen if skeleton is not None]
    if told:
        most = sorted(told, key=lambda name: -told[name])[:SHOWN]
        shares = ", ".join(f"{name} {100 * told[name]:.0f} %" for name in most)
        said.append(f"Of what poses and widgets left open of a joint the touches told most of {shares}.")
    said += [f"Left out: {each.pose} of take {each.take}: {each.reason}." for each in refused]
    return said


def hold_sentence(holds: int, sd_deg: float) -> str:
    return (
        f"{holds} poses were held, {sd_deg:.1f} degrees (standard deviation) from the angles they are said "
        "to have: each counts as one sample of that accuracy, however many frames it has."
    )


def nothing_left(has_skeleton: bool, touches: int, refused: Sequence[RefusedTouch]) -> str:
    """Why there is nothing to train on."""
    if refused:
        reasons = "; ".join(f"{each.pose}: {each.reason}" for each in refused)
        return f"no take has known angles, and every touch was refused ({reasons})"
    if touches and not has_skeleton:
        return "touches need the subject's hand dimensions, and no other take has known angles"
    return "no pose, no widget and no touch among these takes"


def _closed(touch: SeenTouch, posterior: TouchPosterior, skeleton: Skeleton) -> str:
    left = float(np.median(posterior.apart_mm(touch.some(60), skeleton)))
    first, second = (FINGERS[finger] for finger in touch.contact.fingers)
    what = f"{first} and {second} at the rod" if isinstance(touch.contact, Rod) else f"{first} and {second}"
    return (
        f"Tips of {what}: read {touch.apart_mm:.1f} mm off before, {left:.1f} mm with what all touches tell "
        f"(median of {len(touch.rows)} frames)."
    )
