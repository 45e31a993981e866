"""An effect of the user's own, declared as an expression on the command line or over REST."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.dynamics import LONGEST_GAP_S, OwnDynamics, elapsed_s, unbroken
from glovecal_models.effects.base.effect import Stream
from glovecal_models.effects.base.facts import About, Shape, ShownOver, Weights
from glovecal_models.effects.base.relaxation import relax
from glovecal_models.effects.base.signals import Settings, Signals, fit_joint_units, in_joint_units
from glovecal_models.effects.declared.declaration import Declaration
from glovecal_models.errors import BadInput
from glovecal_models.expression import Node
from glovecal_models.names import did_you_mean

# What an expression is worth in each frame, with the memory of its low passes. Values are arrays that
# broadcast to (B, L): B frames, L lanes. Where an operation has no finite result the value is NaN from
# there on, and the first such place is remembered for a message. A low pass holds still over such frames,
# so that one bad frame does not spoil those after it.


@dataclass
class Memory:
    """What low passes and previous values remember, by the place of their node; empty at a start."""

    states: dict[int, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True)
class Undefined:
    """The first operation without a result."""

    frame: int
    """Counted from the start of the block."""
    sentence: str


class Evaluation:
    """Values of the nodes of one effect over a block of B frames and L lanes.

    ``names`` holds each name's values, broadcasting to (B, L); ``elapsed_s`` is (B,).
    """

    def __init__(
        self, names: Mapping[str, np.ndarray], elapsed_s: np.ndarray, lanes: int, memory: Memory
    ) -> None:
        self._names, self._elapsed_s, self._memory = names, elapsed_s, memory
        self._shape = (len(elapsed_s), lanes)
        self.undefined: Undefined | None = None

    def value(self, node: Node) -> np.ndarray:
        """(B, L) of one column; NaN where it has no value."""
        with np.errstate(all="ignore"):
            return np.broadcast_to(self._value(node), self._shape)

    def _value(self, node: Node) -> np.ndarray:
        if node.kind == "number":
            return np.array([[node.value]])
        if node.kind == "name":
            return self._names[node.text]
        parts = [self._value(part) for part in node.parts]
        if node.kind == "lowpass":
            return self._lowpass(node, *parts)
        if node.kind == "previous":
            return self._previous(node, parts[0])
        result = _OPERATIONS[node.kind](*parts)
        finite = np.isfinite(result)
        if finite.all():
            return result
        new = ~finite
        for part in parts:
            new = new & ~np.isnan(part)
        if new.any():
            self._remember(node, parts, new)
        return np.where(finite, result, np.nan)

    def _remember(self, node: Node, parts: list[np.ndarray], new: np.ndarray) -> None:
        new = np.broadcast_to(new, self._shape)
        frame, lane = np.unravel_index(int(np.argmax(new)), self._shape)
        if self.undefined is not None and self.undefined.frame <= frame:
            return
        operands = [float(np.broadcast_to(part, self._shape)[frame, lane]) for part in parts]
        self.undefined = Undefined(int(frame), f"{_problem(node.kind, operands)} in {node.text!r}")

    def _lowpass(self, node: Node, target: np.ndarray, tau_s: np.ndarray) -> np.ndarray:
        target = np.broadcast_to(target, self._shape)
        if len(tau_s) != 1 or not (tau_s > 0).all():
            self._remember(node, [target, tau_s], np.ones(self._shape, dtype=bool))
            return np.full(self._shape, np.nan)
        tau = np.broadcast_to(tau_s[0], self._shape[1:])
        state = self._memory.states.get(node.place)
        if state is None:
            state = self._memory.states[node.place] = np.full(self._shape[1], np.nan)
        known = np.isfinite(target)
        if known.all():
            np.copyto(state, target[0], where=np.isnan(state))
            return relax(state, self._elapsed_s, target, tau)
        return self._lowpass_with_holes(state, target, known, tau)

    def _lowpass_with_holes(
        self, state: np.ndarray, target: np.ndarray, known: np.ndarray, tau: np.ndarray
    ) -> np.ndarray:
        result = np.full(self._shape, np.nan)
        for frame in range(len(target)):
            fresh = known[frame] & np.isnan(state)
            state[fresh] = target[frame, fresh]
            aim = np.where(known[frame], target[frame], state)
            after = relax(state, self._elapsed_s[frame : frame + 1], aim[None], tau)[0]
            result[frame] = np.where(known[frame], after, np.nan)
        return result

    def _previous(self, node: Node, values: np.ndarray) -> np.ndarray:
        values = np.broadcast_to(values, self._shape)
        first = self._memory.states.get(node.place)
        if first is None:
            first = values[0]
        self._memory.states[node.place] = values[-1].copy()
        return np.concatenate([first[None], values[:-1]])


def _problem(kind: str, operands: list[float]) -> str:
    if kind == "/":
        return "division by zero" if operands[1] == 0 else f"{operands[0]:g} / {operands[1]:g} is too large"
    if kind == "^":
        wrong = "is too large" if operands[0] > 0 or operands[1] > 0 else "has no value"
        wrong = "has no real value" if operands[0] < 0 and operands[1] % 1 else wrong
        return f"{operands[0]:g} ^ {operands[1]:g} {wrong}"
    if kind == "lowpass":
        return f"low pass with a time constant of {operands[1]:g} s that is not positive and fixed"
    if kind in ("log", "sqrt"):
        return f"{kind} of {operands[0]:g}"
    return f"{kind} of {', '.join(f'{value:g}' for value in operands)} is too large"


def _power(base: np.ndarray, exponent: np.ndarray) -> np.ndarray:
    return np.power(base.astype(float), exponent)


_OPERATIONS: dict[str, Callable[..., np.ndarray]] = {
    "+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide, "^": _power, "minus": np.negative,
    "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs, "tanh": np.tanh, "sin": np.sin,
    "cos": np.cos, "min": np.minimum, "max": np.maximum,
    "clip": lambda x, low, high: np.minimum(np.maximum(x, low), high),
}  # fmt: skip


LARGEST = 1e9
"""Of a column: squares of more lose the digits of everything fitted beside it."""
TOO_LARGE = (
    f"at most {LARGEST:g} can be fitted. The factor of each column is learned: write it without one,"
    " such as own instead of own*1e300"
)
SAME = 1e-9
"""Share of a column's size within which it does not change."""


class ExpressionEffect(OwnDynamics):
    """Columns as declared; the declared parameters are the shape.

    A context column is held inside its declared range, or else the range of training; an unknown value counts
    as the usual one. A frame in which a column has no value (a division by zero, say) gets zero columns; the
    stream says why. In training it is refused.
    """

    def __init__(self, declaration: Declaration) -> None:
        self.declaration = declaration
        self._signals = declaration.signals
        self._reads_own = any("own" in node.names for node in declaration.columns)
        self._reads_time = any("t" in node.names for node in declaration.columns)
        self.name, self.context = declaration.name, declaration.context
        self.about = About(
            declaration.explanation or f"Declared by the user: {declaration.columns_text}.",
            source="declared by the user",
            shown_over=_shown_over(declaration),
            neighbours=declaration.signals,
        )
        self.shape = Shape(declaration.parameters)
        self.has_memory = any(node.has_memory for node in declaration.columns)
        self.comparison = EffectComparison(declaration.control, needs_movement=self.has_memory)

    @property
    def needs_time(self) -> bool:
        return self._reads_time or self.has_memory

    @classmethod
    def parse(cls, text: str) -> ExpressionEffect:
        """From a line such as ``name = strap; columns = c.strap_n * own``. Raises BadInput."""
        return cls(Declaration.parse(text))

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> ExpressionEffect:
        """From plain JSON data; ``settings["declaration"]`` of a stored model is one. Raises BadInput."""
        return cls(Declaration.from_document(document))

    def check_sizes(self) -> None:
        """What shows before any take: raises BadInput for a factor beyond ``LARGEST``, and for a column in
        which nothing is recorded."""
        for column in self.declaration.columns:
            if not column.names:
                raise BadInput(
                    f"effect {self.name!r}: {column.text!r} is the same in every frame; write an expression"
                    " of own, of sensors or of context columns"
                )
            for node in column.walk():
                if node.kind == "number" and not node.value <= LARGEST:
                    raise BadInput(f"effect {self.name!r}: {node.text} in {column.text!r}: {TOO_LARGE}")

    def not_applicable_reason(self, takes: Sequence[Signals]) -> str | None:
        for name in self._signals:
            if not any(name in take.others for take in takes):
                known = sorted({other for take in takes for other in take.others})
                return f"no signal {name} was recorded ({did_you_mean(name, known)})"
        why = super().not_applicable_reason(takes)
        return self._constant(takes) if why is None else why

    def _constant(self, takes: Sequence[Signals]) -> str | None:
        """The first column that never changes, whatever its parameters: the calibration has a constant."""
        settings, moves = self.fit_constants(takes), np.zeros(len(self.declaration.columns), dtype=bool)
        low = high = np.zeros(len(moves))
        for shape in self.shape.grid(takes, settings):
            values = [self._evaluated(take, settings, shape)[0] for take in takes if len(take)]
            low = np.min([part.min(axis=(0, 1)) for part in values], axis=0)
            high = np.max([part.max(axis=(0, 1)) for part in values], axis=0)
            moves |= high - low > SAME * np.maximum(np.abs(low), np.abs(high))
        still = np.flatnonzero(~moves)
        if not len(still):
            return None
        text = self.declaration.columns[still[0]].text
        return f"its column {text!r} is always {low[still[0]]:g}; write one that changes with the hand"

    def fit_constants(self, takes: Sequence[Signals]) -> Settings:
        """Raises BadInput for a name that is not recorded, and for frames in which a column has no value or
        is larger than ``LARGEST``."""
        others = {name for take in takes for name in take.others}
        self.declaration.check_signals(others, {name for take in takes for name in take.context})
        ranges = {name: (low, high) for name, low, high in self.declaration.ranges}
        context = {}
        for name in self.context:
            values = np.concatenate([take.context[name] for take in takes if name in take.context])
            values = values[np.isfinite(values)]
            if not len(values):
                raise BadInput(f"effect {self.name!r}: the context column c.{name} holds no number")
            low, high = ranges.get(name, (float(values.min()), float(values.max())))
            context[name] = {
                "low": low,
                "high": high,
                "usual": float(np.median(np.clip(values, low, high))),
            }
        settings = {
            "declaration": self.declaration.to_document(),
            "context": context,
            **fit_joint_units(takes),
        }
        return settings | {"scale": self._scale(takes, settings)}

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        values = self._evaluated(take, settings, shape)[0]
        return np.where(np.isfinite(values).all(axis=2, keepdims=True), values, 0.0)

    def stream(self, settings: Settings, shape: np.ndarray) -> ExpressionStream:
        return ExpressionStream(self, settings, shape)

    def weights(self, settings: Settings) -> Weights:
        """A degree for a column of its usual size, whatever the unit it is written in."""
        names = tuple(f"weight_{self.declaration.unit}[{node.text}]" for node in self.declaration.columns)
        scale = np.array(settings.get("scale", [1.0] * len(names)))
        return Weights(names, 1.0 / np.where(scale > 0, scale, 1.0))

    def block(
        self, take: Signals, settings: Settings, shape: np.ndarray, start_s: float, elapsed: np.ndarray,
        memory: Memory,
    ) -> tuple[np.ndarray, Undefined | None]:  # fmt: skip
        """Columns (B, L, C) of an unbroken block, NaN where undefined, and the first place that is.

        ``start_s`` is when the take began; ``memory`` is changed.
        """
        lanes = take.own.shape[1]
        evaluation = Evaluation(self._names(take, settings, shape, start_s), elapsed, lanes, memory)
        values = [evaluation.value(node) for node in self.declaration.columns]
        return np.stack(values, axis=2), evaluation.undefined

    def _names(
        self, take: Signals, settings: Settings, shape: np.ndarray, start_s: float
    ) -> dict[str, np.ndarray]:
        rest = np.zeros(len(take))
        names: dict[str, np.ndarray] = {"own_deg": take.own, "t": (take.time_s - start_s)[:, None]}
        if self._reads_own:
            names["own"] = in_joint_units(take.own, settings)
        for column, item in enumerate(self.shape.parameters):
            names[item.name] = shape[None, :, column]
        for name in self._signals:
            names[name] = take.others.get(name, rest)[:, None]
        for name in self.context:
            known = settings["context"][name]
            value = take.context.get(name)
            value = (
                rest + known["usual"]
                if value is None
                else np.where(np.isfinite(value), value, known["usual"])
            )
            names[f"c.{name}"] = np.minimum(np.maximum(value, known["low"]), known["high"])[:, None]
        return names

    def _evaluated(
        self, take: Signals, settings: Settings, shape: np.ndarray
    ) -> tuple[np.ndarray, Undefined | None]:
        elapsed, blocks, first = elapsed_s(take.time_s), [], None
        for part in unbroken(take.time_s):
            piece = _piece(take, part)
            values, undefined = self.block(
                piece, settings, shape, float(take.time_s[0]), elapsed[part], Memory()
            )
            blocks.append(values)
            if undefined is not None and first is None:
                first = Undefined(part.start + undefined.frame, undefined.sentence)
        return np.concatenate(blocks), first

    def _scale(self, takes: Sequence[Signals], settings: Settings) -> list[float]:
        """The usual size (RMS) of each column over all shapes. Raises BadInput for what cannot be fitted."""
        squares, count = np.zeros(len(self.declaration.columns)), 0
        for shape in self.shape.grid(takes, settings):
            for take in takes:
                values, undefined = self._evaluated(take, settings, shape)
                if undefined is not None:
                    raise BadInput(
                        f"effect {self.name!r}: {undefined.sentence} at {_place(take, undefined.frame)};"
                        " guard it, for example with max(x, 0.001)"
                    )
                self._refuse_large(take, values)
                squares += np.sum(values**2, axis=(0, 1))
                count += values.shape[0] * values.shape[1]
        return np.sqrt(squares / max(count, 1)).tolist()

    def _refuse_large(self, take: Signals, values: np.ndarray) -> None:
        for node, column in zip(self.declaration.columns, np.moveaxis(np.abs(values), 2, 0), strict=True):
            if column.max(initial=0.0) > LARGEST:
                frame = int(column.max(axis=1).argmax())
                raise BadInput(
                    f"effect {self.name!r}: {node.text!r} reaches {column[frame].max():.3g} at"
                    f" {_place(take, frame)}; {TOO_LARGE}"
                )


def _shown_over(declaration: Declaration) -> ShownOver:
    if declaration.context:
        return "context"
    if declaration.signals:
        return "neighbour"
    reads_time = any("t" in node.names for node in declaration.columns)
    return "time in take" if reads_time else "angle"


class ExpressionStream(Stream):
    """The columns frame by frame; ``undefined`` says why the last frame had none, None when it had."""

    def __init__(self, effect: ExpressionEffect, settings: Settings, shape: np.ndarray) -> None:
        self._effect, self._settings, self._shape = effect, settings, shape
        self.reset()

    def reset(self) -> None:
        self._memory = Memory()
        self._start_s: float | None = None
        self._last_s = 0.0
        self.undefined: str | None = None

    def columns(self, frame: Signals) -> np.ndarray:
        time = float(frame.time_s[0])
        if self._start_s is None or time < self._last_s:
            # The first frame, or a clock that was set back: as little known as after a gap.
            self._memory, self._start_s, self._last_s = Memory(), time, time
        elapsed = time - self._last_s
        self._last_s = time
        if elapsed > LONGEST_GAP_S:
            self._memory, elapsed = Memory(), 0.0
        values, undefined = self._effect.block(
            frame, self._settings, self._shape, self._start_s, np.array([elapsed]), self._memory
        )
        self.undefined = None if undefined is None else undefined.sentence
        return np.where(np.isfinite(values).all(axis=2, keepdims=True), values, 0.0)


def _place(take: Signals, frame: int) -> str:
    named = f" of take {take.take}" if take.take else ""
    return f"frame {frame}{named} ({take.time_s[frame] - take.time_s[0]:.3f} s from its start)"


def _piece(take: Signals, part: slice) -> Signals:
    return Signals(
        take.time_s[part],
        take.own[part],
        {name: values[part] for name, values in take.others.items()},
        {name: values[part] for name, values in take.context.items()},
        take.wearing,
        take.take,
        take.zero_deg,
    )
