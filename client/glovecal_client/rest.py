"""The REST client: everything the ``glovecal`` command asks of the service, and what scripts need.

httpx does the HTTP (streamed uploads, pluggable transports: the same client speaks to an application inside
its own process). It is in the extra ``[rest]``, imported when first needed. Layout files are as a user writes
them, TOML or JSON.
"""

from __future__ import annotations

import json
import os
import re
import ssl
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl, quote, urlsplit

import numpy as np

from glovecal_client.encryption.kept_file import open_kept
from glovecal_client.errors import BadName, ClientError, ServiceError, reason_of
from glovecal_client.installation import not_installed
from glovecal_client.list_part import TOTAL, ListPart
from glovecal_client.operating_system import move_over, sync_file
from glovecal_client.private_files import open_private
from glovecal_client.site.certificates import client_context
from glovecal_client.site.login import why_refused
from glovecal_client.site.member import Member, member_of_environment

if TYPE_CHECKING:
    import httpx
    from numpy.typing import ArrayLike


FINISHED = ("done", "failed", "cancelled")
_WARNING = re.compile(r'^299 \S+ "(.*)"$', re.DOTALL)
CSV, PARQUET, ARTIFACT = "text/csv", "application/vnd.apache.parquet", "application/octet-stream"


class NoService(ServiceError):
    """Nobody answered at the service's address."""

    exit_code = 3


class Refused(ServiceError):
    """The service refused; ``problem`` is its whole problem document (RFC 9457)."""

    def __init__(self, status: int, title: str, detail: str, problem: Mapping[str, Any]) -> None:
        super().__init__(status, title, detail)
        self.problem: dict[str, Any] = dict(problem)

    def __str__(self) -> str:
        return self.detail or self.title


class RestClient:
    """A session with one service. Paths are below ``/v1``: ``client.get("/takes", {"subject": "anna"})``.

    Answers are the service's JSON as plain data. Every refusal is a ``Refused`` and no answer a
    ``NoService``, both ``ServiceError``. Not to be shared between threads. At an ``https`` address the
    service must show a certificate of the site in ``GLOVECAL_SITE_FILE``, else one this computer trusts.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8600",
        *,
        transport: httpx.BaseTransport | None = None,
        patience_s: float = 300.0,
        key: str | None = None,
    ) -> None:
        """``transport`` replaces the network; ``patience_s`` bounds the wait for one answer; ``key``: with
        which a service that asks is told who this is; by default that of the site's file.

        Raises BadName, also for a site's file that cannot be used.
        """
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.netloc:
            raise BadName(f"{url!r} is not the address of a service; write it like http://127.0.0.1:8600")
        httpx = _import_httpx()
        self._member: Member | None = member_of_environment() if parts.scheme == "https" else None
        if key is None and self._member is not None:
            key = self._member.api_key
        self.url: str = url.rstrip("/")
        self.warnings: list[str] = []
        """What answers said in ``Warning`` headers, each once: rows of a list that are damaged."""
        self._http = httpx.Client(
            base_url=f"{self.url}/v1",
            transport=transport,
            timeout=httpx.Timeout(patience_s, connect=5.0),
            verify=_trusted_certificates(parts.scheme, self._member),
            trust_env=False,
            headers={} if key is None else {"Authorization": f"Bearer {key}"},
        )

    def __enter__(self) -> RestClient:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def get(self, path: str, query: Mapping[str, Any] | None = None) -> Any:
        """What is None in ``query`` is not asked for. Lists come whole, unless ``query`` has a ``limit``."""
        response = self._asked(path, query)
        found = response.json() if response.content else None
        while "limit" not in (query or {}) and "next" in response.links:
            response = self._send("GET", path + response.links["next"]["url"])
            found += response.json()
        return found

    def part(self, path: str, query: Mapping[str, Any] | None = None) -> ListPart:
        """One part of a list: ``limit`` rows, after the place ``after`` (None: from the beginning)."""
        response = self._asked(path, query)
        total = response.headers.get(TOTAL)
        following = dict(parse_qsl(urlsplit(response.links.get("next", {}).get("url", "")).query))
        return ListPart(response.json(), following.get("after"), None if total is None else int(total))

    def post(self, path: str, body: Any = None) -> Any:
        return self._json("POST", path, json=body)

    def put(self, path: str, body: Any) -> Any:
        return self._json("PUT", path, json=body)

    def delete(self, path: str, query: Mapping[str, Any] | None = None) -> Any:
        return self._json("DELETE", path, params=query)

    def page(self, path: str, body: Any) -> str:
        """An HTML page that the service makes from what is asked."""
        return self._send("POST", path, json=body).text

    def download(self, path: str, query: Mapping[str, Any] | None = None) -> bytes:
        """The bytes of an export."""
        return self._send("GET", path, params=query).content

    def save(self, path: str, file: Path) -> None:
        """An export of any size, as ``file``: written beside it, for its owner only, and moved over it when
        whole. Raises OSError, and ServiceError where the answer broke off; then ``file`` is as it was."""
        unfinished = file.with_name(f".{file.name}.{os.getpid()}.part")
        try:
            with (
                self._told("GET", path),
                self._http.stream("GET", path) as response,
                open(unfinished, "wb", opener=open_private) as written,
            ):
                if response.status_code >= 400:
                    response.read()
                self._look_at(response)
                for part in response.iter_bytes(1 << 20):
                    written.write(part)
                written.flush()
                sync_file(written)
            move_over(unfinished, file, durably=True)
        finally:
            unfinished.unlink(missing_ok=True)

    def made(self, path: str, body: Any) -> bytes:
        """The bytes of a file that the service makes from what is asked."""
        return self._send("POST", path, json=body).content

    def add_layout(self, file: Path) -> str:
        """Store the layout in a TOML or .json file, return its name; a file without one gives its own."""
        content = file.read_bytes()
        name = layout_name(content, file)
        headers = {"Content-Type": "application/json" if is_json(file) else "application/toml"}
        return self._json("PUT", f"/gloves/{quote(name, safe='')}", content=content, headers=headers)["name"]

    def upload_takes(
        self,
        file: Path,
        *,
        subject: str,
        layout: str | None = None,
        reference: Path | None = None,
        **options: str | bool,
    ) -> dict[str, Any]:
        """Import a take table, streamed from disk, with its reference table if that is a second file.

        ``options`` are ``name``, ``wearing``, ``equal_times``, ``create_subject`` and ``replace``. The answer
        holds ``takes``, ids in ``imported``, ``existing`` and ``replaced``, ``layout``, ``subject_created``,
        and ``warnings``.
        """
        query: dict[str, str | bool] = {"subject": subject, "filename": file.name, **options}
        if layout is not None:
            query["layout"] = layout
        if reference is not None:
            query["reference_upload"] = self._send_file("POST", "/uploads", reference)["sha256"]
            query["reference_filename"] = reference.name
        return self._send_file("POST", "/takes", file, query)

    def upload(self, file: Path) -> str:
        """Keep a file of any kind with the service; the sha256 by which a later request names it."""
        return self._send_file("POST", "/uploads", file, None, ARTIFACT)["sha256"]

    def attach_reference(self, take: str, file: Path, *, clock: str = "take") -> dict[str, Any]:
        """Give a take the reference angles of a table; ``clock`` is ``take`` or ``wall`` (Unix seconds)."""
        query = {"clock": clock, "filename": file.name}
        return self._send_file("PUT", f"/takes/{quote(take, safe='')}/reference", file, query)

    def attach_camera_reference(
        self, take: str, file: Path, *, near_s: float = 0.0, within_s: float = 3.0
    ) -> dict[str, Any]:
        """Give a take what a camera measured meanwhile (a file of estimates, .npz); its clock is found within
        ``within_s`` of ``near_s``, seconds (camera time less glove time)."""
        query = {"near_s": f"{near_s:.9g}", "within_s": f"{within_s:.9g}", "filename": file.name}
        path = f"/takes/{quote(take, safe='')}/camera-reference"
        return self._send_file("PUT", path, file, query, ARTIFACT)

    def import_model(
        self, file: Path, *, subject: str | None = None, create_subject: bool = False, id: str | None = None
    ) -> dict[str, Any]:
        """Give the service a model that ``models/{id}/export`` of another one wrote. ``id``: the model's
        there, or its first digits, which the service compares; None: as the file's name ends, as exports
        are named (``-0123456789ab.safetensors``)."""
        query: dict[str, str | bool] = {"create_subject": create_subject}
        named = re.search(r"-([0-9a-f]{12,64})\.safetensors$", file.name)
        if id is not None or named is not None:
            query["id"] = str(id or (named and named[1]))
        if subject is not None:
            query["subject"] = subject
        return self._send_file("POST", "/models/import", file, query, ARTIFACT)

    def predict(
        self,
        model: str,
        readings: ArrayLike,
        *,
        sensors: Sequence[str] | None = None,
        time_s: ArrayLike | None = None,
        context: Mapping[str, ArrayLike] | None = None,
        wearing: str | None = None,
    ) -> dict[str, Any]:
        """Rotations of ``readings`` (N, S). With effects that remember, ``time_s`` (N,) is needed: one take.

        ``context`` holds columns (N,), NaN where unknown."""
        body = frames_to_predict(readings, sensors, time_s, context, wearing)
        return self.post(f"/models/{quote(model, safe='')}/predict", body)

    def wait_for_job(
        self,
        job: str,
        *,
        progress: Callable[[dict[str, Any]], None] | None = None,
        poll_s: float = 0.2,
        patience_s: float | None = None,
    ) -> dict[str, Any]:
        """The finished job; ``progress`` gets it at every look. Raises ServiceError unless it is done."""
        until = None if patience_s is None else time.monotonic() + patience_s
        while True:
            document = self.get(f"/jobs/{quote(job, safe='')}")
            if progress is not None:
                progress(document)
            if document["state"] in FINISHED:
                break
            if until is not None and time.monotonic() > until:
                raise ServiceError(408, "Job takes too long", f"job {job} is still {document['state']}")
            time.sleep(poll_s)
        if document["state"] != "done":
            raise ServiceError(409, f"Job {document['state']}", document["error"] or document["sentence"])
        return document

    def finish_recording(self, recording: str, *, patience_s: float = 30.0) -> dict[str, Any]:
        """Stop a recording; its document once it is complete or being repaired.

        Raises ServiceError when it failed or is not finished within ``patience_s``.
        """
        path, until = f"/recordings/{quote(recording, safe='')}", time.monotonic() + patience_s
        self.post(f"{path}/stop")
        while (document := self.get(path))["state"] not in ("done", "repairing"):
            if document["state"] == "failed":
                sentence = document["facts"].get("sentence", "no reason was given")
                raise ServiceError(409, "Recording failed", sentence)
            if time.monotonic() > until:
                raise ServiceError(
                    504,
                    "Recording not finished",
                    f"recording {recording} is still {document['state']}; is glovecal serve running?",
                )
            time.sleep(0.1)
        return document

    def _send_file(
        self,
        method: str,
        path: str,
        file: Path,
        query: Mapping[str, str | bool] | None = None,
        media_type: str | None = None,
    ) -> dict[str, Any]:
        """``media_type`` None: that of a table, by its name."""
        kind = media_type or (PARQUET if file.suffix.lower() == ".parquet" else CSV)
        with open_kept(file) as stream:
            return self._json(method, path, params=query, content=stream, headers={"Content-Type": kind})

    def _asked(self, path: str, query: Mapping[str, Any] | None) -> httpx.Response:
        given = {name: value for name, value in (query or {}).items() if value is not None}
        return self._send("GET", path, params=given or None)

    def _json(self, method: str, path: str, **request: Any) -> Any:
        response = self._send(method, path, **request)
        return response.json() if response.content else None

    def _send(self, method: str, path: str, **request: Any) -> httpx.Response:
        with self._told(method, path):
            response = self._http.request(method, path, **request)
        self._look_at(response)
        return response

    @contextmanager
    def _told(self, method: str, path: str) -> Iterator[None]:
        """What goes wrong on the way is a sentence."""
        httpx = _import_httpx()
        try:
            yield
        except (httpx.ConnectError, httpx.ConnectTimeout) as error:
            raise NoService(503, "No service", self._why_not_connected(error)) from error
        except httpx.TimeoutException as error:
            raise NoService(504, "No answer", f"{self.url} did not answer {method} {path} in time") from error
        except httpx.TransportError as error:
            sentence = f"the connection to {self.url} broke: {reason_of(error)}"
            raise NoService(502, "Connection broken", sentence) from error

    def _look_at(self, response: httpx.Response) -> None:
        """Raises ServiceError for a refusal; keeps what it warns of."""
        if response.status_code >= 400:
            raise _refusal(response)
        for header in response.headers.get_list("Warning"):
            sentence = _WARNING.sub(r"\1", header).replace('\\"', '"').replace("\\\\", "\\")
            if sentence not in self.warnings:
                self.warnings.append(sentence)

    def _why_not_connected(self, error: Exception) -> str:
        parts = urlsplit(self.url)
        if self._member is not None:
            why = why_refused(self._member, f"tls/{parts.netloc if parts.port else f'{parts.netloc}:443'}")
            if why is not None:
                return why
        elif "CERTIFICATE_VERIFY_FAILED" in str(error):
            return (
                f"this computer does not trust the certificate of {self.url}; name the site's file that was "
                "made for it there (glovecal site add) in GLOVECAL_SITE_FILE"
            )
        return (
            f"nobody answers at {self.url}; start it with `glovecal serve`, or unset GLOVECAL_URL to "
            "work on the local folder"
        )


def _refusal(response: httpx.Response) -> ServiceError:
    try:
        problem = response.json()
        title, detail = str(problem["title"]), str(problem["detail"])
    except (ValueError, KeyError, TypeError):
        return ServiceError(response.status_code, response.reason_phrase or "Refused", response.text[:300])
    return Refused(response.status_code, title, detail, problem)


def _trusted_certificates(scheme: str, member: Member | None) -> ssl.SSLContext | bool:
    """None over ``http``: those of this computer take longer to read than most answers."""
    if member is not None:
        return client_context(member)
    return ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT) if scheme == "http" else True


def _import_httpx() -> Any:
    try:
        import httpx
    except ModuleNotFoundError as error:
        raise ClientError(not_installed("the REST client", "httpx")) from error
    return httpx


def layout_name(content: bytes, file: Path) -> str:
    """The ``name`` in a layout file, else the file's own name; the service judges whether it can be one."""
    if sys.version_info >= (3, 11):
        import tomllib
    else:
        import tomli as tomllib

    try:
        document = json.loads(content) if is_json(file) else tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError):
        document = None
    name = document.get("name") if isinstance(document, dict) else None
    return name if isinstance(name, str) else file.stem.lower()


def is_json(file: Path) -> bool:
    return file.suffix.lower() == ".json"


def frames_to_predict(
    readings: ArrayLike,
    sensors: Sequence[str] | None,
    time_s: ArrayLike | None,
    context: Mapping[str, ArrayLike] | None,
    wearing: str | None,
) -> dict[str, Any]:
    """``readings`` (N, S) raw counts, ``time_s`` (N,), ``context`` columns (N,); what is None is left out."""
    body: dict[str, Any] = {"readings": np.asarray(readings, dtype=float).tolist()}
    if sensors is not None:
        body["sensors"] = list(sensors)
    if time_s is not None:
        body["time_s"] = np.asarray(time_s, dtype=float).tolist()
    if context is not None:
        body["context"] = {name: _or_none(column) for name, column in context.items()}
    if wearing is not None:
        body["wearing"] = wearing
    return body


def _or_none(column: ArrayLike) -> list[float | None]:
    """JSON has no NaN."""
    return [None if np.isnan(value) else value for value in np.asarray(column, dtype=float).tolist()]
