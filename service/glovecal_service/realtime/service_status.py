"""The real-time process' own account, as JSON on ``glovecal/<site>/service/<instance>/status``."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event
from typing import Any

import zenoh

from glovecal_client.clock import wall_ns
from glovecal_client.keys import JSON_ENCODING, all_services, service_alive_key
from glovecal_service.realtime.capture_reports import CaptureReports
from glovecal_service.realtime.glove_lanes import GloveLanes
from glovecal_service.realtime.pose_meta import PoseMetas

PERIOD_S = 1.0
ALIVE_FILE = "realtime.alive"
"""In the data folder, touched once a second: for those who look at files rather than at zenoh."""


def service_status_key(site: str, instance: str) -> str:
    """Beside the process' liveliness token."""
    return service_alive_key(site, instance).removesuffix("alive") + "status"


def all_service_statuses(site: str) -> str:
    """Key expression for the status of every service process of a site."""
    return all_services(site).removesuffix("alive") + "status"


class ServiceStatus:
    """Published once a second and answered to queries: every frame's fate by glove, and what is wrong."""

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        instance: str,
        gloves: GloveLanes,
        pose_metas: PoseMetas,
        problem: Callable[[], str],
        data: Path,
    ) -> None:
        self._key = service_status_key(site, instance)
        self._instance = instance
        self._gloves = gloves
        self._pose_metas = pose_metas
        self._problem = problem
        self._alive_file = data / ALIVE_FILE
        self._started_wall_ns = wall_ns()
        self._reports = CaptureReports(session, site)
        self._publisher = session.declare_publisher(self._key, encoding=JSON_ENCODING)
        self._queryable = session.declare_queryable(self._key, self._answer)
        self._be_seen()

    def run(self, stopped: Event) -> None:
        """Publish until ``stopped``."""
        while not stopped.wait(PERIOD_S):
            self._publisher.put(json.dumps(self.document()))
            self._be_seen()

    def _be_seen(self) -> None:
        with suppress(OSError):
            self._alive_file.touch()

    def document(self) -> dict[str, Any]:
        """As the wire README says; ``database`` is "" while the store answers, else why it does not."""
        metas = self._pose_metas.documents()
        unheard = self._reports.unheard
        lanes = {lane.glove: lane.status(unheard) for lane in self._gloves.all()}
        gloves = {
            glove: {
                **(lanes.get(glove) or _nothing_received(unheard(glove, None, 0))),
                **{
                    name: metas.get(glove, {}).get(name)
                    for name in ("state", "subject", "wearing", "layout", "sentence")
                },
            }
            for glove in sorted(lanes.keys() | metas.keys())
        }
        return {
            "instance": self._instance,
            "process": os.getpid(),
            "started_wall_ns": self._started_wall_ns,
            "database": self._problem(),
            "places": self._gloves.document(),
            "gloves": gloves,
        }

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            query.reply(self._key, json.dumps(self.document()), encoding=JSON_ENCODING)


def _nothing_received(missing: int) -> dict[str, Any]:
    counts = dict.fromkeys(("received", "predicted", "skipped", "waiting"), 0)
    return {"sent": missing, "missing": missing, **counts, "refused": {}, "warnings": []}
