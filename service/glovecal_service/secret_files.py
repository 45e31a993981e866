"""Secrets that stand in files, as Docker and Kubernetes hand them over: ``NAME_FILE`` names the file whose
content ``NAME`` is. What lists a container's settings then lists no secret."""

from __future__ import annotations

import os
from pathlib import Path

from glovecal_client.private_files import OpenToOthers, read_secret
from glovecal_models.errors import BadInput, reason_of

SECRETS = (
    "GLOVECAL_DATABASE",
    "PGPASSWORD",
    "GLOVECAL_KEY",
    "AWS_ACCESS_KEY_ID",
    "AWS_SECRET_ACCESS_KEY",
    "AWS_SESSION_TOKEN",
)
"""Variables that may hold one: ours, PostgreSQL's password where the address of the database has none, and
those of an S3 store."""
FILE = "_FILE"
_LONGEST = 4096


def settle_secrets() -> None:
    """Set each of ``SECRETS`` whose file is named. Raises BadInput."""
    for name in SECRETS:
        file = os.environ.get(f"{name}{FILE}")
        if not file:
            continue
        if os.environ.get(name):
            raise BadInput(f"{name} and {name}{FILE} are both set: unset one of them")
        os.environ[name] = secret_in(Path(file), f"{name}{FILE}")
        del os.environ[f"{name}{FILE}"]


def secret_in(file: Path, variable: str) -> str:
    """The only line of ``file``, which ``variable`` names. Raises BadInput, without the secret."""
    try:
        secret = read_secret(file, _LONGEST + 1).decode("ascii", "replace").strip()
    except OpenToOthers as error:
        raise BadInput(f"{variable}: {error}") from error
    except OSError as error:
        raise BadInput(f"{variable}: the file {file} cannot be read ({reason_of(error)})") from error
    if not secret.isprintable() or not secret.isascii() or not 0 < len(secret) <= _LONGEST:
        raise BadInput(
            f"{variable}: the file {file} must hold the secret in one line of up to {_LONGEST} ASCII letters"
        )
    return secret
