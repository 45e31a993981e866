"""``glovecal backup``: all that a service keeps in one file, while it runs; tried by restoring it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from glovecal_client.private_files import keep_private
from glovecal_models.presentation.document import counted
from glovecal_service.cli.terminal.connection import settings_of_environment
from glovecal_service.cli.terminal.printing import Refusal, err, out
from glovecal_service.store.backup import Backup, check_backup, make_backup, restore_backup
from glovecal_service.store.store import Store

app = typer.Typer(help="Copies of all that is kept, made while the service runs.", no_args_is_help=True)
File = Annotated[Path, typer.Argument(help="The backup.", exists=True, dir_okay=False)]


@app.command("make")
def make(
    file: Annotated[Path, typer.Argument(help="Where it is to be, on another disk than the data folder.")],
) -> None:
    """Write all that is kept into one file, and try it by restoring it beside; the service may be running.

    It holds what the data folder holds: people's data, the site's private keys, no key of encryption.
    """
    keep_private()
    settings = settings_of_environment()
    with Store.open(settings) as store:
        made = make_backup(store, settings, file)
    _tell(made, f"Wrote {file}")


@app.command("check")
def check(file: File) -> None:
    """Restore a backup to a folder beside it, read all that is in it, and remove the folder again."""
    keep_private()
    _tell(check_backup(file), f"{file} can be restored")


@app.command("restore")
def restore(file: File) -> None:
    """Bring a backup into the empty place that GLOVECAL_DATA, GLOVECAL_DATABASE and GLOVECAL_ARTIFACTS name.

    The database it came from may have been another one: SQLite or PostgreSQL.
    """
    keep_private()
    settings = settings_of_environment()
    _tell(restore_backup(file, settings), f"Restored {file} into {settings.data}")


def _tell(backup: Backup, what: str) -> None:
    rows = (counted(backup.rows[f"{noun}s"], noun) for noun in ("subject", "take", "model", "job"))
    files = f"{counted(backup.artifacts, 'artifact')}, {counted(backup.files, 'other file')}"
    out.print(
        f"{what}: as of {backup.written_at:%Y-%m-%d %H:%M:%S} UTC, {', '.join(rows)}, {files}, "
        f"{backup.size_bytes / 1e6:.1f} MB.",
        soft_wrap=True,
    )
    for problem in backup.problems:
        err.print(problem, style="yellow", soft_wrap=True)
    if backup.problems:
        raise Refusal(f"not as it was written: {counted(len(backup.problems), 'thing')} in it")
