"""Layouts from a file, a built-in name, or the takes' own columns."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from glovecal_models.errors import BadLayout, reason_of
from glovecal_models.layout import BUILT_IN, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import Take

LayoutLike = Layout | str | PathLike[str] | None


def read_layout(layout: str | PathLike[str]) -> Layout:
    """A built-in layout by its name (such as ``cyberglove18``, ``lucidglove``), or a TOML file.

    Raises BadInput when it is neither, or when the file is no layout.
    """
    if isinstance(layout, str) and layout in BUILT_IN:
        return Layout.built_in(layout)
    path = Path(layout)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadLayout(
            f"no layout {str(layout)!r}: there is no such file; "
            + did_you_mean(str(layout), BUILT_IN, there="built in are")
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise BadLayout(f"layout {path}: cannot be read: {reason_of(error)}") from error
    return Layout.from_toml(text, source=path.name)


def layout_for(layout: LayoutLike, takes: Sequence[Take]) -> Layout:
    """What was given; without it each measured rotation from the sensor of its name, else from all."""
    if isinstance(layout, Layout):
        return layout
    if layout is not None:
        return read_layout(layout)
    sensors = takes[0].sensors if takes else ()
    rotations = dict.fromkeys(name for take in takes for name in take.rotations)
    return Layout.from_columns("columns", sensors, list(rotations))
