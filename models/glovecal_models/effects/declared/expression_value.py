"""What an expression is worth in each frame, with the memory of its low passes.

Values are arrays that broadcast to (B, L): B frames, L lanes. Where an operation has no finite result the
value is NaN from there on, and the first such place is remembered for a message. A low pass holds still over
such frames, so that one bad frame does not spoil those after it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from glovecal_models.effects.base.relaxation import relax
from glovecal_models.expression import Node


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
