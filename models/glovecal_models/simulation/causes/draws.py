"""Random parameters of a hidden cause, drawn by name so that every use of a name gives the same value."""

from __future__ import annotations

import zlib

import numpy as np


class Draws:
    """Parameters of one cause in one glove; what was drawn is kept in ``values`` as plain numbers."""

    def __init__(self, seed: int, label: str, channels: int) -> None:
        self._key = (seed, 50, zlib.crc32(label.encode()))
        self._channels = channels
        self.values: dict[str, float | list[float]] = {}

    def one(self, name: str, low: float, high: float) -> float:
        """One number for the whole glove, uniform between ``low`` and ``high``."""
        return self._keep(name, float(self.stream(name).uniform(low, high)))

    def each(self, name: str, low: float, high: float) -> np.ndarray:
        """One number per sensor, shape (S,), uniform between ``low`` and ``high``."""
        drawn = self.stream(name).uniform(low, high, self._channels)
        self.values[name] = [round(float(value), 6) for value in drawn]
        return drawn

    def sign(self, name: str = "sign") -> float:
        """-1 or 1 for the whole glove."""
        return self._keep(name, float(self.stream(name).choice([-1.0, 1.0])))

    def signs(self, name: str = "signs") -> np.ndarray:
        """-1 or 1 for each sensor, shape (S,)."""
        drawn = self.stream(name).choice([-1.0, 1.0], self._channels)
        self.values[name] = [float(value) for value in drawn]
        return drawn

    def stream(self, name: str, key: int = 0) -> np.random.Generator:
        """A generator of its own for a name and, say, a take or wearing."""
        return np.random.default_rng([*self._key, zlib.crc32(name.encode()), key])

    def _keep(self, name: str, value: float) -> float:
        self.values[name] = round(value, 6)
        return value
