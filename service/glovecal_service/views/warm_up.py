"""Whether a glove is warm: its sensors need about 20 minutes (Krnoul et al. 2016, section 4)."""

from __future__ import annotations

WARM_UP_S = 1200.0
"""20 minutes, of a CyberGlove III; no figure is known of others."""


def warm_up_left_s(on_for_s: float) -> float:
    """How long to wait still; capture tells since when it hears the glove, not since when that is on."""
    return max(0.0, WARM_UP_S - on_for_s)


def warm_up_sentence(glove: str, left_s: float) -> str:
    """ "" for a warm one."""
    if left_s <= 0:
        return ""
    return (
        f"{glove} has been captured for {(WARM_UP_S - left_s) / 60:.0f} of 20 minutes: its sensors are not "
        "warm yet, and readings will drift."
    )
