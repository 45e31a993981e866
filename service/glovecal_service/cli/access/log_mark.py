"""``glovecal log-mark``: whose mark stands in a log without names."""

from __future__ import annotations

from typing import Annotated

import typer


def log_mark(
    names: Annotated[list[str], typer.Argument(metavar="NAME...", help="Of people, gloves, recordings.")],
) -> None:
    """Print the mark that stands for a name in a log without names (GLOVECAL_LOG_NAMES=no)."""
    from glovecal_service.cli.terminal.connection import settings_of_environment
    from glovecal_service.cli.terminal.printing import out
    from glovecal_service.logs import marks

    mark = marks(settings_of_environment().data)
    for name in names:
        out.print(f"{mark(name)} {name}", markup=False, highlight=False)
