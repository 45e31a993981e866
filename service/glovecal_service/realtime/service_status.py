"""The real-time process' own account, as JSON on ``glovecal/<site>/service/<instance>/status``.

The capture daemons say how far they are: that tells of frames that never arrived, with none after them.
"""

from __future__ import annotations

import json
import os
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Lock
from typing import Any

import zenoh

from glovecal_client.clock import clock_ns, wall_ns
from glovecal_client.keys import JSON_ENCODING, all_services, service_alive_key
from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.publishers import Publishers
from glovecal_service.incoming.documents import Document, Documents
from glovecal_service.incoming.frame_gate import Place, Standing
from glovecal_service.realtime.glove_lanes import GLOVES_LIMIT, GlovePipelines
from glovecal_service.realtime.pose_meta import GloveMetas, PoseMetas

SETTLED_AFTER_NS = 500_000_000
"""Frames sent before a report are here by then, or lost."""
_REPORTS = 8
_RUNS = 4


@dataclass
class _Glove:
    first: Place
    of_runs: dict[int, deque[Place]] = field(default_factory=dict)
    """The newest reports of each run, at most ``_RUNS``."""
    streaming: set[int] = field(default_factory=set)
    """Runs whose frames came: reports on others make room."""
    ended: dict[int, int] = field(default_factory=dict)
    """Frames missing after the last one that came of runs that are over, by run."""

    def note(self, report: Place) -> None:
        if report.run_id not in self.of_runs and len(self.of_runs) >= _RUNS:
            del self.of_runs[next(run for run in self.of_runs if run not in self.streaming)]
        self.of_runs.setdefault(report.run_id, deque(maxlen=_REPORTS)).append(report)

    def newest_of_all(self, before_ns: int, standing: Standing | None) -> Place | None:
        """The newest report from before ``before_ns`` that can be the glove's."""
        reports = [
            each
            for run in self.of_runs.values()
            for each in run
            if each.at_ns < before_ns and _is_of(each, standing)
        ]
        return max(reports, key=lambda each: each.at_ns, default=None)


class CaptureReports:
    """The newest ``status`` of each glove's capture daemon; may be asked by any thread.

    A status without a liveliness token behind it is nobody's; one of another run than that whose frames come
    is not the glove's.
    """

    def __init__(self, session: zenoh.Session, site: str, publishers: Publishers) -> None:
        self._documents = Documents(session, site, "status")
        self._publishers = publishers
        self._lock = Lock()
        self._gloves: dict[str, _Glove] = {}

    def unheard(self, glove: str, standing: Standing | None, received: int) -> int:
        """Frames that were sent before or after those that ``standing`` knows of, and never arrived.

        ``received``: messages of the glove so far; None for ``standing``: not one valid frame among them.
        """
        with self._lock:
            self._take_in()
            known = self._gloves.get(glove)
            if known is None:
                return 0
            before_ns = clock_ns() - SETTLED_AFTER_NS
            if standing is not None:
                ended = {standing.ended.run_id} if standing.ended is not None else set()
                known.streaming = {standing.newest.run_id} | ended
            settled = known.newest_of_all(before_ns, standing)
            if standing is None:
                return 0 if settled is None else _possible(settled.sequence, known.first, settled) - received
            missing = self._of_ended_runs(known, standing) + _before_the_first(known.first, standing)
            if settled is None:
                return missing
            return missing + max(0, _after(standing, settled) - (received - standing.messages))

    def gloves(self) -> set[str]:
        """Of which a status is believed."""
        with self._lock:
            self._take_in()
            return set(self._gloves)

    def _take_in(self) -> None:
        for document in self._documents.take(self._publishers.has):
            self._note(document)

    def _note(self, reported: Document) -> None:
        glove, document = reported.glove, reported.content
        try:
            sequence = document["sequence"]
            run_id, sequence = int(document["run_id"], 16), -1 if sequence is None else int(sequence)
            wall_ns = int(document.get("wall_ns") or 0)
        except (KeyError, TypeError, ValueError, OverflowError):
            return
        report = Place(run_id, sequence, reported.received_ns, wall_ns)
        if glove in self._gloves or len(self._gloves) < 2 * GLOVES_LIMIT:
            self._gloves.setdefault(glove, _Glove(report)).note(report)

    def _of_ended_runs(self, known: _Glove, standing: Standing) -> int:
        if (ended := standing.ended) is not None:
            for report in known.of_runs.get(ended.run_id, ()):
                missing = _possible(report.sequence, ended, report)
                known.ended[ended.run_id] = max(known.ended.get(ended.run_id, 0), missing)
        return sum(known.ended.values())


def _is_of(report: Place, standing: Standing | None) -> bool:
    """Of the run whose frames come, of the one before it, or said after the newest frame."""
    if standing is None or report.run_id == standing.newest.run_id or report.at_ns > standing.newest.at_ns:
        return True
    return standing.ended is not None and report.run_id == standing.ended.run_id


def _possible(sequence: int, since: Place, report: Place) -> int:
    """Frames from ``since`` to ``sequence``; 0 where no glove can have sent so many until ``report``.

    By the capture computer's clock: reports that waited for this process arrive at once.
    """
    missing = max(0, sequence - since.sequence)
    if since.wall_ns and report.wall_ns:
        return missing if PlausibleLoss(since.wall_ns).allows(missing, report.wall_ns) else 0
    return missing if PlausibleLoss(since.at_ns).allows(missing, report.at_ns) else 0


def _before_the_first(first: Place, standing: Standing) -> int:
    """Of the first run: between the first report on it and the first frame that came."""
    began = standing.began
    if first.run_id != began.run_id or first.at_ns > began.at_ns:
        return 0
    return _possible(began.sequence - 1, first, began)


def _after(standing: Standing, settled: Place) -> int:
    """Between the newest frame that came and what was reported; of a new run, all its frames."""
    newest = standing.newest
    if settled.run_id == newest.run_id:
        return _possible(settled.sequence, newest, settled)
    ended = standing.ended is not None and standing.ended.run_id == settled.run_id
    if ended or settled.at_ns < newest.at_ns:
        return 0
    return _possible(settled.sequence, newest._replace(sequence=-1), settled)


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
        gloves: GlovePipelines,
        pose_metas: PoseMetas,
        metas: GloveMetas,
        publishers: Publishers,
        problem: Callable[[], str],
        data: Path,
        is_mine: Callable[[str], bool],
    ) -> None:
        """``is_mine``: whether this process speaks for a glove."""
        self._key = service_status_key(site, instance)
        self._instance = instance
        self._gloves = gloves
        self._pose_metas = pose_metas
        self._metas = metas
        self._problem, self._is_mine = problem, is_mine
        self._alive_file = data / ALIVE_FILE
        self._started_wall_ns = wall_ns()
        self._reports = CaptureReports(session, site, publishers)
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
        for glove, status in lanes.items():
            status["warnings"] = [*self._metas.warnings(glove), *status["warnings"]]
        gloves = {
            glove: {
                **(lanes.get(glove) or _nothing_received(unheard(glove, None, 0))),
                **{
                    name: metas.get(glove, {}).get(name)
                    for name in ("state", "subject", "wearing", "layout", "sentence")
                },
            }
            for glove in sorted(
                lanes.keys() | set(filter(self._is_mine, metas.keys() | self._reports.gloves()))
            )
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
