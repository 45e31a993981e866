"""What is wrong with the measurement itself: looked at before any effect is blamed.

Takes whose references contradict each other: other units, the other sign, or another zero.

Each take gets a line of the reference over the joint's own reading; takes are held against each other by it.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.limits import DIAGNOSIS_LIMITS, DiagnosisLimits
from glovecal_models.diagnosis.signatures import are_pose_labels
from glovecal_models.layout import Layout
from glovecal_models.takes.reference_jumps import radians_problem
from glovecal_models.takes.take import Take

RADIAN_DEG = 180.0 / np.pi


@dataclass(frozen=True)
class _Line:
    take: Take
    slope: float
    """Degrees for each raw unit."""
    correlation: float
    mean_reading: float
    mean_angle: float
    left_deg: float
    """RMS around the line."""

    def at(self, reading: float) -> float:
        return self.mean_angle + self.slope * (reading - self.mean_reading)


def contradictions(
    rotation: str,
    measured: Sequence[tuple[Take, np.ndarray]],
    inputs: Sequence[np.ndarray],
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    *,
    may_be_apart: bool = False,
) -> list[str]:
    """Sentences; ``measured``: takes and angles at their frames, ``inputs``: the own sensor's readings.

    ``may_be_apart``: an effect makes the sensor read differently from take to take.
    """
    lines = [
        _line(take, own[np.isfinite(values)], values[np.isfinite(values)])
        for (take, values), own in zip(measured, inputs, strict=True)
    ]
    sure = [item for item in lines if abs(item.correlation) > limits.reference_sure_correlation]
    radians = _in_radians(rotation, sure, limits.reference_radians_within)
    clear = [item for item in lines if abs(item.correlation) > limits.reference_clear_correlation]
    signs = [] if radians else _against_each_other(rotation, clear)
    apart = [] if may_be_apart else _apart(rotation, _of_one_sign(sure), limits)
    return radians or signs or apart


def _line(take: Take, reading: np.ndarray, angle: np.ndarray) -> _Line:
    x, y = reading - reading.mean(), angle - angle.mean()
    square = float(x @ x)
    slope = float(x @ y) / square if square > 0 else 0.0
    whole = float(np.sqrt(square * (y @ y)))
    left = float(np.sqrt(np.mean((y - slope * x) ** 2)))
    correlation = float(x @ y) / whole if whole > 0 else 0.0
    return _Line(take, slope, correlation, float(reading.mean()), float(angle.mean()), left)


def _in_radians(rotation: str, lines: Sequence[_Line], within: float) -> list[str]:
    """Takes whose angles are 57 times smaller than the others' for the same readings."""
    if len(lines) < 2:
        return []
    steepest = max(abs(item.slope) for item in lines)
    found = [item for item in lines if abs(item.slope) * RADIAN_DEG < within * steepest]
    found = [item for item in found if abs(item.slope) * RADIAN_DEG > steepest / within]
    return [
        f"{rotation} in take {item.take.name}: the reference moves {steepest / abs(item.slope):.0f} times"
        " less than in another take for the same readings. Is it in radians? Degrees are wanted: multiply by"
        " 57.2958."
        for item in found
    ]


def _against_each_other(rotation: str, lines: Sequence[_Line]) -> list[str]:
    """As many takes of one sign as of the other: no majority says which are flipped."""
    rising = [item.take.name for item in lines if item.correlation > 0]
    falling = [item.take.name for item in lines if item.correlation < 0]
    if not rising or len(rising) != len(falling):
        return []
    return [
        f"{rotation}: the reference rises with its sensor in {_some(rising)} and falls in {_some(falling)}."
        " Is its sign flipped in one of them?"
    ]


def _of_one_sign(lines: Sequence[_Line]) -> list[_Line]:
    """Without those that run the other way than most: their sign is told of elsewhere."""
    most = np.sign(sum(np.sign(item.correlation) for item in lines))
    return [item for item in lines if np.sign(item.correlation) == most]


def _apart(rotation: str, lines: Sequence[_Line], limits: DiagnosisLimits) -> list[str]:
    """Takes of one wearing whose angles differ where their readings are the same."""
    found = []
    for number, one in enumerate(lines):
        for other in lines[number + 1 :]:
            between = 0.5 * (one.mean_reading + other.mean_reading)
            apart = abs(one.at(between) - other.at(between))
            lines_leave = max(one.left_deg, other.left_deg)
            limit = max(limits.reference_least_apart_deg, limits.reference_times_apart * lines_leave)
            if one.take.wearing == other.take.wearing and apart > limit:
                found.append((apart, one, other))
    if not found:
        return []
    apart, one, other = max(found, key=lambda item: item[0])
    return [
        f"{rotation}: takes {one.take.name} and {other.take.name} contradict each other, by {apart:.0f}"
        " degrees where their sensor reads the same, in one wearing. Which of the two references is right?"
    ]


def _some(names: Sequence[str]) -> str:
    return f"take {names[0]}" if len(names) == 1 else f"takes {', '.join(names[:4])}"


def reference_problems(
    takes: Sequence[Take],
    layout: Layout,
    limits: DiagnosisLimits = DIAGNOSIS_LIMITS,
    *,
    apart_by: Set[str] = frozenset(),
) -> tuple[str, ...]:
    """Sentences; none when the reference looks right, or names poses and measures no angle.

    ``apart_by``: rotations whose sensor an effect makes read differently from take to take: there takes that
    differ contradict no reference.
    """
    if are_pose_labels(takes):
        return ()
    problems: list[str] = []
    fewest = limits.reference_fewest_rows
    for rotation in layout.rotations:
        measured = [(take, take.reference_at_frames([rotation])[:, 0]) for take in takes]
        measured = [(take, values) for take, values in measured if np.isfinite(values).sum() >= fewest]
        if measured:
            own = layout.correspondence(rotation)
            has_own = own.measuring_sensor is not None
            inputs = [
                own.input_columns(_in_order(take, layout), layout.sensors)[:, 0] for take, _ in measured
            ]
            problems.extend(_of_rotation(rotation, measured, inputs, has_own, limits))
            if has_own:
                may_be_apart = rotation in apart_by
                problems.extend(contradictions(rotation, measured, inputs, limits, may_be_apart=may_be_apart))
    radians = radians_problem(takes)
    return tuple(problems) if radians is None else (radians[0].upper() + radians[1:], *problems)


def _in_order(take: Take, layout: Layout) -> np.ndarray:
    return take.readings[:, [take.sensors.index(name) for name in layout.sensors]]


def _of_rotation(
    rotation: str,
    measured: Sequence[tuple[Take, np.ndarray]],
    inputs: Sequence[np.ndarray],
    has_own: bool,
    limits: DiagnosisLimits,
) -> list[str]:
    problems, correlations = [], []
    moving = limits.reference_moving_share * max(np.ptp(part) for part in inputs)
    for (take, values), own in zip(measured, inputs, strict=True):
        known = np.isfinite(values)
        angle, reading = values[known], own[known]
        moves = float(np.std(reading)) > 0 and float(np.std(angle)) > 0
        correlations.append(float(np.corrcoef(reading, angle)[0, 1]) if moves else 0.0)
        if has_own and np.ptp(angle) < limits.reference_still_deg and np.ptp(reading) > moving:
            problems.append(
                f"{rotation} in take {take.name}: the reference stays within {np.ptp(angle):.2g} degrees"
                " while its sensor moves. Was the tracker frozen?"
            )
        jumps = _jumps(angle, reading, limits) if has_own else 0
        if jumps:
            problems.append(
                f"{rotation} in take {take.name}: the reference jumps by more than"
                f" {limits.reference_jump_deg:g} degrees {jumps} time{'s' if jumps > 1 else ''} while its"
                " sensor stands. Did a marker swap?"
            )
    sign = np.sign(np.median(correlations))
    for (take, _), correlation in zip(measured, correlations, strict=True):
        if has_own and len(measured) > 2 and sign * correlation < -limits.reference_sure_correlation:
            problems.append(
                f"{rotation} in take {take.name}: the reference runs against its sensor, unlike in the other"
                " takes. Is its sign flipped?"
            )
    return problems


def _jumps(angle: np.ndarray, reading: np.ndarray, limits: DiagnosisLimits) -> int:
    steps, moved = np.abs(np.diff(angle)), np.abs(np.diff(reading))
    span = max(float(np.ptp(reading)), 1e-9)
    stands = moved < limits.reference_standing_share * span
    return int(((steps > limits.reference_jump_deg) & stands).sum())
