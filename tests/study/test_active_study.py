"""The study's table and sentences, from points that are known."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from active_glove import SHARES, WAYS
from active_sampling import draw, reached, table


def point(capture_s: float, error_deg: float, *, is_end: bool = False) -> dict[str, Any]:
    errors = {f"{how}_{test}_deg": error_deg for how in ("trained", "assumed") for test in ("free", "poses")}
    return {"capture_s": capture_s, "samples": round(20 * capture_s), "is_end": is_end, **errors}


def answer(*errors_deg: float) -> dict[str, Any]:
    cuts = [point(250 * share, error) for share, error in zip(SHARES, errors_deg, strict=False)]
    course = [*cuts, point(250, errors_deg[-1], is_end=True)]
    return {way: [point(250, 2.0, is_end=True)] if way == "fixed" else course for way in WAYS}


def test_it_tells_when_the_fixed_protocol_is_reached(tmp_path: Path) -> None:
    good, bad = answer(5.0, 3.0, 2.0, 1.9, 1.8), answer(5.0, 4.0, 3.0, 3.0, 3.0)
    assert reached(good, "trained_free_deg") == pytest.approx((0.6, 0.6))
    assert reached(bad, "trained_free_deg") is None
    text = table([good, bad])
    assert "| active | 150 | 3000 | 2.50 (" in text
    assert "reached on 1 of 2 gloves, with 60 % of its capture time and 60 % of its samples" in text
    assert "never reached" in table([bad])
    draw([good, bad], tmp_path / "active.png")
    assert (tmp_path / "active.png").stat().st_size > 10_000
