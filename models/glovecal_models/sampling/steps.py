"""Steps that can be asked: poses held, rotations held by a widget while the rest moves, fingertips together.

Key poses are FK-independent samples and verification (Wang & Neff 2013, section 5.1.1): flat, spread, fist
and overbend, so that each independent sensor sees at least two angles. Only the fingers' flexion is taken as
known by the pose's name; what a user measured in his own poses replaces it and may name any rotation.

Widgets are FK-cross-couple samples (section 5.1.2): the gap between two fingers at 0, 10, 20 and 30 degrees.
The paper does so for every coupled rotation of its Table 1; thumb and wrist go further, so their widgets do.

Touches are IK samples (section 5.2.1, and for the rod the second limit in section 9). The tips stay together
through the whole recording while the hand changes its shape, so that every frame is a sample; which angles
they are is worked out afterwards, by inverse kinematics on the subject's own hand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from glovecal_models.layout import Layout
from glovecal_models.quick_check.pose_book import KEY_POSES_DEG
from glovecal_models.sampling.protocol import Step

KEY_POSES = ("flat", "spread", "fist", "overbend")
HOLD_S = 1.2
CHECK_PART = "quick-check"
PoseAngles = Mapping[str, Mapping[str, float]]

_ASK = {
    "flat": "Lay your hand flat on the table, fingers together.",
    "spread": "Hand flat on the table, fingers spread as far as they go.",
    "fist": "Make a fist.",
    "overbend": "Bend all knuckles as far as they go, fingers straight.",
    "ramp": "Palm on the table, straight fingers down the 45 degree ramp.",
}
_RAMP = {f"{finger}_MCP": 45.0 for finger in "IMRP"} | {f"{finger}_PIP": 0.0 for finger in "IMRP"}
"""Not the paper's: without it a process knows two clusters of angles and nothing between."""
_NEEDS = {"ramp": "the 45 degree ramp"}
_OVERBEND = {f"{finger}_MCP": 88.0 for finger in "IMRP"} | {f"{finger}_PIP": 12.0 for finger in "IMRP"}


def usual_angles() -> dict[str, dict[str, float]]:
    """The fingers' flexion in the key poses of a usual hand, degrees."""
    known = {
        pose: {name: deg for name, deg in angles.items() if name[0] in "IMRP" and not name.endswith("ABD")}
        for pose, angles in KEY_POSES_DEG.items()
    }
    return known | {"overbend": _OVERBEND, "ramp": _RAMP}


def key_pose_steps(rounds: int = 1, angles: PoseAngles | None = None) -> list[Step]:
    """Every pose once a round; ``angles`` by pose go before the usual ones and may add poses."""
    known = usual_angles() | {pose: dict(own) for pose, own in (angles or {}).items()}
    return [
        _held(f"{pose}-{round_}", "fk_independent", pose, known[pose], f"key-poses-{round_}")
        for round_ in range(1, rounds + 1)
        for pose in known
    ]


def shape_steps(rounds: int, angles: PoseAngles | None = None) -> list[Step]:
    """Flat, spread, fist, and the two "o" of thumb with index and with little finger (Krnoul et al. 2016,
    section 3.3.4), every one once a round; ``angles`` as in ``key_pose_steps``."""
    known = usual_angles() | {pose: dict(own) for pose, own in (angles or {}).items()}
    touches = [step for step in touch_steps() if step.touches[1] in ("I", "P")]
    steps = []
    for round_ in range(1, rounds + 1):
        part = f"shapes-{round_}"
        steps += [
            _held(f"{pose}-{round_}", "fk_independent", pose, known[pose], f"{part}-held")
            for pose in ("flat", "spread", "fist")
        ]
        steps += [_closed(step, f"{step.name}-{round_}", f"{part}-o") for step in touches]
    return steps


def _closed(touch: Step, name: str, part: str) -> Step:
    """The "o" of a touch: held, not moved."""
    ask = f"Thumb and {_FINGER[touch.touches[1]]} fingertip together like an o; hold still."
    return replace(touch, name=name, motion="hold", ask=ask, seconds=HOLD_S, part=part, moves=())


def verification_steps(when: str) -> list[Step]:
    """Flat and fist, at the ``start`` and the ``end``: what reads otherwise in the end has moved."""
    part = f"verification-{when}"
    return [_held(f"{pose}-{when}", "verification", pose, {}, part) for pose in ("flat", "fist")]


def check_steps(poses: tuple[str, ...]) -> list[Step]:
    """Poses of a new wearing: their angles are those that the subject's own takes know."""
    return [_held(pose, "verification", pose, {}, CHECK_PART) for pose in poses]


def _held(name: str, kind, pose: str, angles: Mapping[str, float], part: str) -> Step:  # kind: step.Kind
    ask = _ASK.get(pose, f"Take the pose {pose}.")
    return Step(
        name, kind, "hold", ask, HOLD_S, part, pose=pose, angles=dict(angles), needs=_NEEDS.get(pose, "")
    )


MOVE_S = 4.0
WIDEST_DEG = 120.0
WidgetAngles = Mapping[str, Sequence[float]]
WIDGET_DEG: Mapping[str, tuple[float, ...]] = {
    "IM_ABD": (0.0, 10.0, 20.0, 30.0),
    "MR_ABD": (0.0, 10.0, 20.0, 30.0),
    "RP_ABD": (0.0, 10.0, 20.0, 30.0),
    "TI_ABD": (0.0, 20.0, 40.0, 60.0),
    "T_TMC": (0.0, 30.0, 60.0),
    "T_MCP": (0.0, 25.0, 50.0),
    "T_IP": (0.0, 35.0, 70.0),
    "W_FLEX": (-50.0, -15.0, 20.0, 60.0),
    "W_ABD": (-25.0, -5.0, 15.0),
}
"""Degrees of the widgets by the rotation they hold."""

_WHERE = {
    "IM_ABD": "between index and middle finger; bend both fingers freely",
    "MR_ABD": "between middle and ring finger; bend both fingers freely",
    "RP_ABD": "between ring and little finger; bend both fingers freely",
    "TI_ABD": "between thumb and index finger; bend and turn the thumb freely",
    "T_TMC": "under the thumb's base; spread and bend the thumb freely",
    "T_MCP": "on the thumb's middle joint; turn, spread and bend the rest of it",
    "T_IP": "on the thumb's last joint; turn, spread and bend the rest of it",
    "W_FLEX": "under the wrist; move the hand from side to side",
    "W_ABD": "beside the wrist; bend the wrist up and down",
}


def widget_steps(layout: Layout, angles: WidgetAngles | None = None) -> list[Step]:
    """For each rotation that the layout reads from several sensors, one step a widget.

    ``angles`` by rotation go before ``WIDGET_DEG``: the widgets that a user really has.
    """
    chosen = {**WIDGET_DEG, **(angles or {})}
    steps: list[Step] = []
    for correspondence in layout.correspondences:
        rotation = correspondence.rotation
        if correspondence.kind == "MS1R" and rotation in chosen:
            others = tuple(sensor for sensor in correspondence.sensors if sensor != rotation)
            steps += [widget_step(rotation, float(angle), others) for angle in chosen[rotation]]
    return steps


def widget_step(rotation: str, angle_deg: float, moves: tuple[str, ...]) -> Step:
    widget = f"the {angle_deg:g} degree widget"
    where = _WHERE.get(rotation, f"so that it holds {rotation}; move the rest freely")
    return Step(
        name=f"{rotation}{angle_deg:+g}",
        kind="fk_cross_couple",
        motion="move",
        ask=f"Put {widget} {where}.",
        seconds=MOVE_S,
        part=rotation,
        angles={rotation: angle_deg},
        moves=moves,
        needs=widget,
    )


TOUCH_S = 4.0
_FINGER = {"I": "index", "M": "middle", "R": "ring", "P": "little"}


def touch_steps() -> list[Step]:
    """Thumb to index, middle, ring and little finger."""
    return [
        Step(
            name=f"touch-{finger}",
            kind="ik",
            motion="move",
            ask=f"Thumb and {word} fingertip together; keep them together while you move both.",
            seconds=TOUCH_S,
            part="touch",
            pose=f"touch-{finger}",
            moves=(f"{finger}_MCP",),
            touches=("T", finger),
        )
        for finger, word in _FINGER.items()
    ]


def rod_step(length_mm: float, finger: str = "I") -> Step:
    """The ends of a rod of known length between thumb and one fingertip."""
    rod = f"the rod of {length_mm:g} mm"
    return Step(
        name=f"rod-{finger}-{length_mm:g}",
        kind="ik",
        motion="move",
        ask=f"Hold {rod} between the tips of thumb and {_FINGER[finger]} finger, and move both.",
        seconds=TOUCH_S,
        part="rod",
        pose=f"rod-{finger}-{length_mm:g}",
        moves=(f"{finger}_MCP",),
        needs=rod,
        touches=("T", finger),
        rod_mm=length_mm,
    )
