"""The options of the capture device ``cyberglove``, read from text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from glovecal_client.capture.cyberglove_connection import BAUD_RATES
from glovecal_client.capture.cyberglove_order import SENSORS
from glovecal_client.capture.cyberglove_rate import FASTEST_HZ, SLOWEST_HZ
from glovecal_client.errors import BadOption

_NAMES = ("baud", "rate", "layout", "timestamp")
_Value = TypeVar("_Value")


@dataclass(frozen=True)
class CyberGloveOptions:
    """How a CyberGlove is to be run; None leaves the choice to the glove and the wire."""

    baud: int | None = None
    rate_hz: float | None = None
    layout: str | None = None
    timestamp: bool = False

    @classmethod
    def parse(cls, options: Mapping[str, str]) -> CyberGloveOptions:
        """From ``baud=auto|115200|...``, ``rate=HZ``, ``layout=auto|cyberglove18|...``, ``timestamp=on|off``.

        Raises BadOption.
        """
        unknown = set(options) - set(_NAMES)
        if unknown:
            raise BadOption(f"cyberglove has no option {min(unknown)!r}; it has {', '.join(_NAMES)}")
        return cls(
            baud=_choice(options, "baud", {"auto": None, **{str(rate): rate for rate in BAUD_RATES}}),
            rate_hz=_rate(options["rate"]) if "rate" in options else None,
            layout=_choice(options, "layout", {"auto": None, **{name: name for name in SENSORS}}),
            timestamp=_choice(options, "timestamp", {"off": False, "on": True}),
        )


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = float("nan")
    if not SLOWEST_HZ <= rate <= FASTEST_HZ:
        raise BadOption(f"rate must be a number of Hz from {SLOWEST_HZ:g} to {FASTEST_HZ:g}, not {text!r}")
    return rate


def _choice(options: Mapping[str, str], key: str, choices: Mapping[str, _Value]) -> _Value:
    """The value an option's text stands for; the first choice when it is not given."""
    text = options.get(key, next(iter(choices)))
    if text not in choices:
        raise BadOption(f"{key} must be one of {', '.join(choices)}, not {text!r}")
    return choices[text]
