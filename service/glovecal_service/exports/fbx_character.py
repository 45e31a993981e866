"""A character as a binary FBX file (7.4 to 7.7).

How bones stand at rest says the bind pose; what it leaves out follows from a model's own properties.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.rig import Rig, RigBone
from glovecal_service.exports.character import (
    DEEPEST,
    LARGEST,
    MOST_LISTED,
    Character,
    MovingHand,
    axes_of,
    distinct,
    notes_of,
)
from glovecal_service.exports.fbx_animation import (
    TURN,
    Animated,
    Animation,
    channels_of,
    euler_curves,
    euler_degrees,
)
from glovecal_service.exports.fbx_models import NUMBERS, VECTORS, Model, Placed
from glovecal_service.exports.fbx_records import (
    BETWEEN_NAME_AND_KIND,
    RIGHT,
    Record,
    RecordFile,
    Records,
    Value,
)
from glovecal_service.exports.hand_motion import HandMotion

AXES = ("CoordAxis", "UpAxis", "FrontAxis")
"""To the right, up, and to who looks."""
LARGEST_ID = (1 << 62) - 1
LARGEST_COUNT = (1 << 31) - 1


@dataclass(frozen=True)
class FbxCharacter(Character):
    suffix = ".fbx"
    path: Path
    name: str
    models: tuple[Model, ...] = field(repr=False)
    parents: Mapping[int, int] = field(repr=False)
    """By id."""
    bind: Mapping[int, np.ndarray] = field(repr=False)
    """(4, 4) in the world, by id."""
    first_free: int

    @classmethod
    def read(cls, path: Path, name: str) -> FbxCharacter:
        with _opened(path, name) as file:
            try:
                return cls._of(file, path)
            except BadInput:
                raise
            except (TypeError, ValueError, StopIteration, OverflowError) as error:
                raise BadInput(f"the nodes of {name} are not as FBX has them. {RIGHT}") from error

    @classmethod
    def _of(cls, file: RecordFile, path: Path) -> FbxCharacter:
        tops = {record.name: record for record in file.records()}
        if b"Objects" not in tops or b"Connections" not in tops:
            raise BadInput(f"{file.name} has no objects, or says not how they hang together. {RIGHT}")
        if b"GlobalSettings" in tops:
            _require_right_handed(file, tops[b"GlobalSettings"])
        usual = _usual(file, tops[b"Definitions"]) if b"Definitions" in tops else {}
        models, poses, highest = [], [], 0
        for record in file.records(tops[b"Objects"]):
            values = file.values(record)
            id = next(values, None)
            highest = max(highest, id) if isinstance(id, int) else highest
            if record.name == b"Model":
                name = _text(next(values)).partition(BETWEEN_NAME_AND_KIND)[0]
                models.append(Model(_integer(id), name, usual | dict(_properties(file, record))))
                if len(models) > MOST_LISTED:
                    raise BadInput(
                        f"{file.name} has more than {MOST_LISTED} nodes; export the character alone"
                    )
            elif record.name == b"Pose":
                poses.append(record)
        if highest > LARGEST_ID:
            raise BadInput(f"{file.name} has an object of the number {highest}, too high to add one. {RIGHT}")
        names = distinct(model.name for model in models)
        own = {model.id for model in models}
        if len(own) < len(models):
            raise ValueError("two nodes have one number")
        return cls(
            path, file.name,
            tuple(Model(model.id, name, model.properties) for model, name in zip(models, names, strict=True)),
            dict(_connections(file, tops[b"Connections"], own)),
            {id: matrix for pose in poses for id, matrix in _bind(file, pose) if id in own},
            highest + 1,
        )  # fmt: skip

    @cached_property
    def rig(self) -> Rig:
        try:
            return Rig(tuple(self._bones()))
        except ValueError as error:
            raise BadInput(f"the nodes of {self.name} are not as FBX has them. {RIGHT}") from error

    def _bones(self) -> Iterator[RigBone]:
        below: dict[int | None, list[Model]] = {}
        for model in self.models:
            below.setdefault(self.parents.get(model.id), []).append(model)
        waiting: list[tuple[Model, Model | None, int, Placed]]
        waiting = [(model, None, 0, Placed.origin()) for model in below.get(None, [])]
        while waiting:
            model, parent, depth, above = waiting.pop()
            if depth > DEEPEST:
                raise ValueError("no tree")
            placed = self._placed(model, parent, above)
            if not placed.size.all():  # it shows nothing, nor what hangs on it
                continue
            x, y, z = placed.world[:3, 3].tolist()
            above_name = None if parent is None else parent.name
            yield RigBone(model.name, above_name, (x, y, z), axes_of(placed.world))
            waiting += [(child, model, depth + 1, placed) for child in below.get(model.id, ())]

    def _placed(self, model: Model, parent: Model | None, above: Placed) -> Placed:
        """As both are in the bind pose, else as the file has them."""
        own = self.bind.get(model.id)
        if own is not None and parent is None:
            return above.at(own)
        if own is None or parent is None or parent.id not in self.bind:
            return above.below(model)
        return above.at(np.linalg.solve(self.bind[parent.id], own))

    def write_hands(self, motions: Sequence[HandMotion], hands: Sequence[MovingHand], path: Path) -> None:
        by_name = {model.name: model for model in self.models}
        hand_names = [name for hand in hands for name in hand.names]
        turning = [by_name[name] for name in hand_names]
        time_s = motions[0].time_s - motions[0].time_s[0]
        with (
            _opened(self.path, self.name) as file,
            tempfile.TemporaryFile(dir=path.parent) as scratch,
            path.open("wb") as stream,
        ):
            orders = [model.order for model in turning]
            curves = euler_curves(_own_turns(hands, turning), len(time_s), orders, scratch)
            animated = [
                Animated(np.int64(model.id), TURN, tuple("XYZ"), own)
                for model, own in zip(turning, curves, strict=True)
            ]
            animated += self._still(set(hand_names), by_name)
            for hand, motion in zip(hands, motions, strict=True):
                animated += channels_of(np.int64(by_name[hand.bone].id), motion)
            animation = Animation(np.int64(self.first_free), time_s, animated, notes_of(motions))
            _write(file, Records(stream, file.version), animation)

    def _still(self, turning: Collection[str], models: Mapping[str, Model]) -> Iterator[Animated]:
        """Bones between two that turn: at rest, also where the file has another pose."""
        between: dict[str, None] = {}
        for name in turning:
            above = self.rig.by_name[self.rig.by_name[name].parent or name]
            passed = []
            while above.name not in turning and above.parent is not None:
                passed.append(above.name)
                above = self.rig.by_name[above.parent]
            between |= dict.fromkeys(passed if above.name in turning else ())
        for name in between:
            model, bone = models[name], self.rig.by_name[name]
            turn = self.rig.by_name[bone.parent or name].orientation.T @ bone.orientation
            degrees = euler_degrees((model.before.T @ turn @ model.after)[None], model.order)
            still = degrees.T.astype("<f4")
            yield Animated(np.int64(model.id), TURN, tuple("XYZ"), still, ticks=np.zeros(1, np.int64))


@contextmanager
def _opened(path: Path, name: str) -> Iterator[RecordFile]:
    with path.open("rb") as stream:
        if not path.stat().st_size:
            raise BadInput(f"{name} is empty. {RIGHT}")
        with mmap(stream.fileno(), 0, access=ACCESS_READ) as content:
            yield RecordFile(content, name)


def _write(file: RecordFile, records: Records, animation: Animation) -> None:
    records.begin_file()

    def declare(one: Record) -> bool:
        if one.name != b"Model":
            return False
        rows = animation.declared(_integer(next(file.values(one))))
        if rows:
            _copy_declaring(file, one, records, rows)
        return bool(rows)

    more = {
        b"Objects": animation.write_objects,
        b"Connections": animation.write_connections,
        b"Takes": animation.write_take,
    }
    for record in file.records():
        if record.name == b"Definitions":
            _write_definitions(file, record, records, animation.counts)
        elif record.name in more:
            with file.copied(record, records, declare):
                more[record.name](records)
        else:
            file.copy(record, records)
    records.end_file(file.footer_id)


def _copy_declaring(
    file: RecordFile, model: Record, records: Records, rows: Sequence[tuple[str | Value, ...]]
) -> None:
    """A model with properties more."""

    def add(part: Record) -> bool:
        if part.name != b"Properties70":
            return False
        names = {_text(next(file.values(row), b"")) for row in file.records(part)}
        with file.copied(part, records):
            for row in rows:
                if row[0] not in names:
                    records.leaf("P", *row)
        return True

    with file.copied(model, records, add):
        pass


def _write_definitions(
    file: RecordFile, definitions: Record, records: Records, counts: Mapping[str, int]
) -> None:
    """How many objects of each kind there are, with those that are added."""
    missing = dict(counts)
    with records.record("Definitions"):
        for record in file.records(definitions):
            if record.name == b"Count":
                records.leaf("Count", _more(file, record, sum(counts.values())))
            elif record.name == b"ObjectType":
                kind = _text(next(file.values(record), b""))
                _write_kind(file, record, records, kind, missing.pop(kind, 0))
            else:
                file.copy(record, records)
        for kind, count in missing.items():
            with records.record("ObjectType", kind):
                records.leaf("Count", count)


def _write_kind(file: RecordFile, kind: Record, records: Records, name: str, added: int) -> None:
    if not added:
        file.copy(kind, records)
        return
    with records.record("ObjectType", name):
        for record in file.records(kind):
            if record.name == b"Count":
                records.leaf("Count", _more(file, record, added))
            else:
                file.copy(record, records)


def _more(file: RecordFile, count: Record, added: int) -> int:
    before = next(file.values(count), 0)
    return min((before if isinstance(before, int) else 0) + added, LARGEST_COUNT)


def _own_turns(hands: Sequence[MovingHand], models: Sequence[Model]) -> Iterator[tuple[slice, np.ndarray]]:
    """What is animated of each node's turn: without what stands before and after."""
    before, after = (np.array([getattr(model, name) for model in models]) for name in ("before", "after"))
    for parts in zip(*(hand.turns() for hand in hands), strict=True):
        turns = np.concatenate([turns for _, turns in parts], axis=1)
        yield parts[0][0], before.swapaxes(1, 2) @ turns @ after


def _require_right_handed(file: RecordFile, settings: Record) -> None:
    """Raises BadInput for axes that mirror the world."""
    settings_by_name: dict[str, Any] = {
        name: values[0] for name, values in _rows(file, settings) if values and name.startswith(AXES)
    }
    axes = np.zeros((3, 3))
    for row, name in enumerate(AXES):
        axis = settings_by_name.get(name, (0, 1, 2)[row])
        if axis not in (0, 1, 2):
            raise BadInput(f"{file.name} says {name} {axis}, and there are 0, 1 and 2. {RIGHT}")
        axes[row, int(axis)] = settings_by_name.get(f"{name}Sign", 1)
    if not np.linalg.det(axes) > 0:
        raise BadInput(f"{file.name} has left-handed axes; export the character with right-handed ones")


def _usual(file: RecordFile, definitions: Record) -> dict[str, tuple[float, ...]]:
    """Properties of nodes that do not say them."""
    for kind in file.records(definitions):
        if kind.name == b"ObjectType" and next(file.values(kind), b"") == b"Model":
            for template in file.records(kind):
                if template.name == b"PropertyTemplate":
                    return dict(_properties(file, template))
    return {}


def _properties(file: RecordFile, record: Record) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Those that say where a node is."""
    for name, values in _rows(file, record):
        wanted = 3 if name in VECTORS else 1
        if name in VECTORS or name in NUMBERS:
            numbers = tuple(float(value) for value in values if isinstance(value, int | float))
            if len(numbers) != wanted or not (np.abs(numbers) < LARGEST).all():
                raise ValueError(f"{name} is no place")
            yield name, numbers


def _rows(file: RecordFile, record: Record) -> Iterator[tuple[str, list[Any]]]:
    """Name and first values of each property; the rest of a row says what kind it is."""
    for part in file.records(record):
        if part.name == b"Properties70":
            for row in file.records(part):
                values = file.values(row)
                name = _text(next(values, b""))
                if name in VECTORS or name in NUMBERS or name.startswith(AXES):
                    yield name, list(islice(values, 3, 6))


def _bind(file: RecordFile, pose: Record) -> Iterator[tuple[int, np.ndarray]]:
    """Of a pose that is one of binding."""
    values = list(islice(file.values(pose), 3))
    if len(values) < 3 or values[2] != b"BindPose":
        return
    for one in file.records(pose):
        if one.name == b"PoseNode":
            parts = {part.name: next(file.values(part), None) for part in file.records(one)}
            matrix = parts.get(b"Matrix")
            if (
                not isinstance(matrix, np.ndarray)
                or matrix.size != 16
                or not (np.abs(matrix) < LARGEST).all()
            ):
                raise ValueError("no matrix")
            yield _integer(parts.get(b"Node")), matrix.astype(float).reshape(4, 4).T


def _connections(file: RecordFile, connections: Record, own: set[int]) -> Iterator[tuple[int, int]]:
    """Node and the node it hangs on."""
    for record in file.records(connections):
        values = list(islice(file.values(record), 3))
        if len(values) == 3 and values[0] == b"OO":
            child, parent = map(_integer, values[1:])
            if child in own and parent in own:
                yield child, parent


def _integer(value: object) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise ValueError("no number of an object")
    return value


def _text(value: object) -> str:
    if not isinstance(value, bytes):
        raise ValueError("no text")
    return value.decode(errors="replace")
