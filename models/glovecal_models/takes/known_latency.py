"""The measured latency of a glove: how long after the hand its frames are stamped."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class KnownLatency:
    """What ``glovecal take latency`` measured."""

    seconds: float
    sd_s: float
    """Standard deviation of ``seconds``."""
