"""The real-time process: zenoh router, prediction and model choice. It needs no other process of ours."""

from __future__ import annotations

import gc
import logging
import os
import secrets
import sys
import time
from collections.abc import Callable
from functools import partial
from threading import Event, Thread

import zenoh

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import GloveKeys, all_gloves
from glovecal_client.publishers import Publishers
from glovecal_client.session import open_client
from glovecal_client.wire.pose import POSE_ENCODING
from glovecal_models.worker_processes import pin_blas_to_one_thread
from glovecal_service.incoming.arrivals import Arrivals
from glovecal_service.incoming.glove_owners import GloveOwners
from glovecal_service.logs import Word
from glovecal_service.operating_system import go_first
from glovecal_service.plain import reason_of
from glovecal_service.realtime.lane_effects import WornGloves
from glovecal_service.realtime.live_explanations import LiveExplanations
from glovecal_service.realtime.model_watcher import ModelWatcher
from glovecal_service.realtime.pose_loop import PoseLoop
from glovecal_service.realtime.pose_meta import GloveMetas, PoseMetas
from glovecal_service.realtime.served_model import ServedModels
from glovecal_service.realtime.service_status import ServiceStatus
from glovecal_service.settings import Settings
from glovecal_service.store.site.router import SiteRouter, service_router
from glovecal_service.store.store import Store

GIL_SWITCH_S = 0.0005
"""Longest time another thread of this process keeps a frame waiting (Python's default is ten times that)."""

LINKED_WITHIN_S = 1.0
LOOKS_EVERY_S = 1.0
LOOKS_IN_VAIN = 10
"""The loop of poses makes a turn ten times a second, also without frames. One that makes none while others
of its process run, however often it is looked at, does not come back."""

_log = logging.getLogger("glovecal.realtime")


class RealTimeFailed(Exception):
    """A thread of the real-time process died; the process must be started again."""


def run_real_time(settings: Settings, stopped: Event, started: Callable[[], None] | None = None) -> None:
    """Serve until ``stopped``. Raises zenoh.ZError if the endpoint cannot be used, RealTimeFailed."""
    pin_blas_to_one_thread()
    sys.setswitchinterval(GIL_SWITCH_S)
    go_first()
    with service_router(settings) as (session, router):
        _wait_for_links(session, settings, stopped)
        _serve(session, settings, stopped, started, router)


def _wait_for_links(session: zenoh.Session, settings: Settings, stopped: Event) -> None:
    """A moment for the other routers that are there: or this process would take their gloves first and give
    them back when it hears of them."""
    until = time.monotonic() + LINKED_WITHIN_S
    while settings.linked_routers and time.monotonic() < until and not stopped.wait(0.02):
        if len(list(session.info.routers_zid())) >= len(settings.linked_routers):
            return


def run_more_real_time(settings: Settings, stopped: Event, started: Callable[[], None] | None = None) -> None:
    """Serve a share of the gloves beside ``run_real_time``, at its router. Raises as it does."""
    pin_blas_to_one_thread()
    sys.setswitchinterval(GIL_SWITCH_S)
    go_first()
    try:
        with open_client([settings.zenoh], cancelled=stopped.is_set) as session:
            _serve(session, settings, stopped, started, None)
    except NoAnswer:
        if not stopped.is_set():
            raise


def _serve(
    session: zenoh.Session,
    settings: Settings,
    stopped: Event,
    started: Callable[[], None] | None,
    router: SiteRouter | None,
) -> None:
    instance = f"realtime-{secrets.token_hex(4)}"
    owners = GloveOwners(session, settings.site, instance)
    models = ServedModels()
    arrivals = Arrivals(session, all_gloves(settings.site, "raw"))
    worn = WornGloves()
    loop = PoseLoop(arrivals, models, PosePublishers(session, settings.site).publish, worn, owners=owners)
    pose_metas = PoseMetas(session, settings.site)
    publishers = Publishers(session, all_gloves(settings.site, "alive"))
    metas = GloveMetas(session, settings.site, publishers)
    watcher = ModelWatcher(
        lambda: Store.open(settings),
        metas,
        lambda: loop.lanes,
        models,
        pose_metas,
        worn,
        owners.is_mine,
    )
    status = ServiceStatus(
        session,
        settings.site,
        instance,
        loop.gloves,
        pose_metas,
        metas,
        publishers,
        lambda: watcher.database_problem,
        settings.data,
        owners.is_mine,
    )
    explanations = LiveExplanations(session, settings.site, lambda: loop.lanes, owners.is_mine)
    rules = [] if router is None else [("site rules", router.follow)]
    _settle_garbage()
    owners.announce()
    failures: list[str] = []
    threads = [
        _thread(name, work, stopped, failures)
        for name, work in (
            ("poses", loop.run),
            ("models", watcher.run),
            ("status", status.run),
            ("explanations", explanations.run),
            ("watch", partial(end_if_it_stands_still, loop)),
            *rules,
        )
    ]
    if started is not None:
        started()
    stopped.wait()
    owners.close()
    for thread in threads:
        thread.join(5.0)
    arrivals.close()
    if failures:
        raise RealTimeFailed("; ".join(failures))


def end_if_it_stands_still(loop: PoseLoop, stopped: Event) -> None:
    """End the process, which is started anew, where no frame becomes a pose any more. Looks are counted, not
    seconds: a process that was suspended has lost those too. Nothing is put away first: that may hang, too.
    """
    turns, in_vain = loop.turns, 0
    while not stopped.wait(LOOKS_EVERY_S):
        in_vain = in_vain + 1 if loop.turns == turns else 0
        turns = loop.turns
        if in_vain >= LOOKS_IN_VAIN:
            _log.error(
                "the loop of poses has stood still for %.0f s: this process ends", in_vain * LOOKS_EVERY_S
            )
            os._exit(1)


def _thread(name: str, work: Callable[[Event], None], stopped: Event, failures: list[str]) -> Thread:
    """A thread whose death ends the process: a service that looks alive but serves nothing is worse."""

    def guarded() -> None:
        try:
            work(stopped)
        except Exception as error:
            if not stopped.is_set():
                _log.exception("the thread %s died", Word(name))
                failures.append(f"the thread {name} died: {reason_of(error)}")
        finally:
            stopped.set()

    thread = Thread(target=guarded, name=name, daemon=True)
    thread.start()
    return thread


def _settle_garbage() -> None:
    """What is there now stays: never look through it again, and collect only when the pose loop says so.

    The path of a frame makes no reference cycles, so nothing piles up between the collections.
    """
    gc.collect()
    gc.freeze()
    gc.disable()


# One zenoh publisher for each glove's poses.


class PosePublishers:
    """Declared when a glove's first pose goes out. For one publishing thread.

    Not express: poses of one turn then leave in few packets, at half the cost (13 in place of 25 to 36 us).
    """

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._session = session
        self._site = site
        self._publishers: dict[str, zenoh.Publisher] = {}

    def publish(self, glove: str, pose: bytes) -> None:
        """Send an encoded pose; drops it rather than wait for a slow subscriber."""
        publisher = self._publishers.get(glove)
        if publisher is None:
            publisher = self._publishers[glove] = self._session.declare_publisher(
                GloveKeys(self._site, glove).pose,
                encoding=POSE_ENCODING,
                congestion_control=zenoh.CongestionControl.DROP,
                priority=zenoh.Priority.INTERACTIVE_HIGH,
            )
        publisher.put(pose)
