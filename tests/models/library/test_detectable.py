"""``glovecal.detectable`` as a notebook uses it."""

from __future__ import annotations

import glovecal


def test_sizes_that_are_named(takes: glovecal.Takes, drawn) -> None:
    found = glovecal.detectable(takes, ["lag", "saturation"], rotations=["I_PIP"], sizes_deg=(4,), trials=1)
    assert found.named_80_deg == {"lag": 4.0, "saturation": None}
    assert set(found.not_possible) == {"saturation"}
    assert "4 degrees would have been named (1 of 1 trials)" in str(found)
    assert found.plot().get_xlabel().startswith("size of the effect")
