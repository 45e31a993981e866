"""The pseudo-sensor of a 0S1R rotation: a weighted sum of sensors, such as ``2/3 * I_PIP``.

Wang & Neff 2013, section 3.3. Parsed by hand from a tiny grammar; nothing is evaluated:

    expression = term (("+" | "-") term)*
    term       = number ("/" number)? ("*" NAME)  |  NAME
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.errors import BadLayout

_TERM = re.compile(
    r"\s*(?:(?P<top>\d+(?:\.\d+)?)(?:\s*/\s*(?P<bottom>\d+(?:\.\d+)?))?\s*\*\s*)?(?P<name>[A-Za-z]\w*)\s*"
)


@dataclass(frozen=True)
class SensorExpression:
    """A weighted sum of sensors; ``text`` is what the user wrote."""

    text: str
    terms: tuple[tuple[str, float], ...]

    @property
    def sensors(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.terms)

    def weights(self, sensors: Sequence[str]) -> np.ndarray:
        """The weight of each of ``sensors``, shape (len(sensors),)."""
        given = dict(self.terms)
        return np.array([given.get(name, 0.0) for name in sensors])

    def __str__(self) -> str:
        return self.text

    @classmethod
    def parse(cls, text: str, *, source: str = "expression") -> SensorExpression:
        """Read ``2/3 * I_PIP`` or ``0.5 * T_TMC + 0.5 * TI_ABD``. Raises BadLayout."""
        terms: dict[str, float] = {}
        position, sign = 0, 1.0
        if len(text) > 500:
            raise BadLayout(f"{source}: an expression has at most 500 characters, this has {len(text)}")
        while True:
            match = _TERM.match(text, position)
            if not match:
                raise BadLayout(
                    f"{source}: cannot read {text[position:]!r} in {text!r}; write terms such as 2/3 * I_PIP"
                )
            bottom = float(match["bottom"] or 1)
            if bottom == 0:
                raise BadLayout(f"{source}: {text!r} divides by zero")
            weight = sign * float(match["top"] or 1) / bottom
            terms[match["name"]] = terms.get(match["name"], 0.0) + weight
            position = match.end()
            if position == len(text):
                return cls(text, tuple(terms.items()))
            if text[position] not in "+-":
                raise BadLayout(f"{source}: expected + or - at {text[position:]!r} in {text!r}")
            sign = 1.0 if text[position] == "+" else -1.0
            position += 1
