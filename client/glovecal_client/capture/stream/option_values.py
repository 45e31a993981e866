"""Options of a device as text, read with a sentence for what cannot be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TypeVar

from glovecal_client.capture.device import check_options
from glovecal_client.errors import BadOption

Value = TypeVar("Value")
COMMON_HELP = {
    "hand": "left|right|unknown (unknown)",
    "simulated": "yes|no (no; yes where the port's name begins with emulated-)",
}
"""Options that every streamed glove has."""


class OptionValues:
    """The options given to ``device``. Raises BadOption for one that is not in ``option_help``."""

    def __init__(self, device: str, given: Mapping[str, str], option_help: Mapping[str, str]) -> None:
        check_options(device, given, option_help)
        self._device = device
        self._given = given

    def choice(self, key: str, choices: Mapping[str, Value]) -> Value:
        """What the option's text stands for; the first choice when it is not given."""
        text = self._given.get(key, next(iter(choices)))
        if text not in choices:
            raise BadOption(f"{self._device}: {key}={text!r} must be one of {', '.join(choices)}")
        return choices[text]

    def number(self, key: str, otherwise: float, low: float, high: float) -> float:
        """A number from ``low`` to ``high``."""
        text = self._given.get(key, f"{otherwise:g}")
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise BadOption(f"{self._device}: {key}={text!r} must be a number from {low:g} to {high:g}")
        return value

    def whole(self, key: str, otherwise: int, low: int, high: int) -> int:
        """A whole number from ``low`` to ``high``."""
        value = self.number(key, otherwise, low, high)
        if value != int(value):
            raise BadOption(f"{self._device}: {key}={value:g} must be a whole number from {low} to {high}")
        return int(value)

    def text(self, key: str, otherwise: str) -> str:
        """The option as it was written."""
        return self._given.get(key, otherwise)
