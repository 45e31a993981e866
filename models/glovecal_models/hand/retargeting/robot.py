"""A robot's hand as its URDF describes it: joints, axes, limits, and which links are a hand's bones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.bones import HAND, PHALANGES
from glovecal_models.hand.retargeting.bone_names import BONES_AND_TIPS, TIP
from glovecal_models.hand.retargeting.turns import turned_about
from glovecal_models.names import did_you_mean

MM_PER_M = 1e3
LARGEST_URDF = 5_000_000
"""Characters."""
MOST_LINKS = 2_000
_ROBOTS = Path(__file__).with_name("robots")
_TURNING, _STILL = ("revolute", "continuous"), ("fixed",)


def known_robots() -> tuple[str, ...]:
    """Names of the robot hands that come with this package: ``shadow_right`` and so on."""
    return tuple(sorted(path.stem for path in _ROBOTS.glob("*.urdf")))


def urdf_of(name: str) -> str:
    """Of one of ``known_robots``. Raises BadInput for another name."""
    if name not in known_robots():
        raise BadInput(f"no robot hand {name!r} comes with Glovecal; {did_you_mean(name, known_robots())}")
    return (_ROBOTS / f"{name}.urdf").read_text("utf-8")


@dataclass(frozen=True)
class RobotJoint:
    """One hinge; what hangs on it by fixed joints is part of its link."""

    name: str
    parent: int | None
    """Number of the hinge above it."""
    place_mm: np.ndarray
    """(3,) in the parent's frame."""
    turn: np.ndarray
    """(3, 3) at angle 0, in the parent's frame."""
    axis: np.ndarray
    """(3,) of length 1, in its own frame."""
    low: float
    high: float
    """Radians."""
    mimics: tuple[str, float, float] | None = None
    """The joint that it follows, the factor and what is added, radians."""


@dataclass(frozen=True)
class RobotHand:
    """Hinges, parents before children, and points of them that a hand has too."""

    joints: tuple[RobotJoint, ...]
    points: Mapping[str, tuple[int | None, np.ndarray, np.ndarray]]
    """By the hand's bone where it begins, or ``index_tip`` and so on: hinge, place (3,) mm, turn (3, 3)."""
    links: Mapping[str, str]
    """Names of the links that these are."""
    every_link: tuple[str, ...] = ()

    @classmethod
    def known(cls, name: str) -> RobotHand:
        """One of ``known_robots``. Raises BadInput for another name."""
        return cls.from_urdf(urdf_of(name), name)

    @classmethod
    def from_urdf(cls, text: str, name: str, links: Mapping[str, str] | None = None) -> RobotHand:
        """``links``: the robot's link by the hand's bone (``hand``, ``index_proximal``, ..., ``index_tip``),
        where it is not the link of that very name; "": none. The axes of the hand's link: x from the wrist to
        the middle finger's knuckle, z out of the back of the hand.

        Raises BadInput that names ``name`` for what is no URDF, for a hand without two fingers, and for links
        or joints that cannot be used.
        """
        tree = _Tree.of(text, name)
        wanted = {bone: bone for bone in BONES_AND_TIPS if bone in tree.links} | dict(links or {})
        wanted = {bone: link for bone, link in wanted.items() if link}
        for bone, link in wanted.items():
            if bone not in BONES_AND_TIPS:
                raise BadInput(f"a hand has no {bone!r}; {did_you_mean(bone, BONES_AND_TIPS)}")
            if link not in tree.links:
                raise BadInput(
                    f"{name} has no link {link!r}, which is to be {bone}; {did_you_mean(link, tree.links)}"
                )
        made = cls(
            tuple(tree.hinges),
            {bone: tree.links[link] for bone, link in wanted.items()},
            wanted,
            tuple(tree.links),
        )
        if HAND not in made.points or len(made.fingers) < 2:
            raise BadInput(
                f"{name} has no hand that is known: links `hand` and of two fingers, as `index_proximal`, "
                "`index_intermediate`, `index_distal` and `index_tip`, are needed; add them to it as fixed "
                "links, or say which links they are"
            )
        return made

    @cached_property
    def fingers(self) -> tuple[str, ...]:
        """Those of which every bone and the tip are known."""
        return tuple(
            finger for finger, parts in PHALANGES.items()
            if all(f"{finger}_{part}" in self.points for part in (*parts, TIP))
        )  # fmt: skip

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Names of the joints that follow no other: what a robot is told."""
        return tuple(joint.name for joint in self.joints if joint.mimics is None)

    @cached_property
    def limits(self) -> np.ndarray:
        """(J, 2) radians of ``free``; those of a joint that follows hold for the one it follows."""
        bounds = {joint.name: [joint.low, joint.high] for joint in self.joints if joint.mimics is None}
        for joint in self.joints:
            if joint.mimics is not None:
                leader, factor, added = joint.mimics
                ends = sorted(((joint.low - added) / factor, (joint.high - added) / factor))
                low, high = bounds[leader]
                bounds[leader] = [max(low, ends[0]), min(high, ends[1])]
        return np.array([bounds[name] for name in self.free])

    def posed(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(N, H, 3, 3) orientations and (N, H, 3) mm places of the hinges, in the root's frame; of ``angles``
        (N, J) radians of ``free``."""
        count = len(angles)
        every = angles @ self.follows.T + self.offsets
        own = self._turns @ turned_about(self._axes, every)
        orientations = np.empty((count, len(self.joints), 3, 3))
        places = np.empty((count, len(self.joints), 3))
        for numbers, parents in self._levels:
            if parents is None:
                orientations[:, numbers], places[:, numbers] = own[:, numbers], self._places[numbers]
                continue
            above = orientations[:, parents]
            orientations[:, numbers] = above @ own[:, numbers]
            places[:, numbers] = places[:, parents] + (above @ self._places[numbers, :, None])[..., 0]
        return orientations, places

    @cached_property
    def follows(self) -> np.ndarray:
        """(H, J) how far a hinge turns for each of ``free``."""
        matrix = np.zeros((len(self.joints), len(self.free)))
        for number, joint in enumerate(self.joints):
            leader, factor = (joint.name, 1.0) if joint.mimics is None else joint.mimics[:2]
            matrix[number, self.free.index(leader)] = factor
        return matrix

    @cached_property
    def offsets(self) -> np.ndarray:
        """(H,) radians of a hinge where all of ``free`` are 0."""
        return np.array([0.0 if joint.mimics is None else joint.mimics[2] for joint in self.joints])

    @cached_property
    def ancestors(self) -> np.ndarray:
        """(H, H) bool: whether the hinge of the column moves the one of the row, itself among them."""
        moved = np.eye(len(self.joints), dtype=bool)
        for number, joint in enumerate(self.joints):
            if joint.parent is not None:
                moved[number] |= moved[joint.parent]
        return moved

    @cached_property
    def _axes(self) -> np.ndarray:
        return np.array([joint.axis for joint in self.joints])

    @cached_property
    def _turns(self) -> np.ndarray:
        return np.array([joint.turn for joint in self.joints])

    @cached_property
    def _places(self) -> np.ndarray:
        return np.array([joint.place_mm for joint in self.joints])

    @cached_property
    def _levels(self) -> list[tuple[list[int], list[int] | None]]:
        """Hinges that are as many below the root, and theirs above."""
        depth = self.ancestors.sum(axis=1)
        levels: list[tuple[list[int], list[int] | None]] = []
        for below in range(1, int(depth.max()) + 1):
            numbers = np.flatnonzero(depth == below).tolist()
            parents = [self.joints[number].parent for number in numbers]
            levels.append((numbers, None if below == 1 else [each for each in parents if each is not None]))
        return levels


class _Tree:
    """A URDF's joints, from its root on; fixed ones are folded into what they hang on."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.hinges: list[RobotJoint] = []
        self.links: dict[str, tuple[int | None, np.ndarray, np.ndarray]] = {}

    @classmethod
    def of(cls, text: str, name: str) -> _Tree:
        if len(text) > LARGEST_URDF:
            raise BadInput(
                f"{name} has {len(text)} characters; a robot's description has {LARGEST_URDF} at most"
            )
        try:
            robot = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise BadInput(f"{name} is no XML; give a robot's URDF (xacro has to be run before)") from error
        joints = robot.findall("joint") if robot.tag == "robot" else []
        if not 0 < len(joints) <= MOST_LINKS:
            raise BadInput(
                f"{name} describes no robot, or more than {MOST_LINKS} joints; give a robot's URDF"
            )
        made = cls(name)
        below: dict[str, list[ElementTree.Element]] = {}
        children = set()
        for joint in joints:
            below.setdefault(made._link(joint, "parent"), []).append(joint)
            child = made._link(joint, "child")
            if child in children:
                raise BadInput(f"in {name} link {child!r} hangs on two joints; a robot is a tree")
            children.add(child)
        roots = [link for link in below if link not in children]
        if len(roots) != 1:
            raise BadInput(f"{name} has {len(roots)} links that hang on nothing; a robot has one root")
        made.links[roots[0]] = (None, np.zeros(3), np.eye(3))
        waiting = [roots[0]]
        while waiting:
            for joint in below.pop(waiting.pop(), ()):
                made._add(joint)
                waiting.append(made._link(joint, "child"))
        names = [hinge.name for hinge in made.hinges]
        for hinge in made.hinges:
            if hinge.mimics is not None and (
                hinge.mimics[0] not in names or made.hinges[names.index(hinge.mimics[0])].mimics is not None
            ):
                raise BadInput(
                    f"{name}: joint {hinge.name!r} mimics {hinge.mimics[0]!r}, which is no joint of its own"
                )
        return made

    def _link(self, joint: ElementTree.Element, which: str) -> str:
        element = joint.find(which)
        link = "" if element is None else element.get("link", "")
        if not link or not joint.get("name"):
            raise BadInput(
                f"{self.name}: a joint has no name, or joint {joint.get('name')!r} no {which} link"
            )
        return link

    def _add(self, joint: ElementTree.Element) -> None:
        name, kind = joint.get("name", ""), joint.get("type", "")
        origin = joint.find("origin")
        place = self._numbers(origin, "xyz", name) * MM_PER_M
        turn = _of_roll_pitch_yaw(self._numbers(origin, "rpy", name))
        number, above_place, above_turn = self.links[self._link(joint, "parent")]
        place, turn = above_place + above_turn @ place, above_turn @ turn
        child = self._link(joint, "child")
        if kind in _STILL:
            self.links[child] = (number, place, turn)
            return
        if kind not in _TURNING:
            raise BadInput(
                f"{self.name}: joint {name!r} is {kind!r}; joints of a hand turn (revolute) or are fixed"
            )
        element = joint.find("axis")
        axis = np.array([1.0, 0.0, 0.0]) if element is None else self._numbers(element, "xyz", name)
        length = float(np.linalg.norm(axis))
        if not length > 0:
            raise BadInput(f"{self.name}: the axis of joint {name!r} has no direction")
        low, high = self._limits(joint, name, kind)
        mimics = joint.find("mimic")
        follows = None
        if mimics is not None:
            factor, added = (self._number(mimics, key, name, default) for key, default in _MIMIC.items())
            if factor == 0:
                raise BadInput(f"{self.name}: joint {name!r} mimics another by a factor of 0; make it fixed")
            follows = (mimics.get("joint", ""), factor, added)
        self.hinges.append(RobotJoint(name, number, place, turn, axis / length, low, high, follows))
        self.links[child] = (len(self.hinges) - 1, np.zeros(3), np.eye(3))

    def _limits(self, joint: ElementTree.Element, name: str, kind: str) -> tuple[float, float]:
        limit = joint.find("limit")
        if limit is None or kind == "continuous":
            return -np.pi, np.pi
        low, high = (self._number(limit, key, name, 0.0) for key in ("lower", "upper"))
        if not low < high:
            raise BadInput(f"{self.name}: joint {name!r} goes from {low:g} to {high:g} rad; make it fixed")
        return low, high

    def _number(self, element: ElementTree.Element, key: str, name: str, default: float) -> float:
        text = element.get(key)
        try:
            value = default if text is None else float(text)
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise BadInput(f"{self.name}: {key} of joint {name!r} is {text!r}, no number")
        return value

    def _numbers(self, element: ElementTree.Element | None, key: str, name: str) -> np.ndarray:
        text = "0 0 0" if element is None else element.get(key, "0 0 0")
        try:
            values = np.array([float(part) for part in text.split()])
        except ValueError:
            values = np.zeros(0)
        if values.shape != (3,) or not np.isfinite(values).all():
            raise BadInput(f"{self.name}: {key} of joint {name!r} is {text!r}, not three numbers")
        return values


_MIMIC = {"multiplier": 1.0, "offset": 0.0}


def _of_roll_pitch_yaw(angles: np.ndarray) -> np.ndarray:
    """(3, 3) about the fixed axes x, y, z in this order."""
    x, y, z = (turned_about(axis, angle) for axis, angle in zip(np.eye(3), angles, strict=True))
    return z @ y @ x
