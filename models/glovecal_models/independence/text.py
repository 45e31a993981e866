"""Sentences about an examination: what is odd, and why each rotation should be read as proposed."""

from __future__ import annotations

from collections.abc import Sequence

from glovecal_models.hand_ranges import ACTIVE_RANGE_DEG
from glovecal_models.independence.active_range import SEEN_SHARE, ActiveRange
from glovecal_models.independence.coupling import LEAST_MAX_PCT, LEAST_STD_PCT
from glovecal_models.independence.examination import (
    LEAST_BLOCKS,
    UNEXPLAINED_PCT,
    NotExamined,
    RotationExamination,
)
from glovecal_models.independence.independence import LEAST_SENSORS, Independence, WornSide
from glovecal_models.independence.proposal import Proposal


def independence_sentences(found: Independence) -> list[str]:
    """What is odd about the glove or the takes, each once."""
    side = found.worn_side
    odd_side = [worn_side_sentence(side)] if side.p_value is not None and side.reversed_sensors else []
    examined = {item.sensor for item in found.rotations}
    dead = [dead_sentence(name) for name in found.dead_sensors if name not in examined]
    not_examined = [not_examined_sentence(item) for item in found.not_examined]
    doubts = [doubt for item in found.rotations for doubt in doubt_sentences(item)]
    return list(dict.fromkeys([*odd_side, *dead, *not_examined, *doubts]))


def worn_side_sentence(side: WornSide) -> str:
    """Which hand the glove is of, and how sure that is."""
    if side.verdict == "not identifiable":
        why = (
            "only of a CyberGlove it is known which way each sensor reads"
            if not side.is_known_glove
            else f"it takes measured angles of {LEAST_SENSORS} bending and {LEAST_SENSORS} sideways joints "
            "that moved"
        )
        return f"Which hand the glove is of is not identifiable: {why}."
    count = f"{side.bending} bending and {side.sideways} sideways sensors read the wrong way"
    if side.verdict == "as it should be":
        names = ", ".join(side.reversed_sensors)
        odd = f" {names} read the wrong way: are they swapped with others?" if names else ""
        return f"The glove is of this hand: {count}.{odd}"
    question = (
        "Is this a left glove on a right hand (or the reverse), or worn back to front?"
        if side.verdict == "back to front"
        else "Is this the glove of the other hand?"
    )
    return (
        f"{question} {count} (p = {side.p_value:.2g} for random signs). A reference that counts angles the "
        "other way looks the same."
    )


def not_examined_sentence(item: NotExamined) -> str:
    """Why a rotation was not examined, and what to record."""
    if item.unknown_range is not None:
        known = range_sentence(item.unknown_range)
        return known or f"The range of {item.unknown_range.sensor} was not seen yet."
    return (
        f"{item.rotation} was kept still for {item.seconds} s in all; move the others for {LEAST_BLOCKS} s "
        "or more."
    )


def range_sentence(known: ActiveRange) -> str | None:
    """What is wrong with a range, and what to record; None: nothing."""
    sensor = known.sensor
    how = f"record a take called range-{sensor} in which only that joint goes through its range"
    if not known.has_moved and known.source == "what the glove can send":
        return (
            f"The range of {sensor} was not seen yet: per cents are of all the glove can send, so they are "
            f"too small; {how}."
        )
    if not known.has_moved:
        return f"The range of {sensor} was not seen yet: nothing can be given in per cent of it; {how}."
    if sensor in ACTIVE_RANGE_DEG and known.angle_deg is not None:
        low, high = ACTIVE_RANGE_DEG[sensor]
        if known.angle_deg < SEEN_SHARE * (high - low):
            return (
                f"{sensor} went through {known.angle_deg:.0f} degrees; a healthy hand goes through "
                f"{high - low:.0f}: per cents of so short a range are too large; {how}."
            )
    if known.source == "all that was read":
        return (
            f"The range of {sensor} is all that it read, its neighbours' crosstalk included, so per cents "
            f"may be too small; {how}."
        )
    return None


def dead_sentence(sensor: str) -> str:
    return f"Sensor {sensor} does not move in any take: is it broken, or its wire?"


def doubt_sentences(item: RotationExamination) -> list[str]:
    """What makes an examined rotation's result doubtful."""
    sensor, still, coupling = item.sensor, item.stillness, item.coupling
    doubts = [dead_sentence(sensor)] if item.is_dead else []
    if still is not None and not still.is_still:
        doubts.append(
            f"{item.rotation} was not still: it moved by {still.std_pct:.0f} % of its range (standard "
            f"deviation; {still.span_pct:.0f} % from end to end). What its angle explains is removed."
        )
    if still is None and coupling.unexplained_pct >= UNEXPLAINED_PCT:
        doubts.append(
            f"{sensor} moved by {coupling.unexplained_pct:.0f} % of its range independently of every other "
            f"sensor: was {item.rotation} really kept still? Nothing else here measures it."
        )
    for share in coupling.shares:
        if share.rivals and share.affects is not False:
            doubts.append(
                f"{share.sensor} and {_listed(share.rivals)} always moved together, so which of them "
                f"affects {sensor} is not identifiable: move each for some seconds by itself."
            )
    doubts += [sentence] if (sentence := range_sentence(item.active_range)) else []
    if len(item.rough_causes) > 0:
        first = next(iter(item.rough_causes))
        are = "are" if len(item.rough_causes) > 1 else "is"
        doubts.append(
            f"{_listed(item.rough_causes)} {are} cross-coupled too, so the shares in {sensor} are rough: "
            "measure the angles, or move each joint alone, in takes called like "
            f"still-{sensor}-move-{first}."
        )
    return doubts


def one_way_sentence(affecting: str, affected: str) -> str:
    return f"{affecting} affects {affected}, {affected} does not affect {affecting}."


def proposal_sentence(item: Proposal) -> str:
    """How a rotation should be read, and why."""
    found, affecting = item.examination, item.affecting
    if item.rule is not None:
        return f"{item.rotation} has no sensor of its own: it stays {item.rule} (0S1R)."
    if item.is_sure is None or found is None:
        why = "its sensor does not move" if found is not None else "it was not examined"
        return f"{item.rotation} stays as it is, read from {', '.join(item.sensors)} ({item.kind}): {why}."
    size = f"{found.std_pct:.1f} % of its range (at most {found.max_pct:.1f} %)"
    read = f"read it from {_listed(item.sensors)} ({item.kind})"
    if not affecting and found.is_coupled:
        none = f"while {found.rotation} is still, and no sensor explains it"
        return f"{found.sensor} moves by {size} {none}: {read}."
    if not affecting:
        rule = f"below {LEAST_STD_PCT:g} % and {LEAST_MAX_PCT:g} %"
        beside = " Thumb rotations are more accurate with all thumb sensors." if item.thumb else ""
        return f"{found.sensor} stays within {size} while others move, {rule}: {read}.{beside}"
    by = _listed(
        [f"{share.sensor} ({share.std_pct:.1f} %, at most {share.max_pct:.1f} %)" for share in affecting]
    )
    undecided = [share.sensor for share in affecting if share.affects is None]
    unsure = f" {_listed(undecided)} may be below the rule or stand for another." if undecided else ""
    return f"{found.sensor} is cross-coupled by {by}, in all {size}: {read}.{unsure}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
