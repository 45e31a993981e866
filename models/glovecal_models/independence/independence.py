"""A whole glove examined: each rotation that was kept still in a take, and what is odd about the glove.

Is it the glove of the other hand, or worn back to front? Its sensors' signs tell. A CyberGlove's flexion
sensors read more as joints bend, the sensors between fingers read less as they spread (two laboratories'
calibration files). Data of a left hand has abduction and wrist yaw of the other sign (VRJuggler's driver); a
glove on the wrong hand bends the other way everywhere. Only measured angles tell, and a reference that counts
angles the other way looks the same.

One rotation examined: what its sensor did while it was kept still and others moved.

The source is Wang & Neff 2013, section 3.1: standard and largest deviation in per cent of the active range.
What a joint did that moved all the same is taken out where its angle was measured. Where it was not, a joint
that moves along with a neighbour looks like that neighbour's crosstalk.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import replace

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.independence.answer import (
    LEAST_BLOCKS,
    LEAST_MAX_PCT,
    LEAST_SENSORS,
    LEAST_STD_PCT,
    ActiveRange,
    AffectingShare,
    ExaminedRotation,
    Independence,
    NotExamined,
    OneWay,
    Proposal,
    Rule,
    Stillness,
    WornSide,
    WornVerdict,
    dead_sentence,
    listed,
)
from glovecal_models.independence.coupling import Coupling, decompose, follows_the_rule
from glovecal_models.independence.smooth_readings import (
    LEAST_MOVED,
    NO_CROSSTALK,
    KnownCrosstalk,
    SmoothTake,
    StillFrames,
    active_ranges,
    alone,
    constants,
    deviations,
    measured_slope,
    smooth_take,
    still_frames,
    still_rotations,
    stillness,
)
from glovecal_models.layout import Correspondence, CorrespondenceKind, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import Take
from glovecal_models.typical_counts import TYPICAL_COUNTS

SURELY_MOVED = 0.3
"""Of its range: errors of the known crosstalk are always smaller."""
CLEAR = 5.0
"""A slope of so many standard errors has a sign."""
SIDEWAYS = ("IM_ABD", "MR_ABD", "RP_ABD", "W_ABD")


def examine_rotation(
    rotation: str,
    sensor: str,
    takes: Sequence[SmoothTake],
    ranges: Mapping[str, ActiveRange],
    *,
    dead: bool = False,
    known: KnownCrosstalk = NO_CROSSTALK,
) -> tuple[ExaminedRotation, Coupling] | NotExamined:
    """From one or more takes in which ``rotation`` was kept still, at the same angle or at others.

    A sensor that is cross-coupled itself can look like a cause, so ``known`` crosstalk is subtracted.
    NotExamined when the range is unknown, or the takes are too short.
    """
    scale = ranges[sensor].readings
    if not scale:
        return NotExamined(rotation, ranges[sensor], 0)
    frames = still_frames(takes, rotation, sensor, ranges, known)
    blocks = sum(len(np.unique(item.block)) for item in frames)
    if blocks < LEAST_BLOCKS:
        return NotExamined(rotation, None, blocks)
    causes = alone(frames) or frames
    moved = {name: np.concatenate([item.moved[name] for item in causes]) for name in frames[0].moved}
    at_once = causes is frames
    coupling = _decomposed(causes, scale, moved, known, at_once)
    std, largest = deviations(frames, 100 / scale, coupling.constants[len(causes) :])
    unmeasured = {name for name in known.coupled if any(item.angle(name) is None for item in takes)}
    rough = unmeasured if at_once and len(coupling.shares) > 1 else set()
    coupling = replace(coupling, shares=tuple(_uncertain(share, rough) for share in coupling.shares))
    still = _least_still(takes, rotation)
    unknown = {name for name in unmeasured - set(coupling.curves) if not _surely_moves(name, moved, known)}
    found = ExaminedRotation(
        rotation=rotation,
        sensor=sensor,
        takes=tuple(item.take.name for item in takes),
        seconds=float(sum(item.time_s[-1] - item.time_s[0] for item in takes)),
        std_pct=std,
        max_pct=largest,
        is_coupled=follows_the_rule(std, largest),
        unexplained_pct=coupling.unexplained_pct,
        affecting=coupling.shares,
        products=list(coupling.products),
        still=still,
        active_range=ranges[sensor],
        not_moved=tuple(name for name in moved if not _sweeps(moved[name]) or name in unknown),
        is_dead=dead,
        rough_causes=tuple(name for name in coupling.curves if name in rough),
    )
    return found, coupling


def _decomposed(
    causes: Sequence[StillFrames],
    scale: float,
    moved: Mapping[str, np.ndarray],
    known: KnownCrosstalk,
    at_once: bool,
) -> Coupling:
    target = np.concatenate([item.target for item in causes]) * 100 / scale
    block = np.concatenate([item.block + 1e6 * number for number, item in enumerate(causes)])
    moving = {name: share for name, share in moved.items() if _sweeps(share)}
    return decompose(target, moving, constants(causes), block, known.coupled, at_once=at_once)


def _sweeps(share: np.ndarray) -> bool:
    return bool(np.ptp(share) >= LEAST_MOVED)


def _surely_moves(name: str, moved: Mapping[str, np.ndarray], known: KnownCrosstalk) -> bool:
    """Whether a cross-coupled sensor moved by more than what is left when the crosstalk is subtracted."""
    return name in known.crosstalk and name in moved and bool(np.ptp(moved[name]) >= SURELY_MOVED)


def _uncertain(share: AffectingShare, rough: Set[str]) -> AffectingShare:
    """A cause seen by a cross-coupled sensor is no sure one."""
    return replace(share, affects="undecided") if share.sensor in rough and share.affects == "yes" else share


def _least_still(takes: Sequence[SmoothTake], rotation: str) -> Stillness | None:
    found = [how for item in takes if (how := stillness(item, rotation)) is not None]
    return max(found, key=lambda how: how.std_pct, default=None)


def worn_side(layout: Layout, takes: Sequence[SmoothTake]) -> WornSide:
    """Needs takes with measured angles of a CyberGlove."""
    if layout.counts is None or not set(layout.sensors) <= set(TYPICAL_COUNTS):
        return WornSide("not identifiable", None, (), False)
    signs = {name: sign for name in layout.sensors if (sign := _sign(name, takes, layout)) is not None}
    bends = {name: sign for name, sign in signs.items() if name not in SIDEWAYS}
    sideways = {name: sign for name, sign in signs.items() if name in SIDEWAYS}
    turned = tuple(name for name, sign in signs.items() if sign < 0)
    if len(bends) < LEAST_SENSORS or len(sideways) < LEAST_SENSORS:
        return WornSide("not identifiable", None, (), True)
    wrong_bends, wrong_sideways = (sum(sign < 0 for sign in part.values()) for part in (bends, sideways))
    p_value = 0.5 ** len(signs)
    verdict: WornVerdict = "as it should be"
    if wrong_bends * 4 >= 3 * len(bends):
        verdict = "back to front"
    elif wrong_sideways * 4 >= 3 * len(sideways) and wrong_bends * 4 <= len(bends):
        verdict = "other hand"
    bending, across = f"{wrong_bends} of {len(bends)}", f"{wrong_sideways} of {len(sideways)}"
    return WornSide(verdict, p_value, turned, True, bending, across)


def _sign(sensor: str, takes: Sequence[SmoothTake], layout: Layout) -> int | None:
    """+1 when the sensor reads the way a CyberGlove's does, -1 when the other way, None when unclear."""
    best = 0.0
    for item in takes:
        found = measured_slope(item, sensor, layout) if sensor in item.take.sensors else None
        if found is not None and found[1] > 0 and abs(found[0] / found[1]) > abs(best):
            best = found[0] / found[1]
    if abs(best) < CLEAR:
        return None
    return 1 if (best > 0) == (TYPICAL_COUNTS[sensor][1] > 0) else -1


LONGEST_NAME = 55
"""Of the examined layout, before what is added to it."""
PASSES = 3
"""The first finds the crosstalk on cross-coupled sensors, the next ones subtract it."""


def examine_independence(
    layout: Layout,
    takes: Sequence[Take],
    range_takes: Sequence[Take] = (),
    named: Mapping[str, str] | None = None,
    proposed_name: str | None = None,
) -> Independence:
    """``takes`` have one rotation each kept still; ``named`` says which, by the take's name, where neither
    name nor measured angles tell. In ``range_takes`` joints go through their ranges; the examined takes
    themselves tell the ranges of what moved in them. The proposed layout gets ``proposed_name``. Raises
    BadInput for a take that does not tell its rotation."""
    smooth = [smooth_take(take) for take in takes]
    still = {
        item.take.name: still_rotations(item, layout, (named or {}).get(item.take.name)) for item in smooth
    }
    for_range = [smooth_take(take) for take in range_takes]
    dead = tuple(name for name in layout.sensors if not _moves(name, [*smooth, *for_range]))
    ranges = {
        name: active_ranges(
            layout,
            [*for_range, *(item for item in smooth if name not in _held(layout, still[item.take.name]))],
        )[name]
        for name in layout.sensors
    }
    examined: list[tuple[ExaminedRotation, Coupling] | NotExamined] = []
    for _ in range(PASSES):
        known = _known(layout, [item for item in examined if isinstance(item, tuple)])
        examined = []
        for rotation in layout.rotations:
            held = [item for item in smooth if rotation in still[item.take.name]]
            sensor = layout.correspondence(rotation).measuring_sensor
            if held and sensor is not None:
                is_dead = sensor in dead
                examined.append(examine_rotation(rotation, sensor, held, ranges, dead=is_dead, known=known))
    rotations = [item[0] for item in examined if isinstance(item, tuple)]
    side = worn_side(layout, [*smooth, *for_range])
    odd = [side.sentence] if side.p_value is not None and side.reversed_sensors else []
    odd += [dead_sentence(name) for name in dead if name not in {item.sensor for item in rotations}]
    odd += [item.sentence for item in examined if isinstance(item, NotExamined)]
    odd += [doubt for item in rotations for doubt in item.doubts]
    offered = proposed(layout, rotations)
    return Independence(
        layout=layout.name,
        rule=Rule(),
        sensors=layout.sensors,
        still=still,
        rotations=rotations,
        one_way=_one_way(rotations),
        dead_sensors=dead,
        worn_side=side,
        proposals=offered,
        proposed_layout=proposed_layout(
            layout, offered, proposed_name or f"{layout.name[:LONGEST_NAME]}-examined"
        ).to_document(),
        sentences=list(dict.fromkeys(odd)),
        simulated=any(take.simulated for take in takes),
    )


def _known(layout: Layout, examined: Sequence[tuple[ExaminedRotation, Coupling]]) -> KnownCrosstalk:
    """From the examination and the layout: a sensor of a movement of several rotations (the palm's) follows
    others."""
    palm = [item.measuring_sensor for item in layout.correspondences if item.kind == "MSMR"]
    couplings = {item.sensor: coupling for item, coupling in examined if item.is_coupled}
    coupled = frozenset([*couplings, *filter(None, palm)])
    return KnownCrosstalk(
        coupled, {name: item for name, item in couplings.items() if not coupled.intersection(item.curves)}
    )


def _one_way(rotations: Sequence[ExaminedRotation]) -> list[OneWay]:
    """Sensors that were examined both ways, of which only one affects the other."""
    by_sensor = {item.sensor: item for item in rotations}
    return [
        OneWay(share.sensor, item.sensor)
        for item in rotations
        for share in item.affecting
        if share.affects == "yes"
        and share.sensor in by_sensor
        and not _could_affect(by_sensor[share.sensor], item.sensor)
    ]


def _held(layout: Layout, rotations: Sequence[str]) -> set[str | None]:
    return {layout.correspondence(rotation).measuring_sensor for rotation in rotations}


def _moves(sensor: str, takes: Sequence[SmoothTake]) -> bool:
    holding = [item for item in takes if sensor in item.take.sensors]
    return not holding or any(item.has_moved(sensor) for item in holding)


def _could_affect(item: ExaminedRotation, sensor: str) -> bool:
    """Whether it does, or was not moved enough to tell."""
    return sensor in item.not_moved or any(
        share.sensor == sensor and share.affects != "no" for share in item.affecting
    )


THUMB = ("T_TMC", "TI_ABD", "T_MCP", "T_IP")
"""Wang & Neff 2013, section 3.3: thumb rotations are more accurate when read from all thumb sensors."""
SEVERAL_ROTATIONS = 5
"""A sensor that so many others affect follows a movement of several rotations, as the palm arch does."""


def proposed(layout: Layout, examined: Sequence[ExaminedRotation]) -> list[Proposal]:
    """One for each rotation, in the layout's order."""
    by_rotation = {item.rotation: item for item in examined}
    return [_proposal(item, by_rotation.get(item.rotation)) for item in layout.correspondences]


def proposed_layout(
    layout: Layout, wanted: Sequence[Proposal], name: str, only: Collection[str] | None = None
) -> Layout:
    """``layout`` with the proposals that are sure, or with those for the rotations in ``only``, as ``name``.

    Raises BadInput for a rotation that was not examined.
    """
    examined = [item.rotation for item in wanted if item.is_sure is not None]
    for rotation in only or ():
        if rotation not in examined:
            meant = did_you_mean(rotation, examined, there="examined were")
            raise BadInput(f"there is no proposal for {rotation!r}; {meant}")
    document = layout.to_document()
    rotations: dict[str, list[str]] = dict(document["rotations"])
    palm: list[str] = list(document["palm"])
    for item in wanted:
        if item.is_change and (item.rotation in only if only is not None else item.is_sure):
            rotations[item.rotation] = list(item.sensors)
            palm = [one for one in palm if one != item.rotation]
            palm += [item.rotation] if item.kind == "MSMR" else []
    return Layout.from_document(document | {"name": name, "rotations": rotations, "palm": palm})


def _proposal(now: Correspondence, found: ExaminedRotation | None) -> Proposal:
    rotation = now.rotation

    def stays(sentence: str) -> Proposal:
        return Proposal(rotation, now.kind, now.sensors, now.kind, now.sensors, None, sentence)

    if now.simulated is not None:
        return stays(f"{rotation} has no sensor of its own: it stays {now.simulated} (0S1R).")
    if found is None or found.is_dead:
        why = "its sensor does not move" if found is not None else "it was not examined"
        return stays(f"{rotation} stays as it is, read from {', '.join(now.sensors)} ({now.kind}): {why}.")
    affecting = [share for share in found.affecting if share.affects != "no"]
    weak = found.is_coupled and not affecting
    if weak:  # each below the rule, all of them above it
        affecting = list(found.affecting)
    sensors = (found.sensor, *(share.sensor for share in affecting))
    thumb = tuple(name for name in now.sensors if name in THUMB and name not in sensors)
    if rotation not in THUMB:
        thumb = ()
    sensors = (*sensors, *thumb)
    kind: CorrespondenceKind = (
        "MSMR"
        if now.kind == "MSMR" or len(affecting) >= SEVERAL_ROTATIONS
        else "MS1R"
        if len(sensors) > 1
        else "1S1R"
    )
    unsure = any(share.affects == "undecided" for share in affecting) or (
        found.still is not None and not found.still.is_still
    )
    why = f"{_why(found, affecting)}: read it from {listed(sensors)} ({kind})."
    if affecting:
        undecided = [share.sensor for share in affecting if share.affects == "undecided"]
        why += f" {listed(undecided)} may be below the rule or stand for another." if undecided else ""
    elif thumb and not found.is_coupled:
        why += " Thumb rotations are more accurate with all thumb sensors."
    return Proposal(rotation, kind, sensors, now.kind, now.sensors, not (unsure or weak), why)


def _why(found: ExaminedRotation, affecting: Sequence[AffectingShare]) -> str:
    size = f"{found.std_pct:.1f} % of its range (at most {found.max_pct:.1f} %)"
    if affecting:
        by = [f"{share.sensor} ({share.std_pct:.1f} %, at most {share.max_pct:.1f} %)" for share in affecting]
        return f"{found.sensor} is cross-coupled by {listed(by)}, in all {size}"
    if found.is_coupled:
        still = f"while {found.rotation} is still, and no sensor explains it"
        return f"{found.sensor} moves by {size} {still}"
    rule = f"below {LEAST_STD_PCT:g} % and {LEAST_MAX_PCT:g} %"
    return f"{found.sensor} stays within {size} while others move, {rule}"
