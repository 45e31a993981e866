"""The options of the capture device ``cyberglove``, read from text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

from glovecal_client.capture.cyberglove.connection import BAUD_RATES
from glovecal_client.capture.cyberglove.order import SENSORS
from glovecal_client.capture.cyberglove.rate import FASTEST_HZ, SLOWEST_HZ
from glovecal_client.capture.device import check_options
from glovecal_client.errors import BadOption

_Value = TypeVar("_Value")
OPTION_HELP = {
    "baud": f"auto|{'|'.join(map(str, BAUD_RATES))} (auto)",
    "rate": f"HZ, {SLOWEST_HZ:g} to {FASTEST_HZ:g} (100, or what the baud rate carries)",
    "layout": f"auto|{'|'.join(SENSORS)} (auto)",
    "timestamp": "on|off (off)",
}


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
        check_options("cyberglove", options, OPTION_HELP)
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
