"""``glovecal encryption``: the key that files on disk are encrypted with, and what was there before it."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from glovecal_client.encryption.kept_file import open_kept
from glovecal_client.encryption.key_file import KEY_FILE, make_key_file
from glovecal_client.operating_system import move_over
from glovecal_client.private_files import keep_private, open_private
from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.connection import settings_of_environment
from glovecal_service.cli.terminal.printing import Refusal, err, out
from glovecal_service.store.encrypt_folder import encrypt_folder

app = typer.Typer(help="Recordings, videos and models encrypted on disk.", no_args_is_help=True)


@app.command("make-key")
def make_key(
    file: Annotated[Path, typer.Argument(help="Where the key is to be, outside the data folder.")],
) -> None:
    """Make the key of a data folder: a file with a random key, readable for you alone."""
    data = settings_of_environment().data
    if file.resolve().is_relative_to(data.resolve()):
        raise BadInput(
            f"{file} lies inside the data folder {data}: who takes the folder would have both. Choose a "
            "place elsewhere"
        )
    key = make_key_file(file)
    out.print(
        f"The key {key.id.hex()[:8]} is in {file}. Keep a copy apart from backups of the data folder: what "
        f"is encrypted with it is lost without it.\n"
        f"Name it from now on: export {KEY_FILE}={file.absolute()}\n"
        "Encrypt what is there already: glovecal encryption apply",
        soft_wrap=True,
    )


@app.command("apply")
def apply() -> None:
    """Encrypt what the data folder held before its key was named; the service must not be running."""
    keep_private()
    settings = settings_of_environment()
    done = encrypt_folder(settings, lambda file: err.print(str(file), soft_wrap=True))
    for problem in done.problems:
        err.print(problem, style="yellow")
    out.print(f"{done.files} files of {done.size_bytes / 1e6:.1f} MB were encrypted in {settings.data}.")
    if done.problems:
        raise Refusal(f"{len(done.problems)} stay as they were")


@app.command("read")
def read_file(
    file: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="An encrypted file.")],
    to: Annotated[Path, typer.Option("--to", help="Where its content is to be.", dir_okay=False)],
) -> None:
    """Write the content of an encrypted file to another, such as a film for a player."""
    if to.exists():
        raise Refusal(f"{to} exists already; move it away, or choose another file with --to")
    unfinished = to.with_name(f"{to.name}.unfinished")
    try:
        with open_kept(file) as content, open(unfinished, "wb", opener=open_private) as plain:
            shutil.copyfileobj(content, plain, 1 << 20)
        move_over(unfinished, to)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    out.print(f"{to}: {to.stat().st_size} bytes, no longer encrypted.")
