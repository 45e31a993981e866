"""Which gloves the study makes: as unlike as can be, and the same ones in every run.

Properties are dealt like cards: among any twelve gloves of one effect every form, frame rate, bit depth,
nuisance and number of channels comes in turn, in an order of their own that ties no property to another.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar, get_args

import numpy as np
from blind_glove import BlindGlove, Bystander, Nuisance
from further_forms import dealt_forms

from glovecal_models.simulation.causes.catalogue import KNOWN_CAUSES, UNKNOWN_CAUSES
from glovecal_models.simulation.causes.form import Cause, Form
from glovecal_models.simulation.session_plan import FIVE_SENSORS, TAKE_MOTIONS
from glovecal_models.simulation.simulated_hand import ROTATIONS

FLOOR_DEG = 0.77
"""The noise floor of such a glove; sizes are multiples of it."""
BITS = (8, 10, 12)
RATES_HZ = (30.0, 60.0, 100.0)
EVERY_RATE_HZ = (15.0, 30.0, 60.0, 90.0, 120.0)
"""Of gloves that are sold."""
MOTIONS = tuple(motion for motion in TAKE_MOTIONS if motion != "palm")
"""Of gloves without a sensor in the palm, too."""
NUISANCES: tuple[Nuisance, ...] = get_args(Nuisance)
BYSTANDERS: tuple[Bystander, ...] = get_args(Bystander)
CONTEXT_CAUSES = ("contact_pressure", "unknown:context")
WHOLE_HAND = tuple(name for name in ROTATIONS if name != "PALM_ARCH")
"""Fingers, thumb, abductions and wrist, whose ranges differ by as much as six times."""
RECORDED_UNNAMED = ("unknown:context", "unknown:posture_locked")
"""Causes without a name that follow a recorded column: of the context, or of the sensors themselves."""
NOT_RECORDED = ("thumb_across",)
"""Forms of these that follow nothing in the recording: no sensor is on the thumb."""
RECORDED_INPUTS = (
    "cross_coupling", "palm_arch", "hysteresis", "creep", "lag", "warmup_drift", "temperature", "humidity",
    "donning_shift", "supply_sag", "contact_pressure", "unknown:context",
)  # fmt: skip
"""Causes whose input is in the recording and which a static calibration of the own sensor lacks."""
PARTNERS = (
    "cross_coupling", "hysteresis", "creep", "lag", "clock_offset", "warmup_drift", "temperature",
    "donning_shift", "supply_sag", "contact_pressure",
)  # fmt: skip
NO_PAIRS = (
    {"lag", "clock_offset"},  # two delays of the same readings: only their sum is there
    {"hysteresis", "creep"},  # both are the cloth's memory; how to share it between them is a convention
    {"warmup_drift", "supply_sag"},  # a battery falls with the time since power-on
)
"""Pairs whose members have no answer of their own in free motion."""

T = TypeVar("T")


def dealt(choices: Sequence[T], number: int, *stream: object) -> T:
    """The choice of glove ``number``: every run of len(choices) gloves has each of them once."""
    block, place = divmod(number, len(choices))
    random = np.random.default_rng([zlib.crc32(repr(stream).encode()), block])
    return choices[int(random.permutation(len(choices))[place])]


def with_cause(
    part: str, name: str, size: float, number: int, *, set_aside: bool = False
) -> BlindGlove | None:
    """A glove with one cause; None when the cause has no set-aside form."""
    chosen = dealt_forms(name, set_aside=set_aside)
    if not chosen:
        return None
    label = (part, name, size, set_aside)
    form = dealt(chosen, number, *label, "form")
    cause = Cause(name, form.name, size * FLOOR_DEG, _channels(form, number, label))
    bystander = "none" if name in CONTEXT_CAUSES else dealt(BYSTANDERS, number, *label, "bystander")
    return _glove(
        part, name, size, number, label, (cause,), bystander,
        linear=name == "nonlinearity", palm=name == "palm_arch", set_aside=set_aside,
    )  # fmt: skip


def clean(number: int, *, linear: bool, part: str = "clean") -> BlindGlove:
    """A glove that is healthy; one in four has a palm sensor too."""
    label = (part, linear)
    bystander = dealt(BYSTANDERS, number, *label, "bystander")
    palm = dealt((False, False, False, True), number, *label, "palm")
    return _glove(part, "none", 0.0, number, label, (), bystander, linear=linear, palm=palm)


def few_takes(number: int) -> BlindGlove:
    """A healthy glove of any rate, with one kind of motion in two wearings of three short takes."""
    label = ("few-takes",)
    return replace(
        clean(number, linear=False, part="few-takes"),
        rate_hz=dealt(EVERY_RATE_HZ, number, *label, "rate"),
        motion=dealt(MOTIONS, number, *label, "motion"),
        wearings=2,
        takes_per_wearing=3,
        take_s=20.0,
    )


def in_turn(
    part: str, names: Sequence[str], size: float, number: int, *, set_aside: bool = False
) -> BlindGlove | None:
    """The glove of this number among gloves that have ``names`` in turn; None where there is no such form."""
    turn, place = divmod(number, len(names))
    return with_cause(part, names[place], size, turn, set_aside=set_aside)


def unknown(name: str, size: float, number: int) -> BlindGlove:
    """A glove with a cause outside the catalogue, on one channel or all."""
    found = with_cause("unknown", name, size, number)
    assert found is not None, f"{name} has no open form"
    return found


def pair(number: int, size: float, *, set_aside: bool = False) -> BlindGlove:
    """A glove with two causes of ``PARTNERS``, every partner as often as the others."""
    possible = [
        (one, other)
        for place, one in enumerate(PARTNERS)
        for other in PARTNERS[place + 1 :]
        if {one, other} not in NO_PAIRS
    ]
    names = dealt(possible, number, "pairs")
    label = ("pairs", size, set_aside)
    causes = []
    for name in names:
        chosen = dealt_forms(name, set_aside=set_aside)
        form = dealt(chosen, number, *label, name)
        causes.append(Cause(name, form.name, size * FLOOR_DEG))
    return _glove("pairs", "+".join(names), size, number, label, tuple(causes), "none", set_aside=set_aside)


UNDECIDED_SIZES = (0.65, 1.3)
"""Noise floors, in turn: delays of about 12 and 22 ms, of which no recording settles the shorter."""


def undecided(name: str, number: int, *, set_aside: bool = False) -> BlindGlove | None:
    """A weak cause, as leaves rivals; None where there is no such form. In few short takes none is named."""
    return with_cause("next-take", name, UNDECIDED_SIZES[number % 2], number, set_aside=set_aside)


def effect_names(wanted: Sequence[str] | None) -> tuple[str, ...]:
    """Those of the catalogue that were asked for, or all. Raises ValueError for another name."""
    for name in wanted or ():
        if name not in (*KNOWN_CAUSES, *UNKNOWN_CAUSES):
            raise ValueError(
                f"no effect {name!r} can be hidden; there are {', '.join(KNOWN_CAUSES + UNKNOWN_CAUSES)}"
            )
    return tuple(name for name in KNOWN_CAUSES if not wanted or name in wanted)


def unknown_names(wanted: Sequence[str] | None) -> tuple[str, ...]:
    """Causes outside the catalogue, all or those that were asked for."""
    return tuple(name for name in UNKNOWN_CAUSES if not wanted or name in wanted)


def _channels(form: Form, number: int, label: tuple[object, ...]) -> tuple[str, ...] | None:
    """One sensor in every second glove, where the form can sit on one; else where it sits by itself."""
    if form.shared or form.touches not in ("all", "one_or_all"):
        return None
    one = dealt(_joints(number, label), number, *label, "channel")
    return dealt((None, (one,)), number, *label, "channels")


def _joints(number: int, label: tuple[object, ...]) -> tuple[str, ...]:
    """Five bends of fingers, or in every second glove five joints drawn from the whole hand."""
    if not dealt((False, True), number, *label, "whole hand"):
        return FIVE_SENSORS
    random = np.random.default_rng(zlib.crc32(repr((*label, number, "joints")).encode()))
    drawn = random.choice(len(WHOLE_HAND), len(FIVE_SENSORS), replace=False)
    return tuple(WHOLE_HAND[place] for place in sorted(drawn))


def _glove(
    part: str,
    truth: str,
    size: float,
    number: int,
    label: tuple[object, ...],
    causes: tuple[Cause, ...],
    bystander: Bystander,
    *,
    linear: bool = False,
    palm: bool = False,
    set_aside: bool = False,
) -> BlindGlove:
    return BlindGlove(
        part=part,
        truth=truth,
        number=number,
        size=size,
        seed=zlib.crc32(repr((*label, truth, number)).encode()),
        causes=causes,
        bits=dealt(BITS, number, *label, "bits"),
        rate_hz=dealt(RATES_HZ, number, *label, "rate"),
        nuisance=dealt(NUISANCES, number, *label, "nuisance"),
        linear=linear,
        bystander=bystander,
        palm=palm,
        joints=_joints(number, label),
        set_aside=set_aside,
    )
