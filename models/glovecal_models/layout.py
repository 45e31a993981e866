"""A glove's layout: its sensors, its rotations, and which sensors feed which rotation.

Wang & Neff 2013, section 3.3, calls the last part the sensor-rotation correspondence:

* ``1S1R``: one sensor measures one rotation by itself,
* ``MS1R``: a measuring sensor is cross-coupled with affecting sensors (Table 1),
* ``0S1R``: no sensor; a pseudo-sensor is simulated from others (DIP = 2/3 PIP),
* ``MSMR``: several sensors for a movement of several rotations (the palm arch).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from typing import Any, Literal

import numpy as np

from glovecal_models.documents import read_toml
from glovecal_models.errors import BadInput, BadLayout
from glovecal_models.expression import SensorExpression
from glovecal_models.names import check_channel_name, did_you_mean

CorrespondenceKind = Literal["1S1R", "MS1R", "0S1R", "MSMR"]
BUILT_IN = (
    "cyberglove18", "cyberglove22", "cyberglove3-18", "cyberglove3-22",
    "homunculus", "lucidglove", "opencyberglove",
)  # fmt: skip


@dataclass(frozen=True)
class Correspondence:
    """How one rotation is read: from sensors, or from a pseudo-sensor made of sensors."""

    rotation: str
    kind: CorrespondenceKind
    sensors: tuple[str, ...]
    """The sensors read; for 0S1R the sensors in the pseudo-sensor's expression."""
    simulated: SensorExpression | None = None

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the regression's input columns (one, ``~ROTATION``, for a pseudo-sensor)."""
        return (f"~{self.rotation}",) if self.simulated else self.sensors

    @property
    def measuring_sensor(self) -> str | None:
        """The sensor that is there to measure the rotation: of its name, else the only one it is read from.

        None for a pseudo-sensor, and where several sensors of other names share the rotation.
        """
        if self.simulated is None and self.rotation in self.sensors:
            return self.rotation
        return self.sensors[0] if self.simulated is None and len(self.sensors) == 1 else None

    def input_columns(self, readings: np.ndarray, sensors: Sequence[str]) -> np.ndarray:
        """Regression inputs, shape (N, D), from ``readings`` of shape (N, len(sensors)), raw counts."""
        index = [sensors.index(name) for name in self.sensors]
        columns = np.asarray(readings, dtype=float)[:, index]
        if self.simulated is None:
            return columns
        return (columns @ self.simulated.weights(self.sensors))[:, None]


@dataclass(frozen=True)
class Layout:
    """A glove's sensors and rotations. Immutable; two layouts are equal when their contents are."""

    name: str
    sensors: tuple[str, ...]
    correspondences: tuple[Correspondence, ...]
    counts: tuple[float, float] | None = None
    """Smallest and largest raw value the hardware can send, None if unknown."""
    title: str = ""
    context: tuple[str, ...] = field(default=())
    """Context channels the glove sends with each frame, such as ``supply_v``."""

    @property
    def rotations(self) -> tuple[str, ...]:
        return tuple(item.rotation for item in self.correspondences)

    def correspondence(self, rotation: str) -> Correspondence:
        for item in self.correspondences:
            if item.rotation == rotation:
                return item
        raise BadLayout(
            f"layout {self.name!r} has no rotation {rotation!r}; "
            + did_you_mean(rotation, self.rotations, there="it has")
        )

    def read_without(self, sensors: Collection[str]) -> Layout:
        """The same sensors; a rotation that none measures by itself is read from others than ``sensors``,
        where there are any."""
        return replace(self, correspondences=tuple(_without(item, sensors) for item in self.correspondences))

    @classmethod
    def from_toml(cls, text: str, *, source: str = "layout") -> Layout:
        """Parse a layout file; ``source`` names it in errors. Raises BadLayout."""
        try:
            document = read_toml(text, source)
        except BadInput as error:
            raise BadLayout(str(error)) from error
        return _from_document(document, source)

    @classmethod
    @cache
    def built_in(cls, name: str) -> Layout:
        """One of ``BUILT_IN``, read once. Raises BadLayout."""
        if name not in BUILT_IN:
            raise BadLayout(f"no built-in layout {name!r}; {did_you_mean(name, BUILT_IN)}")
        return cls.from_toml(built_in_toml(name), source=name)

    @classmethod
    def from_columns(cls, name: str, sensors: Sequence[str], rotations: Sequence[str]) -> Layout:
        """The layout assumed without a file: each rotation from the sensor of its name, else from all."""
        return _from_document({"name": name, "sensors": list(sensors), "also": list(rotations)}, name)

    def to_document(self) -> dict[str, Any]:
        """The layout as plain JSON-able data; ``Layout.from_document`` reads it back."""
        document: dict[str, Any] = {
            "name": self.name,
            "title": self.title,
            "sensors": list(self.sensors),
            "rotations": {c.rotation: list(c.sensors) for c in self.correspondences if not c.simulated},
            "simulated": {c.rotation: str(c.simulated) for c in self.correspondences if c.simulated},
            "palm": [c.rotation for c in self.correspondences if c.kind == "MSMR"],
            "context": list(self.context),
            "order": list(self.rotations),
        }
        if self.counts is not None:
            document["counts"] = list(self.counts)
        return document

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> Layout:
        """Inverse of ``to_document``. Raises BadLayout."""
        return _from_document(document, str(document.get("name", "layout")))


def _without(item: Correspondence, sensors: Collection[str]) -> Correspondence:
    left = tuple(name for name in item.sensors if name not in sensors)
    if item.measuring_sensor is not None or item.simulated is not None or not left:
        return item
    kind = item.kind if item.kind == "MSMR" or len(left) > 1 else "1S1R"
    return replace(item, sensors=left, kind=kind)


def built_in_toml(name: str) -> str:
    """The text of a built-in layout file: the best starting point for one's own."""
    return (resources.files("glovecal_models") / "layouts" / f"{name}.toml").read_text(encoding="utf-8")


MOST_NAMES = 512
"""Sensors, or rotations: twenty times those of the largest glove known."""
_KEYS = {
    "name", "title", "sensors", "rotations", "simulated", "palm", "context", "counts", "order", "also",
}  # fmt: skip


def _from_document(document: Mapping[str, Any], source: str) -> Layout:
    unknown = set(document) - _KEYS
    if unknown:
        key = sorted(unknown)[0]
        raise BadLayout(f"{source}: unknown key {key!r}; {did_you_mean(key, sorted(_KEYS))}")
    sensors = _names(document.get("sensors"), "sensors", source)
    if not sensors:
        raise BadLayout(f'{source}: no sensors; give sensors = ["NAME", ...]')
    palm = _names(document.get("palm", []), "palm", source)
    built: dict[str, Correspondence] = {}
    for rotation, feeding in _table(document, "rotations", source).items():
        names = _names(feeding, f"rotations.{rotation}", source)
        _require_known(names, sensors, f"rotation {rotation}", source)
        if not names:
            raise BadLayout(f"{source}: rotation {rotation} is read from no sensor; use [simulated] for that")
        kind: CorrespondenceKind = "MSMR" if rotation in palm else "1S1R" if len(names) == 1 else "MS1R"
        built[rotation] = Correspondence(rotation, kind, names)
    for rotation, text in _table(document, "simulated", source).items():
        if rotation in built:
            raise BadLayout(f"{source}: rotation {rotation} stands both in [rotations] and in [simulated]")
        expression = SensorExpression.parse(str(text), source=f"{source}: simulated.{rotation}")
        _require_known(expression.sensors, sensors, f"simulated rotation {rotation}", source)
        built[rotation] = Correspondence(rotation, "0S1R", expression.sensors, expression)
    also = document.get("also", [] if built else list(sensors))
    for rotation in _names(also, "also", source):
        if rotation not in built:
            names = (rotation,) if rotation in sensors else sensors
            built[rotation] = Correspondence(rotation, "1S1R" if len(names) == 1 else "MS1R", names)
    for rotation in built:
        check_channel_name(rotation, f"{source}: rotation")
    order = _names(document.get("order", list(built)), "order", source)
    if set(order) != set(built):
        raise BadLayout(f"{source}: order must list exactly the rotations {', '.join(built)}")
    return Layout(
        name=str(document.get("name", source)),
        sensors=sensors,
        correspondences=tuple(built[name] for name in order),
        counts=_counts(document.get("counts"), source),
        title=str(document.get("title", "")),
        context=_names(document.get("context", []), "context", source),
    )


def _table(document: Mapping[str, Any], key: str, source: str) -> Mapping[str, Any]:
    value = document.get(key, {})
    if not isinstance(value, Mapping):
        raise BadLayout(f"{source}: {key} must be a table, not {type(value).__name__}")
    if len(value) > MOST_NAMES:
        raise BadLayout(f"{source}: {key} are {len(value)}, at most {MOST_NAMES} are possible")
    return value


def _names(value: Any, what: str, source: str) -> tuple[str, ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(item, str) for item in value):
        raise BadLayout(f"{source}: {what} must be a list of names, not {repr(value)[:80]}")
    if len(value) > MOST_NAMES:
        raise BadLayout(f"{source}: {what} are {len(value)}, at most {MOST_NAMES} are possible")
    for name in value:
        check_channel_name(name, f"{source}: {what}")
    name, times = Counter(value).most_common(1)[0] if value else ("", 0)
    if times > 1:
        raise BadLayout(f"{source}: {what} names {name!r} more than once")
    return tuple(value)


def _require_known(names: Sequence[str], sensors: Sequence[str], what: str, source: str) -> None:
    missing = [name for name in names if name not in sensors]
    if missing:
        raise BadLayout(
            f"{source}: {what} reads sensor {missing[0]!r}, but the sensors are {', '.join(sensors)}"
        )


def _counts(value: Any, source: str) -> tuple[float, float] | None:
    if value is None:
        return None
    numbers = isinstance(value, list | tuple) and all(isinstance(v, int | float) for v in value)
    if not numbers or len(value) != 2 or not value[0] < value[1]:
        raise BadLayout(f"{source}: counts must be [smallest, largest], not {value!r}")
    return float(value[0]), float(value[1])
