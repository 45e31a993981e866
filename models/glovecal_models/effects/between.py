"""What stands between two effects, in one table: asked by name, checked when effects are loaded.

``docs/thresholds.md`` prints it. An effect of a package of one's own brings its rows with it
(``About.relations``).
"""

from __future__ import annotations

from glovecal_models.effects.base.relations import (
    AIR,
    CROSSED,
    CUPPED_PALM,
    FAST,
    ONE_FINGER,
    RAMPS,
    SHUFFLED,
    TAPS,
    Motion,
    Relations,
    Remainder,
    Rival,
    Whole,
)

DELAYS = ("clock_offset", "lag", "glove_latency")


def _rivals(effect: str, told_apart_by: Motion, *others: str) -> tuple[Rival, ...]:
    return tuple(Rival(effect, other, told_apart_by) for other in others)


TABLE = Relations(
    rivals=(
        # A glove that is put on anew is cool and dry again: what its air does shows in one wearing.
        *_rivals("temperature", AIR, "humidity", "donning_shift", "garment_slip"),
        *_rivals("humidity", AIR, "donning_shift", "garment_slip"),
        *_rivals("supply_sag", CROSSED, "temperature", "humidity", "donning_shift", "garment_slip"),
        *_rivals(
            "warmup_drift", CROSSED, "temperature", "humidity", "supply_sag", "donning_shift", "garment_slip"
        ),
        *_rivals("donning_shift", CROSSED, "garment_slip"),
        *_rivals("cross_coupling", CUPPED_PALM, "palm_arch"),
        *_rivals("cross_coupling", ONE_FINGER, "contact_pressure"),
        # Slow turns show all of hysteresis and nothing of a delay.
        *_rivals("hysteresis", RAMPS, "creep", *DELAYS),
        *_rivals("lag", FAST, "clock_offset", "glove_latency", "hysteresis", "creep"),
        *_rivals("clock_offset", TAPS, "glove_latency"),
        *_rivals("clock_offset", FAST, "hysteresis", "creep"),
        *_rivals("glove_latency", TAPS, "clock_offset"),
        *_rivals("glove_latency", FAST, "lag", "hysteresis"),
        *_rivals("saturation", RAMPS, "nonlinearity"),
        *_rivals("sensor_fault", SHUFFLED, "nonlinearity"),
    ),
    alike=(DELAYS,),
    alike_between_levels=(("sensor_fault", "nonlinearity"),),
    # What sticks and lets go jumps too, and where it jumps goes along with the joint's turns.
    taken_for=(("sensor_fault", "hysteresis"),),
    # A sheath that turns while it is worn answers less and less.
    alike_at_several=(("sensor_fault", "garment_slip"),),
    wholes=(
        Whole(
            "garment_slip",
            ("donning_shift", "temperature", "humidity", "warmup_drift", "supply_sag", "creep"),
            0.55,
            "A walk over minutes differs between wearings, goes along with one slow column or other by"
            " chance, and a cuff that works down looks like a strip that creeps. A true cause of those saves"
            " more at 1.3 noise floors, a walk less.",
        ),
        Whole(
            "saturation",
            ("cross_coupling", "hysteresis", "lag"),
            0.35,
            "Two simulated gloves that saturate had 0.11 and 0.13.",
        ),
    ),
    remainders=tuple(
        Remainder(
            effect,
            (other,),
            DELAYS,
            "Of 14 simulated gloves no delay saved more than 4 % of what was left once they had either"
            " (2026-11-24).",
        )
        for effect, other in (("creep", "hysteresis"), ("hysteresis", "creep"))
    ),
    unrecorded=(
        (
            "cross_coupling",
            "a common cause that was not recorded, such as grip pressure or a strap, looks the same",
        ),
    ),
    of_the_base=(("nonlinearity", "lmc_gpr"),),
)
