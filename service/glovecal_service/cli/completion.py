"""``glovecal completion``: verbs and options that a shell completes at a press of Tab."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer.completion import (  # typer's own options would stand in every --help
    completion_init,  # pyright: ignore[reportPrivateImportUsage]
    get_completion_script,  # pyright: ignore[reportPrivateImportUsage]
)

from glovecal_service.cli.terminal.printing import Refusal, out

Shell = Literal["bash", "zsh", "fish"]
PROGRAM, VARIABLE = "glovecal", "_GLOVECAL_COMPLETE"
PLACES: dict[Shell, str] = {
    "bash": ".local/share/bash-completion/completions/glovecal",
    "zsh": ".zfunc/_glovecal",
    "fish": ".config/fish/completions/glovecal.fish",
}
"""Below the home folder: where each shell looks by itself, zsh once its fpath names it."""
AFTER: dict[Shell, str] = {
    "bash": "Open a new shell. (It needs the package bash-completion.)",
    "zsh": "Put `fpath+=~/.zfunc; autoload -Uz compinit; compinit` into ~/.zshrc, and open a new shell.",
    "fish": "Open a new shell.",
}


def prepare() -> None:
    """Typer's shells are made known to it, where one of them asks what may come next."""
    if VARIABLE in os.environ:
        completion_init()


def completion(
    shell: Annotated[
        Shell | None, typer.Argument(help="Default: the one that SHELL names.", show_default=False)
    ] = None,
    install: Annotated[
        bool, typer.Option("--install", help="Write it where the shell looks for it, else it is printed.")
    ] = False,
) -> None:
    """Let the shell complete verbs and options at a press of Tab."""
    chosen = shell or _own_shell()
    script = get_completion_script(prog_name=PROGRAM, complete_var=VARIABLE, shell=chosen)
    if not install:
        out.print(script, highlight=False, markup=False, soft_wrap=True)
        return
    path = Path.home() / PLACES[chosen]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(script + "\n", encoding="utf-8")
    except OSError as error:
        raise Refusal(f"{path} cannot be written; print the script without --install") from error
    out.print(f"Wrote {path}. {AFTER[chosen]}", soft_wrap=True)


def _own_shell() -> Shell:
    name = Path(os.environ.get("SHELL", "")).name
    for known in PLACES:
        if name == known:
            return known
    raise Refusal(f"SHELL is {name!r}, not {', '.join(PLACES)}: name one of them")
