"""A camera's estimates as the reference of the take that the glove recorded meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.camera_reference.camera_clock import RANGE_S, CameraClock, camera_clock
from glovecal_models.takes.camera_reference.covered_range import CoveredRange, covered_ranges
from glovecal_models.takes.camera_reference.estimates import CameraEstimates
from glovecal_models.takes.take import Take

CAMERA_PATCHES = "camera_patches"
"""Context column: how many patches of the glove the camera saw. What goes with it is the camera's."""


@dataclass(frozen=True)
class CameraReference:
    """A take with the camera as its reference, and what is known of it."""

    take: Take
    clock: CameraClock
    ranges: tuple[CoveredRange, ...]
    accepted: float
    """Share of the camera's estimates that are kept, of the rotations that are kept."""

    def to_document(self) -> dict[str, Any]:
        """Plain JSON data, as a store keeps it."""
        return {
            "clock_offset_s": round(self.clock.offset_s, 6),
            "clock_offset_sd_s": round(self.clock.sd_s, 6),
            "accepted_share": round(self.accepted, 4),
            "ranges": [
                {
                    "rotation": item.rotation,
                    "ranges_deg": [[round(low, 2), round(high, 2)] for low, high in item.ranges_deg],
                    "effective_samples": item.effective_samples,
                    "sd_deg": round(item.deviation_deg, 3),
                }
                for item in self.ranges
            ],
        }

    def sentences(self) -> list[str]:
        clock = self.clock
        first = (
            f"Take {self.take.name}: the camera's clock is {1e3 * abs(clock.offset_s):.1f} ms "
            f"{'ahead of' if clock.offset_s >= 0 else 'behind'} the glove's (SD {1e3 * clock.sd_s:.1f} ms); "
            f"{100 * self.accepted:.0f} % of its estimates are accepted."
        )
        return [first, *(item.sentence() for item in self.ranges)]


def reference_from_camera(
    take: Take,
    estimates: CameraEstimates,
    *,
    rotations: Sequence[str] | None = None,
    near_s: float = 0.0,
    within_s: float = RANGE_S,
) -> CameraReference:
    """``take`` with the accepted estimates as its reference, each with its standard deviation.

    Rows stay at the camera's own times, moved by the clock offset: nothing is resampled, and no gap is
    filled (``Take.reference_at_frames`` interpolates between neighbouring accepted rows alone). Where the
    camera knows how many patches it saw, the take gets the context column ``camera_patches``.
    ``rotations``: those to keep, else all that were ever accepted. Raises BadInput where the clock's offset
    cannot be found, or nothing was accepted.
    """
    kept = [
        column
        for column, name in enumerate(estimates.rotations)
        if (rotations is None or name in rotations) and estimates.accepted[:, column].any()
    ]
    if not kept:
        raise BadInput(f"take {take.name!r}: the camera accepted no angle; nothing can be a reference")
    clock = camera_clock(take, estimates, near_s=near_s, within_s=within_s)
    time = estimates.time_s - clock.offset_s
    rows = (time >= take.start_s) & (time <= take.time_s[-1])
    accepted = estimates.accepted[np.ix_(rows, kept)]
    if not accepted.any():
        raise BadInput(f"take {take.name!r}: no accepted estimate lies within its frames")
    context = dict(take.context)
    if (estimates.patches[rows] >= 0).all():
        context[CAMERA_PATCHES] = np.interp(take.time_s, time[rows], estimates.patches[rows])
    found = replace(
        take,
        rotations=tuple(estimates.rotations[column] for column in kept),
        reference_time_s=time[rows],
        reference=np.where(accepted, estimates.angles_deg[np.ix_(rows, kept)], np.nan),
        reference_sd=np.where(accepted, estimates.sd_deg[np.ix_(rows, kept)], np.nan),
        context=context,
        simulated=take.simulated or estimates.simulated,
    )
    return CameraReference(found, clock, covered_ranges([found], found.rotations), float(accepted.mean()))
