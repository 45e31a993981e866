"""What is suspicious about a take's reference angles, in sentences for the person who imports it."""

from __future__ import annotations

import numpy as np

from glovecal_models.takes.take import Take

STILL_WITHIN_DEG = 0.5
"""A whole reference that stays within this has not moved: even a held hand trembles about as much."""


def reference_warnings(take: Take) -> list[str]:
    """Sentences about a reference that can be imported but hardly teaches; none for a take without one."""
    if not take.rotations:
        return []
    who = f"Take {take.name!r}"
    warnings = []
    spans = [_span(take.reference[:, index]) for index in range(len(take.rotations))]
    if max(spans) < STILL_WITHIN_DEG:
        warnings.append(
            f"{who}: the reference never moves (no rotation changes by more than {max(spans):.2g} degrees), "
            "so it can teach one pose at most. Was the tracker frozen?"
        )
    paired = frames_with_reference(take)
    if not paired.any():
        warnings.append(
            f"{who}: no frame has a reference (frames from {take.start_s:g} to {take.time_s[-1]:g} s, "
            f"reference from {take.reference_time_s[0]:g} to {take.reference_time_s[-1]:g} s). "
            "Are the two clocks different?"
        )
    elif paired.mean() < 0.5:
        warnings.append(f"{who}: only {100 * paired.mean():.0f} % of the frames have a reference.")
    return warnings


def frames_with_reference(take: Take) -> np.ndarray:
    """(N,) whether anything was measured at each frame that was asked for; the lead-in is not counted."""
    angles = take.reference_at_frames(take.rotations)[take.lead_in_frames :]
    return np.any(np.isfinite(angles), axis=1)


def _span(values: np.ndarray) -> float:
    measured = values[np.isfinite(values)]
    return float(measured.max() - measured.min()) if len(measured) else 0.0
