"""A user's own effect on the command line: its name beside the columns, or the whole declaration."""

from __future__ import annotations

import re

import typer

_NAMED = re.compile(r"(?:^|[;\n])\s*name\s*=\s*([^;\n]*)")
_COLUMNS = re.compile(r"(?:^|[;\n])\s*columns\s*=")


def declaration_text(name: str, expression: str) -> str:
    """``strap`` and ``c.strap_n * own; unit = deg`` make a declaration; a whole one stays as it is.

    Raises typer.BadParameter when the text gives another name.
    """
    given = _NAMED.search(expression)
    if given is not None and given.group(1).strip() != name:
        raise typer.BadParameter(
            f"the effect is called {name!r}, but --expression names it {given.group(1).strip()!r}"
        )
    text = expression if _COLUMNS.search(expression) else f"columns = {expression}"
    return text if given is not None else f"name = {name}; {text}"
