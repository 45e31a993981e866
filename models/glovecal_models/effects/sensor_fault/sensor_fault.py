"""Sensor fault: a broken wire, a loose plug. The stretches concerned should not train anything.

Seven signatures: *stuck* (one value while the reference moves), *spikes* (gone after a frame or two),
*dropouts* (jumps to a constant and back), a *jump* of gain or offset in the middle of a take, a gain that
has *changed* from one take to another, *switching* (jumps again and again), and the *hum* of a tone. What a
sensor answered before a change says nothing of what it answers now: that is left out. Switching and hum go on
in use, and no single frame shows them: they are told and stay in training, so that the claimed standard
deviation has them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from glovecal_models.effects.base.effect import LiveRepair, RepairEffect
from glovecal_models.effects.base.facts import About
from glovecal_models.effects.base.findings import (
    Finding,
    Hold,
    LiveCheck,
    Stretch,
    check_signature_input,
    frames_inside,
    named,
    stretches_of,
)
from glovecal_models.effects.base.signals import Settings
from glovecal_models.effects.between import TABLE
from glovecal_models.effects.sensor_fault.common_faults import without_common_faults
from glovecal_models.effects.sensor_fault.fault_watch import FaultHold
from glovecal_models.effects.sensor_fault.gain_change import GainChange, gain_change, gain_jump
from glovecal_models.effects.sensor_fault.level_switches import Hum, LevelSwitches, hums, level_switches
from glovecal_models.effects.sensor_fault.live_check import live_check
from glovecal_models.effects.sensor_fault.reading_errors import ReadingErrors, reading_errors
from glovecal_models.effects.sensor_fault.short_faults import (
    FEWEST,
    LEAST_OF_RANGE,
    as_large_as_readings,
    expected_readings,
    shortly_stuck,
    small_dropouts,
)
from glovecal_models.progress import Cancel
from glovecal_models.takes.reading_faults import GRADUAL_SHARE, dropouts, spikes, stuck
from glovecal_models.takes.take import Take

KINDS: tuple[str, ...] = ("stuck", "spikes", "dropouts", "jump", "changed", "switching", "hum")
REFERENCE_MOVES_DEG = 10.0
"""The reference must travel so far while a sensor stands still."""
LEAST_SPIKES = 3
EXPLAINED_BY = {"switching": ("spikes", "dropouts", "jump"), "hum": ("spikes",)}
TIMES_PER_FAULT = 4
"""A dropout has two switches; with more than so many switches, or seconds of a tone, for each other fault,
those that are no larger are explained by them."""
STICKS = tuple(other for found, other in TABLE.taken_for if found == "sensor_fault")
TURNS = tuple(other for found, other in TABLE.alike_at_several if found == "sensor_fault")
LARGEST = {"switching": 2.0, "hum": 3.0}
"""Times the mean height of the switches, or the tone's RMS, that a fault so explained reaches at most."""


class SensorFault(RepairEffect, LiveRepair):
    name = "sensor_fault"
    about = About(
        "A wire or plug fails: the sensor stands still, spikes, drops out, jumps, switches or hums.",
        source="signatures of readings against reference",
        shown_over="time in take",
    )

    @property
    def live(self) -> LiveRepair:
        return self

    def find(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        errors: Sequence[np.ndarray] | None = None,
    ) -> tuple[Finding, ...]:
        check_signature_input(takes, sensor_of, errors)
        rotation_of: dict[str, str] = {}
        for rotation, sensor in sensor_of.items():
            rotation_of.setdefault(sensor, rotation)
        changes = [_Changes.of(take) for take in takes]
        found: list[Finding] = []
        for sensor, rotation in rotation_of.items():
            found += _faults(takes, changes, sensor, rotation, len(rotation_of))
        found = _with_unsteady(takes, without_common_faults(found, len(rotation_of)), rotation_of)
        return tuple(sorted(found, key=lambda item: (-len(item.stretches), item.where)))

    def between_levels(self, takes: Sequence[Take], sensor_of: Mapping[str, str]) -> tuple[Finding, ...]:
        """Jumps, each with the known angles it lies between, and what it cannot be told from."""
        jumps = [item for item in self.find(takes, sensor_of) if item.kind == "jump"]
        return tuple(_between_levels(item, takes, sensor_of) for item in jumps)

    def checked_live(
        self,
        takes: Sequence[Take],
        sensor_of: Mapping[str, str],
        sensors: Sequence[str],
        reads: Mapping[str, tuple[str, ...]],
        cancelled: Cancel | None = None,
    ) -> LiveCheck:
        return live_check(takes, sensors, reads, lambda some: self.find(some, sensor_of), cancelled)

    def hold(self, settings: Settings, rotations: Sequence[str], sensors: Sequence[str]) -> Hold | None:
        """For a model that knows what its sensors do when they are sound."""
        return FaultHold(settings["live"], rotations, sensors) if "live" in settings else None

    def repaired(self, takes: Sequence[Take], settings: Settings | None = None) -> tuple[Take, ...]:
        """The takes without reference where the joint's own sensor failed: it neither trains nor scores."""
        if not takes:
            return ()
        # Looked for in all takes together: a short fault may be rare in each of them.
        shared = set.intersection(*(set(take.sensors) for take in takes))
        rotations = dict.fromkeys(name for take in takes for name in take.rotations)
        found = self.find(takes, {name: name for name in rotations if name in shared})
        return tuple(_without_faults(take, found) for take in takes)


def _faults(
    takes: Sequence[Take], changes: Sequence[_Changes], sensor: str, rotation: str, sensors: int
) -> list[Finding]:
    columns = [take.readings[:, take.sensors.index(sensor)] for take in takes]
    low, high = (float(v) for v in np.percentile(np.concatenate(columns), LEAST_OF_RANGE))
    angles = [take.reference_at_frames([rotation])[:, 0] for take in takes]
    asked = np.split(as_large_as_readings(np.concatenate(angles), low, high), _ends(columns))
    short = _short_faults(takes, changes, sensor, angles, asked, low, high)
    stretches: dict[str, list[Stretch]] = {kind: [] for kind in KINDS}
    frames = dict.fromkeys(KINDS, 0)
    jumps, sound_angles = [], []
    for take, readings, angle, shown, brief in zip(takes, columns, angles, asked, short, strict=True):
        time_s, span = take.time_s, high - low
        masks = {
            "stuck": stuck(time_s, readings, low, high, angle / REFERENCE_MOVES_DEG) | brief["stuck"],
            "dropouts": dropouts(time_s, readings, span, shown) | brief["dropouts"],
        }
        masks["dropouts"] &= ~masks["stuck"]
        masks["spikes"] = spikes(time_s, readings, span, shown) & ~masks["dropouts"]
        for kind, mask in masks.items():
            stretches[kind] += stretches_of(take, mask)
            frames[kind] += int(mask.sum())
        margin = GRADUAL_SHARE * (high - low)
        inside = (readings >= low + margin) & (readings <= high - margin)
        broken = masks["stuck"] | masks["dropouts"] | masks["spikes"]
        sound_angles.append(np.where(broken | ~inside, np.nan, angle))
        jump = gain_jump(take.time_s, readings, np.where(broken, np.nan, angle), inside)
        if jump is not None:
            jumps.append(jump)
            frames["jump"] += int((take.time_s >= jump.at_s).sum())
            stretches["jump"].append(Stretch(take.name, jump.at_s, float(take.time_s[-1])))
    least = {"stuck": 1, "dropouts": 1, "spikes": LEAST_SPIKES, "jump": 1}
    size = max((jump.size_deg for jump in jumps), default=None)
    change = gain_change(takes, columns, sound_angles, sensors)
    lasting = [_finding_changed(sensor, rotation, change, takes)] if change else []
    return lasting + [
        _finding(sensor, rotation, kind, stretches[kind], frames[kind], size if kind == "jump" else None)
        for kind in least
        if len(stretches[kind]) >= least[kind]
    ]


def _with_unsteady(
    takes: Sequence[Take], found: Sequence[Finding], rotation_of: Mapping[str, str]
) -> list[Finding]:
    """``found`` and the sensors that switch or hum.

    Crests of a tone look like spikes, and some of many switches like dropouts or a jump: one name for all of
    them. A fault that is larger stays.
    """
    errors = [_errors(takes, sensor, rotation) for sensor, rotation in rotation_of.items()]
    result = list(found)
    for sensor, error, hum, switches in zip(
        rotation_of, errors, hums(errors), level_switches(errors), strict=True
    ):
        if error is None:
            continue
        if hum:
            item = _finding_hum(sensor, hum)
        elif switches:
            item = _finding_switches(sensor, switches)
        else:
            continue
        own = [each for each in found if each.where == item.where]
        often = item.evidence["heard_s"] if item.count is None else item.count
        if TIMES_PER_FAULT * sum(each.count or 0 for each in own) < often:
            result = [
                each for each in result if each not in own or not _is_explained(each, item, takes, error)
            ]
            result.append(item)
    return result


def _is_explained(fault: Finding, by: Finding, takes: Sequence[Take], error: ReadingErrors) -> bool:
    """Whether a fault looks like, and is no larger than, what ``by`` does to the same sensor."""
    assert by.size_deg is not None
    if fault.kind not in EXPLAINED_BY[by.kind]:
        return False
    size = fault.size_deg
    if size is None:
        away = [
            np.abs(part[frames_inside(take, fault.stretches)])
            for take, part in zip(takes, error.errors, strict=True)
        ]
        # Frames outside the sensor's usual range, or without a reference, are of no known size.
        size = float(np.median(np.nan_to_num(np.concatenate(away), nan=np.inf)))
    return size <= LARGEST[by.kind] * by.size_deg


def _errors(takes: Sequence[Take], sensor: str, rotation: str) -> ReadingErrors | None:
    """Without frames near the ends of the range: a sensor that saturates leaves its curve there."""
    readings = [take.readings[:, take.sensors.index(sensor)] for take in takes]
    low, high = (float(v) for v in np.percentile(np.concatenate(readings), LEAST_OF_RANGE))
    margin = GRADUAL_SHARE * (high - low)
    angles = [
        np.where(
            (low + margin <= part) & (part <= high - margin),
            take.reference_at_frames([rotation])[:, 0],
            np.nan,
        )
        for take, part in zip(takes, readings, strict=True)
    ]
    return reading_errors([take.time_s for take in takes], readings, angles)


def _finding_hum(sensor: str, hum: Hum) -> Finding:
    sentence = (
        f"{sensor} hums: a tone of {hum.frequency_hz:.1f} Hz in the frames, {hum.rms_deg:.1f} deg RMS, that"
        " its joint does not make; look at its shield and at the supply."
    )
    evidence = {
        "frequency_hz": hum.frequency_hz,
        "power_over_around_1": hum.over_around,
        "heard_s": hum.heard_s,
    }
    return Finding(
        SensorFault.name, (sensor,), sentence, kind="hum", size_deg=hum.rms_deg, evidence=evidence,
        is_only_told=True,
    )  # fmt: skip


def _finding_switches(sensor: str, found: LevelSwitches) -> Finding:
    does = "switches {} times to and fro between levels" if found.take_turns else "jumps {} times"
    sentence = (
        f"{sensor} {does.format(found.count)}, by {found.size_deg:.1f} deg in the mean, which its joint does"
        " not do; look at its solder joints and plug."
    )
    evidence = {"switches_count": float(found.count)}
    return Finding(
        SensorFault.name, (sensor,), sentence, kind="switching", size_deg=found.size_deg, count=found.count,
        evidence=evidence, is_only_told=True, rivals=STICKS,
    )  # fmt: skip


def _finding_changed(sensor: str, rotation: str, change: GainChange, takes: Sequence[Take]) -> Finding:
    concerned = takes[: change.after]
    more = "more" if change.share > 0 else "less"
    sentence = (
        f"{sensor} answers {abs(change.share):.0%} {more} to {rotation} from take {takes[change.after].name}"
        f" on, {change.size_deg:.1f} deg over a standard deviation of its angles (p = {change.p_value:.1g});"
        f" the {len(concerned)} takes before are left out for it."
    )
    evidence = {
        "gain_change_share": change.share,
        "p_value_1": change.p_value,
        "concerned_frames": float(sum(len(take.time_s) for take in concerned)),
    }
    stretches = tuple(Stretch(take.name, float(take.time_s[0]), float(take.time_s[-1])) for take in concerned)
    return Finding(
        SensorFault.name, (sensor,), sentence, kind="changed", size_deg=change.size_deg, count=1,
        evidence=evidence, stretches=stretches, part_of=TURNS,
    )  # fmt: skip


def _short_faults(
    takes: Sequence[Take],
    changes: Sequence[_Changes],
    sensor: str,
    angles: Sequence[np.ndarray],
    asked: Sequence[np.ndarray],
    low: float,
    high: float,
) -> list[dict[str, np.ndarray]]:
    """For each take a mask (N,) of each kind; empty where there are too few of that kind in all takes."""
    columns = [take.readings[:, take.sensors.index(sensor)] for take in takes]
    whole, gain = expected_readings(np.concatenate(columns), np.concatenate(angles))
    expected = np.split(whole, _ends(columns))
    found = []
    for take, change, column, part, shown in zip(takes, changes, columns, expected, asked, strict=True):
        moving = change.of_others(take.sensors.index(sensor))
        held = shortly_stuck(take.time_s, column, low, high, part, gain, moving)
        away = small_dropouts(take.time_s, column, high - low, part, shown, moving)
        found.append({"stuck": held, "dropouts": away})
    for kind in ("stuck", "dropouts"):
        masks = [each[kind] for each in found]
        if sum(len(stretches_of(take, mask)) for take, mask in zip(takes, masks, strict=True)) < FEWEST:
            for mask in masks:
                mask[:] = False
    return found


def _ends(columns: Sequence[np.ndarray]) -> np.ndarray:
    return np.cumsum([len(column) for column in columns])[:-1]


@dataclass(frozen=True)
class _Changes:
    """Which sensors of a take changed since the frame before."""

    changed: np.ndarray
    """(N, S)."""
    count: np.ndarray
    """(N,) sensors."""

    @classmethod
    def of(cls, take: Take) -> _Changes:
        changed = np.diff(take.readings, axis=0, prepend=take.readings[:1]) != 0
        return cls(changed, changed.sum(axis=1))

    def of_others(self, sensor: int) -> np.ndarray:
        """(N,) whether half of the sensors but this one, or more, changed; never without others."""
        others = self.changed.shape[1] - 1
        if not others:
            return np.zeros(len(self.changed), dtype=bool)
        return 2 * (self.count - self.changed[:, sensor]) >= others


def _without_faults(take: Take, found: Sequence[Finding]) -> Take:
    reference = take.reference_at_frames(take.rotations)
    failed = np.zeros_like(reference, dtype=bool)
    for item in found:
        for name in item.where:
            if name in take.rotations:
                failed[:, take.rotations.index(name)] |= frames_inside(take, item.stretches)
    if not failed.any():
        return take
    reference[failed] = np.nan
    deviations = take.reference_sd_at_frames(take.rotations)
    return replace(take, reference_time_s=take.time_s, reference=reference, reference_sd=deviations)


def _between_levels(item: Finding, takes: Sequence[Take], sensor_of: Mapping[str, str]) -> Finding:
    at = item.stretches[0]
    take = next(take for take in takes if take.name == at.take)
    rotation = next(name for name, sensor in sensor_of.items() if sensor in item.where)
    angle = take.reference_at_frames([rotation])[:, 0]
    row = int(np.searchsorted(take.time_s, at.start_s))
    before = angle[:row][angle[:row] != angle[row]]
    if not len(before):
        return item
    sentence = (
        f"{item.where[0]} may jump between {before[-1]:g} and {angle[row]:g} degrees of {rotation}, by"
        f" {item.size_deg or 0.0:.0f} degrees: one pass over known angles cannot tell that from a curved"
        " sensor."
    )
    return replace(item, sentence=sentence)


def _finding(
    sensor: str, rotation: str, kind: str, stretches: Sequence[Stretch], frames: int, size: float | None
) -> Finding:
    seconds = sum(item.end_s - item.start_s for item in stretches)
    names = named(list(dict.fromkeys(item.take for item in stretches)))
    first = f"first at {stretches[0].start_s:.2f} s of take {stretches[0].take}"
    many = len(stretches)
    sentence = {
        "stuck": f"{sensor} stands still for {seconds:.1f} s while {rotation} moves ({names}); {first}.",
        "spikes": f"{sensor} has {many} spikes of a frame or two ({names}); {first}.",
        "dropouts": f"{sensor} drops out for a moment {many} times ({names}); {first}.",
        "jump": f"{sensor} jumps in offset or gain by {size or 0.0:.1f} deg and stays so ({names}); {first}.",
    }[kind]
    evidence = {"stretches_count": float(many), "concerned_s": seconds, "concerned_frames": float(frames)}
    return Finding(
        SensorFault.name, (sensor,), sentence, kind=kind, size_deg=size, count=many,
        evidence=evidence, stretches=tuple(stretches),
    )  # fmt: skip
