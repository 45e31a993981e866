"""What is wrong with the measurement itself: looked at before any effect is blamed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from glovecal_models.diagnosis.contradictions import contradictions
from glovecal_models.diagnosis.pose_labels import are_pose_labels
from glovecal_models.layout import Layout
from glovecal_models.takes.radians import radians_problem
from glovecal_models.takes.take import Take

STILL_DEG = 0.5
JUMP_DEG = 25.0
"""Between two frames, while the joint's sensor hardly moves."""
SURE_CORRELATION = 0.5
FEWEST_ROWS = 30


def reference_problems(takes: Sequence[Take], layout: Layout) -> tuple[str, ...]:
    """Sentences; none when the reference looks right, or names poses and measures no angle."""
    if are_pose_labels(takes):
        return ()
    problems: list[str] = []
    for rotation in layout.rotations:
        measured = [(take, take.reference_at_frames([rotation])[:, 0]) for take in takes]
        measured = [(take, values) for take, values in measured if np.isfinite(values).sum() >= FEWEST_ROWS]
        if measured:
            own = layout.correspondence(rotation)
            has_own = own.simulated is None and (rotation in own.sensors or len(own.sensors) == 1)
            inputs = [
                own.input_columns(_in_order(take, layout), layout.sensors)[:, 0] for take, _ in measured
            ]
            problems.extend(_of_rotation(rotation, measured, inputs, has_own))
            if has_own:
                problems.extend(contradictions(rotation, measured, inputs))
    radians = radians_problem(takes)
    return tuple(problems) if radians is None else (radians[0].upper() + radians[1:], *problems)


def _in_order(take: Take, layout: Layout) -> np.ndarray:
    return take.readings[:, [take.sensors.index(name) for name in layout.sensors]]


def _of_rotation(
    rotation: str, measured: Sequence[tuple[Take, np.ndarray]], inputs: Sequence[np.ndarray], has_own: bool
) -> list[str]:
    problems, correlations = [], []
    for (take, values), own in zip(measured, inputs, strict=True):
        known = np.isfinite(values)
        angle, reading = values[known], own[known]
        moves = float(np.std(reading)) > 0 and float(np.std(angle)) > 0
        correlations.append(float(np.corrcoef(reading, angle)[0, 1]) if moves else 0.0)
        if (
            has_own
            and np.ptp(angle) < STILL_DEG
            and np.ptp(reading) > 0.3 * max(np.ptp(part) for part in inputs)
        ):
            problems.append(
                f"{rotation} in take {take.name}: the reference stays within {np.ptp(angle):.2g} degrees"
                " while its sensor moves. Was the tracker frozen?"
            )
        jumps = _jumps(angle, reading) if has_own else 0
        if jumps:
            problems.append(
                f"{rotation} in take {take.name}: the reference jumps by more than {JUMP_DEG:g} degrees"
                f" {jumps} time{'s' if jumps > 1 else ''} while its sensor stands. Did a marker swap?"
            )
    sign = np.sign(np.median(correlations))
    for (take, _), correlation in zip(measured, correlations, strict=True):
        if has_own and len(measured) > 2 and sign * correlation < -SURE_CORRELATION:
            problems.append(
                f"{rotation} in take {take.name}: the reference runs against its sensor, unlike in the other"
                " takes. Is its sign flipped?"
            )
    return problems


def _jumps(angle: np.ndarray, reading: np.ndarray) -> int:
    steps, moved = np.abs(np.diff(angle)), np.abs(np.diff(reading))
    span = max(float(np.ptp(reading)), 1e-9)
    return int(((steps > JUMP_DEG) & (moved < 0.1 * span)).sum())
