"""Relaxation: x' = (target - x) / tau, solved exactly for a target that is constant between frames.

Frame by frame and in blocks the same operations are done in the same order, so that both agree to the last
bit.
"""

from __future__ import annotations

import numpy as np


def relax_once(
    state: np.ndarray, elapsed_s: float | np.ndarray, target: np.ndarray, tau_s: np.ndarray
) -> None:
    """Move ``state`` towards ``target`` in place; both and ``tau_s`` broadcast to one shape."""
    state += -np.expm1(-elapsed_s / tau_s) * (target - state)


def relax(state: np.ndarray, elapsed_s: np.ndarray, target: np.ndarray, tau_s: np.ndarray) -> np.ndarray:
    """States (B, *state.shape) after each of B frames; ``target`` is (B, ...). ``state`` becomes the last.

    ``elapsed_s`` (B,), or (B, T) for T takes side by side, which are the first axis of ``state`` then. At an
    even rate the share gone in one interval is worked out once.
    """
    if elapsed_s.shape == (1,):
        relax_once(state, elapsed_s[0], target[0], tau_s)
        return state[None].copy()
    different, which = np.unique(elapsed_s, return_inverse=True)
    extended = different.reshape(-1, *(1 for _ in state.shape[elapsed_s.ndim - 1 :]))
    shares = -np.expm1(-extended / tau_s)
    which = which.reshape(len(elapsed_s), -1)
    is_even = bool((which == which[:, :1]).all())
    gone = (shares[at] for at in (which[:, 0].tolist() if is_even else which))
    if state.size == 1:
        numbers = _relaxed_number(float(state.item()), target.ravel(), shares.ravel(), which[:, 0])
        states = np.array(numbers).reshape(len(elapsed_s), *state.shape)
        state[...] = states[-1]
        return states
    states = np.empty((len(elapsed_s), *state.shape))
    before = state
    for frame, share in enumerate(gone):
        after = states[frame, ...]
        np.subtract(target[frame], before, out=after)
        np.multiply(share, after, out=after)
        np.add(before, after, out=after)
        before = after
    state[...] = before
    return states


def _relaxed_number(before: float, target: np.ndarray, shares: np.ndarray, which: np.ndarray) -> list[float]:
    """The same of one number, in plain floats: calls of numpy cost twenty times as much."""
    each = shares.tolist()
    states = []
    for towards, at in zip(target.tolist(), which.tolist(), strict=True):
        before += each[at] * (towards - before)
        states.append(before)
    return states
