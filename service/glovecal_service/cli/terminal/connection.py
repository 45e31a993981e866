"""Where a verb's answers come from: the service at GLOVECAL_URL, or one inside this process."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from glovecal_client.private_files import PRIVATE_FOLDER, keep_private
from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.printing import Refusal, err, sentence_of
from glovecal_service.plain import read
from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.subject.answer import Subject

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient
    from glovecal_service.settings import Settings


def is_remote() -> bool:
    """Whether the verbs speak to a service that goes on after this command."""
    return bool(os.environ.get("GLOVECAL_URL"))


@contextmanager
def connect() -> Iterator[RestClient]:
    """A REST client. Without GLOVECAL_URL the service is mounted in this process on GLOVECAL_DATA.

    The heavy packages are imported here, so that ``glovecal --help`` answers at once. Raises Refusal for a
    data folder that cannot be used, BadInput for settings, and what opening the store raises.
    """
    url = os.environ.get("GLOVECAL_URL")
    if url:
        from glovecal_client.errors import BadName
        from glovecal_client.rest import RestClient

        try:
            client = RestClient(url, key=os.environ.get("GLOVECAL_KEY"))
        except BadName as error:
            raise BadInput(f"GLOVECAL_URL: {error}") from error
        with client, _warnings_told(client):
            yield client
        return
    from glovecal_service.rest.in_process import in_process_client

    keep_private()
    settings = settings_of_environment()
    _require_usable(settings)
    with in_process_client(settings) as client, _warnings_told(client):
        yield client


def stored_models(service: RestClient, **query: str | None) -> list[Model]:
    """``query``: subject, layout and hand, each or None."""
    return read(list[Model], service.get("/models", query))


def subject_names(service: RestClient) -> list[str]:
    """Of all there are."""
    return [row.name for row in read(list[Subject], service.get("/subjects"))]


@contextmanager
def _warnings_told(client: RestClient) -> Iterator[None]:
    """What answers warned of stands on standard error after what the verb itself prints."""
    try:
        yield
    finally:
        for sentence in client.warnings:
            err.print(sentence, style="yellow")


def settings_of_environment() -> Settings:
    """The service's settings. Raises BadInput that names the variable, its value and what is wrong."""
    from pydantic import ValidationError

    from glovecal_service.settings import Settings

    try:
        return Settings()
    except ValidationError as error:
        found = error.errors(include_url=False)[0]
        variable = "GLOVECAL_" + ".".join(map(str, found["loc"])).upper()
        problem = found["msg"].removeprefix("Value error, ").removeprefix(f"{variable}: ")
        raise BadInput(f"{variable} is {os.environ.get(variable)!r}: {problem}") from error


def _require_usable(settings: Settings) -> None:
    """The folder is made here, where its name and its variable are known."""
    try:
        settings.data.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        if not os.access(settings.data, os.W_OK | os.X_OK):
            raise PermissionError(13, os.strerror(13), str(settings.data))
    except OSError as error:
        raise Refusal(
            f"the data folder {str(settings.data)!r} cannot be used ({sentence_of(error)}); set "
            "GLOVECAL_DATA to a writable folder, or GLOVECAL_URL to a running service"
        ) from error
