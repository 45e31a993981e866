"""Joins the studio to the web application: its pages below ``/studio``, and the live feed of each glove.

NiceGUI, because pages are written in Python beside the service, it works without a network, brings three.js,
charts and accessible widgets, and needs no build step. It has one application in a process: mount it once.
"""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import partial
from importlib.resources import files
from typing import Any

from fastapi import FastAPI, WebSocket
from nicegui import app as pages
from nicegui import ui
from starlette.concurrency import run_in_threadpool
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketDisconnect

from glovecal_client.errors import ClientError
from glovecal_service.settings import Settings
from glovecal_service.studio.live_feed import GloveFeed, LiveFeeds
from glovecal_service.studio.pages import (
    access,
    cameras,
    capture,
    compare,
    diagnose,
    effects,
    fall,
    jobs,
    live,
    models,
    start,
    take,
    takes,
)
from glovecal_service.studio.service import Service
from glovecal_service.studio.studio import Studio

_log = logging.getLogger("glovecal.studio")

PATH = "/studio"
FRAME_S = 1.0 / 30.0
RECONNECT_S = 30.0
"""A page that does not answer for so long, in a computer that sleeps or is busy, starts anew."""
PAGES = (start, live, capture, cameras, takes, take, compare, diagnose, fall, models, effects, jobs, access)


def mount_studio(app: FastAPI, settings: Settings) -> None:
    """Add the studio to ``app``, which serves REST; call it once in a process."""
    feeds = LiveFeeds(settings)
    studio = Studio(Service(app), feeds, settings.upload_limit_bytes)
    app.add_api_websocket_route(f"{PATH}/feed/{{glove}}", partial(_feed, feeds))
    pages.add_static_files("/static", str(files("glovecal_service.studio") / "static"))
    pages.add_middleware(PagePolicy)
    for page in PAGES:
        page.add(studio)
    ui.run_with(
        app, mount_path=PATH, title="Glovecal", dark=None, show_welcome_message=False, language="en-US",
        tailwind=False, reconnect_timeout=RECONNECT_S,
    )  # fmt: skip
    _close_with(app, studio)


def _close_with(app: FastAPI, studio: Studio) -> None:
    inner = app.router.lifespan_context

    @asynccontextmanager
    async def lifespan(started: FastAPI) -> AsyncIterator[Any]:
        async with inner(started) as state:
            yield state
        await studio.service.close()
        await run_in_threadpool(studio.feeds.close)

    app.router.lifespan_context = lifespan


async def _feed(feeds: LiveFeeds, socket: WebSocket, glove: str) -> None:
    """The newest pose of a glove, at most 30 a second, until the page goes."""
    await socket.accept()
    try:
        feed = await run_in_threadpool(feeds.open, glove)
    except ClientError as error:
        await socket.close(1013, str(error)[:120])
        return
    both = {asyncio.create_task(_until_gone(socket)), asyncio.create_task(_follow(feed, socket))}
    try:
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in both:
            task.cancel()
        for ended in await asyncio.gather(*both, return_exceptions=True):
            if isinstance(ended, Exception) and not isinstance(ended, WebSocketDisconnect):
                _log.warning("the feed of glove %s ended: %r", feed.glove, ended)
        await run_in_threadpool(feeds.release, feed)


async def _until_gone(socket: WebSocket) -> None:
    """A page says nothing; this ends when it goes."""
    with suppress(WebSocketDisconnect):
        while True:
            await socket.receive_text()


async def _follow(feed: GloveFeed, socket: WebSocket) -> None:
    told, shown, clock = None, None, asyncio.get_running_loop().time
    while True:
        pose = feed.pose
        if pose is not None and pose is not shown:
            names = (pose.model_sha256, len(pose.degrees), tuple(feed.sensors))
            if names != told:
                given = await run_in_threadpool(feed.names, pose)
                await socket.send_text(json.dumps(given))
                # The service may not have said yet what a new model's rotations are: then it is asked again.
                told = names if len(given["rotations"]) == len(pose.degrees) else None
            await socket.send_bytes(feed.array(pose))
            shown = pose
        # All feeds look at the same moments: the process is woken once for the gloves of all open pages.
        await asyncio.sleep(FRAME_S - clock() % FRAME_S)


# What a page of the studio may do in the browser: ask its own service only, and stand in nobody's frame.
#
# The library writes its pages with inline scripts and compiles templates, so both are allowed; nothing
# typed by
# a user reaches a page as markup.


POLICY = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; font-src 'self' data:; object-src 'none'; "
    "base-uri 'self'; form-action 'self'; frame-ancestors 'none'"
)
"""Of a page in another site's frame, clicks could be stolen."""


class PagePolicy:
    """ASGI middleware: the Content-Security-Policy of every answer."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_policy(message: Message) -> None:
            if message["type"] == "http.response.start":
                policy = (b"content-security-policy", POLICY.encode())
                message = {**message, "headers": [*message.get("headers", []), policy]}
            await send(message)

        await self.app(scope, receive, with_policy)
