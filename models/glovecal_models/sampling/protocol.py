"""A sampling protocol: steps in their order, what each asks of the person, and the time that they take.

Steps that can be asked: poses held, rotations held by a widget while the rest moves, fingertips together.

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
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean
from glovecal_models.quick_check.key_poses import KEY_POSES_DEG

Kind = Literal["range", "verification", "fk_independent", "fk_cross_couple", "ik"]
"""``range`` shows how far each sensor goes, ``verification`` whether the glove stayed where it was; the
others are the paper's three kinds of sample (Wang & Neff 2013, section 4)."""
Motion = Literal["hold", "move"]
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


@dataclass(frozen=True)
class Step:
    """Plain data; a protocol is a sequence of these."""

    name: str
    """Unique in its protocol."""
    kind: Kind
    motion: Motion
    """``hold``: the whole hand is still while it is recorded; ``move``: all but ``angles`` moves freely."""
    ask: str
    """A short sentence to read out."""
    seconds: float
    """How long it is recorded."""
    part: str
    """Steps of one part, one after the other, make one take."""
    pose: str = ""
    """What the frames are called in the take."""
    angles: Mapping[str, float] = field(default_factory=dict)
    """Degrees by rotation that hold all the time; what is not named is not known."""
    moves: tuple[str, ...] = ()
    """Sensors that have to move."""
    needs: str = ""
    """What to take in the hand first."""
    touches: tuple[str, ...] = ()
    """Digits (T, I, M, R, P) whose tips are held together, or against the ends of the rod."""
    rod_mm: float | None = None
    """Distance of the two tips; None: they touch."""
    repeats: str = ""
    """Name of the step that this one does again, as a check; "" for none."""

    def to_document(self) -> dict[str, Any]:
        return asdict(self) | {"angles": dict(self.angles)}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Step:
        lists = {name: tuple(document[name]) for name in ("moves", "touches")}
        return cls(**{**document, **lists})


COUNTDOWN_S = 2.0
SETTLE_S = 0.5
"""The hand has to be still for so long before a pose is recorded."""


def step_capture_s(step: Step) -> float:
    """Countdown, settling and recording, in seconds."""
    return COUNTDOWN_S + (SETTLE_S if step.motion == "hold" else 0.0) + step.seconds


@dataclass(frozen=True)
class Protocol:
    """Raises BadInput for no steps, or two of one name."""

    name: str
    steps: tuple[Step, ...]
    grows: bool = False
    """Further steps are chosen when these are done."""
    equipment: Mapping[str, Any] = field(default_factory=dict)
    """What the person has (``Equipment.to_document()``), for steps that are still to be chosen."""
    seed: int | None = None
    """Of the random order of poses and widgets; None: they are in their fixed order."""

    def __post_init__(self) -> None:
        names = [step.name for step in self.steps]
        if not names:
            raise BadInput(f"protocol {self.name!r} has no step that this glove's layout could learn from")
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise BadInput(f"protocol {self.name!r}: two steps are named {twice!r}")

    @property
    def capture_s(self) -> float:
        """Countdowns, settling and recording of a person who does every step at once, in seconds."""
        return sum(step_capture_s(step) for step in self.steps)

    def step(self, name: str) -> Step:
        """Raises BadInput."""
        for step in self.steps:
            if step.name == name:
                return step
        raise BadInput(f"no step {name!r} in protocol {self.name}; {did_you_mean(name, self._names)}")

    @property
    def _names(self) -> list[str]:
        return [step.name for step in self.steps]

    def to_document(self) -> dict[str, Any]:
        steps = [step.to_document() for step in self.steps]
        document = {"name": self.name, "steps": steps, "grows": self.grows}
        return document | {"equipment": dict(self.equipment), "seed": self.seed}

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Protocol:
        steps = tuple(Step.from_document(step) for step in document["steps"])
        grows, equipment = document.get("grows", False), document.get("equipment", {})
        return cls(document["name"], steps, bool(grows), equipment, document.get("seed"))


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
