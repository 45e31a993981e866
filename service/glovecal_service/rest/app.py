"""The REST application."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager, suppress
from importlib.metadata import version

from fastapi import FastAPI
from pydantic import BaseModel
from starlette.concurrency import run_in_threadpool

from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.camera.started_cameras import CameraAccess
from glovecal_service.filming import Filming
from glovecal_service.first_run.simulated_glove import StreamedGlove
from glovecal_service.jobs.dispatcher import Dispatcher
from glovecal_service.jobs.job_kind import JobKind
from glovecal_service.logs import Word
from glovecal_service.rest.http.access import AccessGuard
from glovecal_service.rest.http.damage_search import search_for_damage
from glovecal_service.rest.http.dependencies import Parts, Predictors
from glovecal_service.rest.http.error_handlers import AllowedMethods, install_error_handlers
from glovecal_service.rest.http.observation import PREFIX, Metrics, Observation
from glovecal_service.rest.http.problem import install_openapi
from glovecal_service.rest.http.provider import Provider
from glovecal_service.rest.http.request_guard import BodyGuard, RequestGuard, asks_who
from glovecal_service.rest.http.temporary_folder import sweep_temporary_folders
from glovecal_service.rest.http.upload_folder import UploadFolder
from glovecal_service.rest.routes import every_route, routers
from glovecal_service.settings import Settings
from glovecal_service.store.erasure import finish_erasures
from glovecal_service.store.errors import StoreError
from glovecal_service.store.retention import send_files, sweep
from glovecal_service.store.site.web_login import AllowedHosts
from glovecal_service.store.store import Store

_log = logging.getLogger("glovecal.rest")
JSON_LIMIT_BYTES = 8_000_000
"""Enough for 20,000 frames of 18 sensors to predict."""
STUDIO_UPLOAD = re.compile(r"/studio/_nicegui/client/[^/]+/upload/\d+")
MULTIPART_BYTES = 10_000
"""What a browser's form puts around the file."""
BODY_PATIENCE_S = 30.0
FIRST_SWEEP_AFTER_S, SWEEP_EVERY_S = 60.0, 3600.0
SEND_EVERY_S = 5.0


def create_app(
    settings: Settings,
    store: Store | None = None,
    *,
    body_patience_s: float = BODY_PATIENCE_S,
    of_one_command: bool = False,
) -> FastAPI:
    """The application; its lifespan opens the store (unless given) and runs the job dispatcher.

    ``of_one_command``: it lives in the process of a single command, as ``Dispatcher`` is told, nobody but who
    has the data folder reaches it, and it has no routes until ``Growing`` gives it some.

    On loopback whoever reaches the port may do everything, and ``RequestGuard`` keeps pages of other sites
    out; beyond it ``AccessGuard`` asks who it is.
    """
    metrics = Metrics()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        pin_blas_to_one_thread()
        opened = store or await run_in_threadpool(Store.open, settings)
        uploads_folder = UploadFolder(opened.files)
        await run_in_threadpool(uploads_folder.sweep)
        await run_in_threadpool(sweep_temporary_folders)
        await run_in_threadpool(finish_erasures, opened, settings)
        provider = Provider(settings) if settings.oidc_issuer else None
        app.state.parts = Parts(
            settings, opened, uploads_folder, metrics, Predictors(opened), Filming(settings.films_folder),
            CameraAccess(settings.zenoh), StreamedGlove(settings), provider,
        )  # fmt: skip
        dispatcher = Dispatcher(opened, settings, _answered, of_one_command=of_one_command)
        dispatcher.start()
        sweeping = asyncio.create_task(_sweep_hourly(opened, settings))
        searching = asyncio.create_task(search_for_damage(opened))
        sending = asyncio.create_task(_send_files(opened, settings, is_over=of_one_command))
        try:
            yield
        finally:
            sweeping.cancel()
            searching.cancel()
            sending.cancel()
            await run_in_threadpool(app.state.parts.filming.close)
            await run_in_threadpool(app.state.parts.cameras.close)
            await run_in_threadpool(app.state.parts.streamed_glove.stop)
            await run_in_threadpool(dispatcher.stop)
            if provider is not None:
                await provider.close()
            if store is None:
                opened.close()

    app = FastAPI(
        title="Glovecal",
        version=version("glovecal-service"),
        description="Joint rotations you can trust, from data gloves.",
        lifespan=lifespan,
        docs_url=None,
        redoc_url=None,
        openapi_url=f"{PREFIX}/openapi.json",
        redirect_slashes=False,
        routes=[] if of_one_command else every_route(),
    )
    app.state.allowed_methods = AllowedMethods(routers)
    install_error_handlers(app)
    install_openapi(app, every_route, _read_by_hand)
    _guard(app, settings, metrics, body_patience_s, is_asked=asks_who(settings) and not of_one_command)
    return app


def _answered() -> Mapping[str, JobKind]:
    from glovecal_service.questions.catalogue import ANSWERED  # slow to load, and most commands have no job

    return ANSWERED


def _read_by_hand() -> list[type[BaseModel]]:
    from glovecal_service.rest.glove.layouts import LayoutBody

    return [LayoutBody]


async def _sweep_hourly(store: Store, settings: Settings) -> None:
    """Not at once: most commands are over sooner."""
    await asyncio.sleep(FIRST_SWEEP_AFTER_S)
    while True:
        if swept := await run_in_threadpool(sweep, store, settings):
            _log.info("removed after %g days: %s", settings.keep_days, Word(str(swept)))
        with suppress(StoreError):  # another time
            await run_in_threadpool(finish_erasures, store, settings)
        await asyncio.sleep(SWEEP_EVERY_S)


async def _send_files(store: Store, settings: Settings, *, is_over: bool) -> None:
    """``is_over``: soon, so it is left to the service."""
    while store.files.are_shared and not is_over:
        await run_in_threadpool(send_files, store, settings)
        await asyncio.sleep(SEND_EVERY_S)


def _guard(
    app: FastAPI, settings: Settings, metrics: Metrics, body_patience_s: float, *, is_asked: bool
) -> None:
    """The last added is the outermost: every refusal below is seen, counted and given an id."""

    def limit(path: str) -> int:
        if STUDIO_UPLOAD.fullmatch(path):
            return settings.upload_limit_bytes + MULTIPART_BYTES
        return settings.upload_limit_bytes if _takes_files(path) else JSON_LIMIT_BYTES

    app.add_middleware(BodyGuard, limit=limit, patience_s=body_patience_s)
    app.add_middleware(AccessGuard, is_asked=is_asked)
    app.state.allowed_hosts = AllowedHosts(settings)
    app.add_middleware(RequestGuard, hosts=app.state.allowed_hosts)
    app.add_middleware(Observation, metrics=metrics)


def _takes_files(path: str) -> bool:
    return path in ("/v1/takes", "/v1/uploads", "/v1/models/import") or (
        path.startswith("/v1/takes/") and path.endswith("/reference")
    )
