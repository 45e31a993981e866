"""Options that several verbs share."""

from __future__ import annotations

from typing import Annotated

import typer

AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output and nothing else.")]
Subject = Annotated[str, typer.Option("--subject", "-s", help="The subject's short name.")]
LayoutName = Annotated[
    str | None, typer.Option("--layout", "-l", help="Layout name, or a layout file (TOML).")
]
