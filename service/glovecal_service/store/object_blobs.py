"""An object store through obstore: who waits for one that hangs is told within seconds, and what was read or
written last lies in a local folder as well."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import secrets
import threading
from collections.abc import Awaitable, Callable, Hashable
from concurrent.futures import Future, wait
from contextlib import suppress
from datetime import timedelta
from pathlib import Path
from typing import Any, BinaryIO, cast

import obstore
import obstore.store

from glovecal_client.operating_system import move_over
from glovecal_client.private_files import PRIVATE_FOLDER, open_private
from glovecal_models.errors import BadInput
from glovecal_service.store.blobs import TEMPORARY, full_disk_named, write_durably
from glovecal_service.store.errors import NotFound, StorageFull, StoreUnavailable
from glovecal_service.store.server_watch import LOOK_EVERY_S, ServerWatch

log = logging.getLogger("glovecal.store")
Request = Callable[[], Awaitable[Any]]
"""Begins one; called in a loop."""
WITHIN_S, KNOWN_WITHIN_S = 120, 1.5
"""For one request of a store that answers others meanwhile: large objects over slow lines; and for whether
it has an object."""
CACHE_BYTES = 2_000_000_000
_NO_ROOM = re.compile("507 Insufficient Storage|QuotaExceeded|StorageFull|InsufficientStorage")
"""In what an object store says that has no room."""
_NOT_FOUND = (FileNotFoundError, obstore.exceptions.NotFoundError)
_NOBODY = "0" * 64
"""No artifact has this name."""


class ObjectBlobs:
    """A bucket or a prefix of one: ``s3://bucket/prefix``, credentials from the usual environment.

    What was read or written last lies in a folder here as well, and is read from there while the object store
    is away: real time that is started again has its models.
    """

    def __init__(self, url: str, cache: Path) -> None:
        """``cache``: a folder for ``CACHE_BYTES``."""
        self._cache = cache
        with full_disk_named(cache):
            cache.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        try:
            self._store, self._asked = (_opened(url, within_s) for within_s in (WITHIN_S, KNOWN_WITHIN_S))
        except (obstore.exceptions.BaseError, ValueError, TypeError) as error:
            raise BadInput(
                f"GLOVECAL_ARTIFACTS: {url!r} is not the address of an object store; write it like s3://bucket/prefix"
            ) from error
        self._url = url
        self._watch = ServerWatch(f"the object store {url}", self._answers)
        self._requests = _Requests()

    @property
    def place(self) -> str:
        return self._url

    def write(self, name: str, content: bytes) -> None:
        self._answered(lambda: obstore.put_async(self._store, name, content), writes=True)
        self._keep(name, content)

    def read(self, name: str) -> bytes | None:
        try:
            content = self._answered(lambda: _content(self._store, name))
        except _NOT_FOUND:
            return None
        except StoreUnavailable:
            with suppress(OSError):
                return (self._cache / name).read_bytes()
            raise
        self._keep(name, content)
        return content

    def _keep(self, name: str, content: bytes) -> None:
        """In the cache; a full disk does without."""
        with suppress(OSError, StorageFull):
            file = self._cache / name
            if file.exists() and file.stat().st_size == len(content):
                os.utime(file)
                return
            write_durably(file, content)
            self._make_room()

    def _make_room(self) -> None:
        """The oldest files make it."""
        files = sorted(
            (about.st_mtime, about.st_size, each)
            for each in self._cache.rglob("*")
            if each.is_file() and (about := each.stat())
        )
        excess = sum(size for _, size, _ in files) - CACHE_BYTES
        for _, size, old in files[:-1]:
            if excess <= 0:
                return
            old.unlink(missing_ok=True)
            excess -= size

    def send_file(self, name: str, file: Path) -> None:
        """As it lies there. Raises OSError, StorageFull, StoreUnavailable."""
        self._answered(lambda: obstore.put_async(self._store, name, file), writes=True)

    def cached_file(self, name: str) -> Path:
        """Where ``fetch_file`` puts it, whether or not it is there now."""
        return self._cache / name

    def fetch_file(self, name: str, check: Callable[[Path], None]) -> Path:
        """A copy in the cache, once ``check`` of it raised nothing. Raises NotFound, OSError, StorageFull,
        StoreUnavailable."""
        target = self.cached_file(name)
        unfinished = target.with_name(f"{TEMPORARY}{secrets.token_hex(8)}")
        with full_disk_named(self._cache):
            target.parent.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
            try:
                with open(unfinished, "xb", opener=open_private) as file:
                    self._answered(lambda: _receive(self._store, name, file))
                check(unfinished)
                move_over(unfinished, target)
            except _NOT_FOUND as error:
                raise NotFound(
                    f"{name} is missing from {self._url}; restore that file from a backup"
                ) from error
            finally:
                unfinished.unlink(missing_ok=True)
        with suppress(OSError):
            self._make_room()
        return target

    def exists(self, name: str) -> bool:
        return self.stamp(name) is not None

    def forget_copy(self, name: str) -> None:
        """In the cache. Raises OSError."""
        (self._cache / name).unlink(missing_ok=True)

    def remove(self, name: str) -> None:
        self.forget_copy(name)
        with suppress(*_NOT_FOUND):
            self._answered(lambda: obstore.delete_async(self._store, name), writes=True)

    def stamp(self, name: str) -> Hashable | None:
        try:
            found = self._answered(lambda: obstore.head_async(self._store, name))
        except _NOT_FOUND:
            return None
        return found["size"], found["last_modified"], found["e_tag"]

    def _answers(self) -> bool:
        """Whatever it says."""
        return not _is_away(self._requests.problem_of(lambda: obstore.head_async(self._asked, _NOBODY)))

    def _answered(self, ask: Request, *, writes: bool = False) -> Any:
        """Raises StoreUnavailable, StorageFull, and what stands for an object that is not there."""
        with self._watch.waiting():
            try:
                return self._requests.wait(ask, self._watch.require_answering)
            except _NOT_FOUND:
                raise
            except obstore.exceptions.BaseError as error:
                log.info("object store %s: %s", self._url, error)
                if _is_away(error):
                    self._watch.note_away()
                    self._watch.require_answering()
                if re.search(_NO_ROOM, str(error)):
                    raise StorageFull(
                        f"no room left in the object store {self._url}; nothing was changed: free some there"
                    ) from error
                what = "keep anything now; is it full" if writes else "answer now; is its address right"
                raise StoreUnavailable(
                    f"the object store {self._url} does not {what}, and may this service log in?"
                ) from error


class _Requests:
    """Carries requests out in a thread of its own, so that nobody has to wait for their end."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._loop: asyncio.AbstractEventLoop | None = None

    def wait(self, ask: Request, go_on: Callable[[], None]) -> Any:
        """Its answer; it is ended where ``go_on`` raises meanwhile."""
        future = self._begin(ask)
        try:
            while not wait([future], LOOK_EVERY_S).done:
                go_on()
            return future.result()
        finally:
            future.cancel()

    def problem_of(self, ask: Request) -> BaseException | None:
        return self._begin(ask).exception()

    def _begin(self, ask: Request) -> Future[Any]:
        async def answer() -> Any:
            return await ask()

        return asyncio.run_coroutine_threadsafe(answer(), self._running_loop())

    def _running_loop(self) -> asyncio.AbstractEventLoop:
        with self._lock:
            if self._loop is None:
                self._loop = asyncio.new_event_loop()
                threading.Thread(target=self._loop.run_forever, name="object store", daemon=True).start()
            return self._loop


async def _content(store: obstore.store.ObjectStore, name: str) -> bytes:
    return bytes(await (await obstore.get_async(store, name)).bytes_async())


async def _receive(store: obstore.store.ObjectStore, name: str, file: BinaryIO) -> None:
    async for part in (await obstore.get_async(store, name)).stream(min_chunk_size=1 << 20):
        file.write(part)


def _is_away(problem: BaseException | None) -> bool:
    """Whether nothing answered: obstore has no kind for it, and one of its own for most other answers."""
    return isinstance(problem, obstore.exceptions.GenericError) and "status code" not in str(problem)


def _opened(url: str, within_s: float) -> obstore.store.ObjectStore:
    """No request takes longer than that."""
    options = {"connect_timeout": "2s", "timeout": f"{within_s}s"}
    # our options stand in for those of the environment
    if os.environ.get("AWS_ALLOW_HTTP", "").lower() in ("true", "1"):
        options["allow_http"] = "true"
    return obstore.store.from_url(
        url,
        client_options=cast(Any, options),
        retry_config={"max_retries": 1, "retry_timeout": timedelta(seconds=within_s)},
    )
