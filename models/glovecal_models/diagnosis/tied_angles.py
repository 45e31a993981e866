"""Joints whose angles tell another's: alone, as PIP and DIP do, or two together, as those of a virtual joint.

Each angle is measured with noise. What it hides of a joint's true angle the angles of such others show, so
that they improve what is told of the joint's sensor, where nothing pulls at it (errors in variables).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

EVERY, ENOUGH_TO_THIN = 4, 100
"""Of so many rows and more: neighbours say nearly the same."""
FEWEST_OF_A_CUBIC = 10
"""Through fewer a cubic goes by chance."""


def tied_angles(angles: np.ndarray, share: float) -> list[set[int]]:
    """For each column of ``angles`` (N, R), degrees: the others that are no candidates to pull at its sensor.

    Others that are a cubic of it, but for ``share`` of their deviation. And where an angle follows from two
    others together: that one for both, and for that one the more telling of both. The one that follows most
    closely is taken first, since two that it ties need not tell of each other.
    """
    if len(angles) < FEWEST_OF_A_CUBIC:
        return [set() for _ in range(angles.shape[1])]
    angles = angles[::EVERY] if len(angles) >= ENOUGH_TO_THIN else angles
    count, centred = angles.shape[1], angles - angles.mean(axis=0)
    centred /= np.maximum(np.linalg.norm(centred, axis=0), 1e-9)
    cubics = np.concatenate([np.linalg.qr(_cubic(column))[0] for column in centred.T], axis=1)  # (N, 3 R)
    across = (cubics.T @ cubics).reshape(count, 3, count, 3).swapaxes(1, 2)
    of_cubic = (cubics.T @ centred).reshape(count, 3, count)
    left = 1.0 - np.square(of_cubic).sum(axis=1)  # of the second by a cubic of the first
    tied = [set(np.flatnonzero(left[one] < share**2).tolist()) - {one} for one in range(count)]
    alone = [one for one in range(count) if not any(one in others for others in tied)]
    by_two = {one: _best_two(one, range(count), across, of_cubic) for one in alone}
    for one in sorted(alone, key=lambda one: by_two[one][0]):
        rest = [other for other in range(count) if other not in tied[one]]
        found, first, second = _best_two(one, rest, across, of_cubic)
        if found < share**2:
            tied[one].add(first)
            tied[first].add(one)
            tied[second].add(one)
    return tied


def _best_two(
    one: int, among: Sequence[int], across: np.ndarray, of_cubic: np.ndarray
) -> tuple[float, int, int]:
    """What cubics of two others leave of one angle's variance, and which: the best, and the best beside it.

    ``across`` (R, R, 3, 3): products of the cubics of each two; ``of_cubic`` (R, 3, R): of each cubic and
    each angle.
    """
    others = [other for other in among if other != one]
    if len(others) < 2:
        return 1.0, one, one
    by_one = np.square(of_cubic[others, :, one]).sum(axis=1)
    first = others.pop(int(np.argmax(by_one)))
    shared = across[others, first]
    beyond = (1.0 + 1e-9) * np.eye(3) - shared @ shared.swapaxes(1, 2)
    new = of_cubic[others, :, one] - shared @ of_cubic[first, :, one]
    gained = np.einsum("kc,kc->k", new, np.linalg.solve(beyond, new[:, :, None])[:, :, 0])
    at = int(np.argmax(gained))
    return float(1.0 - by_one.max() - gained[at]), first, others[at]


def _cubic(column: np.ndarray) -> np.ndarray:
    """(N, 3): the column, its square and its cube, of mean zero."""
    powers = np.column_stack([column, column**2, column**3])
    return powers - powers.mean(axis=0)
