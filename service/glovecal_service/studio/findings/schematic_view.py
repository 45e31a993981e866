"""What an effect does to a reading, as a small picture: lines of numbers, no text."""

from __future__ import annotations

from collections.abc import Sequence

from nicegui import ui

from glovecal_service.rest.effect.answer import SchematicView

WIDTH, HEIGHT, LOOP_WIDTH = 210, 96, 96
ROOM = 6


def schematic_view(name: str, answer: SchematicView) -> None:
    """Over time, and with the effect against without."""
    time, without, with_it = answer.time_s, answer.without, answer.with_effect
    known = [value for values in (without, with_it) for value in values if value is not None]
    with ui.element("div").classes("schematic"):
        with ui.element("figure"):
            with _drawing(WIDTH, f"{answer.label} with {name} and without, over time"):
                _line(time, without, (time[0], time[-1]), known, WIDTH, "schematic-without")
                _line(time, with_it, (time[0], time[-1]), known, WIDTH, "schematic-with")
            with ui.element("figcaption"):
                ui.label(f"{answer.label} over {answer.time_label}")
        with ui.element("figure"):
            across = [value for value in without if value is not None]
            with _drawing(LOOP_WIDTH, f"{answer.label} with {name} against without"):
                span = (min(across), max(across))
                _line(without, without, span, known, LOOP_WIDTH, "schematic-without")
                _line(without, with_it, span, known, LOOP_WIDTH, "schematic-loop")
            with ui.element("figcaption"):
                ui.label("with against without")


def _drawing(width: int, label: str) -> ui.element:
    drawing = ui.element("svg").props(f'viewBox="0 0 {width} {HEIGHT}" role="img"')
    drawing.props["aria-label"] = label
    return drawing


def _line(
    across: Sequence[float | None],
    up: Sequence[float | None],
    span: tuple[float, float],
    known: Sequence[float],
    width: int,
    kind: str,
) -> None:
    low, high = min(known), max(known)
    points, pen = [], "M"
    for x, y in zip(across, up, strict=True):
        if x is None or y is None:
            pen = "M"
            continue
        right = ROOM + (width - 2 * ROOM) * (x - span[0]) / max(span[1] - span[0], 1e-9)
        down = HEIGHT - ROOM - (HEIGHT - 2 * ROOM) * (y - low) / max(high - low, 1e-9)
        points.append(f"{pen}{right:.1f} {down:.1f}")
        pen = "L"
    ui.element("path").classes(kind).props["d"] = "".join(points)
