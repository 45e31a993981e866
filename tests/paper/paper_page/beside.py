"""Cells with the paper's figure."""

from __future__ import annotations


def number(value: float | None, kind: str) -> str:
    """``value`` in the format ``kind``; a dash where the paper has none."""
    return "-" if value is None else f"{value:{kind}}"


def seconds(value: float | None) -> str:
    """With a unit that suits its size."""
    if value is None:
        return "-"
    if value < 1e-3:
        return f"{1e6 * value:.0f} µs"
    if value < 1:
        return f"{1e3 * value:.3g} ms"
    return f"{value:.3g} s" if value < 1000 else f"{value:.0f} s"
