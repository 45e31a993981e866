"""How far the capture daemons say they are: frames that never arrived, and none came after them to tell."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from threading import Lock

import zenoh

from glovecal_client.clock import clock_ns
from glovecal_client.errors import BadName
from glovecal_client.keys import all_gloves, parse_glove_key
from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.queries import json_object
from glovecal_service.incoming.arrivals import Arrival, Arrivals
from glovecal_service.incoming.frame_gate import Place, Standing
from glovecal_service.realtime.glove_lanes import GLOVES_LIMIT

SETTLED_AFTER_NS = 500_000_000
"""Frames sent before a report are here by then, or lost."""
_REPORTS = 8


@dataclass
class _Glove:
    first: Place
    newest: deque[Place] = field(default_factory=lambda: deque(maxlen=_REPORTS))
    ended: dict[int, int] = field(default_factory=dict)
    """Frames missing after the last one that came of runs that are over, by run."""


class CaptureReports:
    """The newest ``status`` of each glove's capture daemon; may be asked by any thread."""

    def __init__(self, session: zenoh.Session, site: str) -> None:
        self._arrivals = Arrivals(session, all_gloves(site, "status"), limit=1024)
        self._lock = Lock()
        self._gloves: dict[str, _Glove] = {}

    def unheard(self, glove: str, standing: Standing | None, received: int) -> int:
        """Frames that were sent before or after those that ``standing`` knows of, and never arrived.

        ``received``: messages of the glove so far; None for ``standing``: not one valid frame among them.
        """
        with self._lock:
            for arrival in self._arrivals.drain():
                self._note(arrival)
            known = self._gloves.get(glove)
            if known is None:
                return 0
            before_ns = clock_ns() - SETTLED_AFTER_NS
            settled = next((report for report in reversed(known.newest) if report.at_ns < before_ns), None)
            if standing is None:
                return 0 if settled is None else _possible(settled.sequence, known.first, settled) - received
            missing = self._of_ended_runs(known, standing) + _before_the_first(known.first, standing)
            if settled is None:
                return missing
            return missing + max(0, _after(standing, settled) - (received - standing.messages))

    def _note(self, arrival: Arrival) -> None:
        document = json_object(arrival.payload) or {}
        try:
            glove = parse_glove_key(arrival.key)[0].glove
            sequence = document["sequence"]
            run_id, sequence = int(document["run_id"], 16), -1 if sequence is None else int(sequence)
            wall_ns = int(document.get("wall_ns") or 0)
        except (BadName, KeyError, TypeError, ValueError):
            return
        report = Place(run_id, sequence, arrival.received_ns, wall_ns)
        if glove in self._gloves or len(self._gloves) < 2 * GLOVES_LIMIT:
            self._gloves.setdefault(glove, _Glove(report)).newest.append(report)

    def _of_ended_runs(self, known: _Glove, standing: Standing) -> int:
        if (ended := standing.ended) is not None:
            for report in known.newest:
                if report.run_id == ended.run_id:
                    missing = _possible(report.sequence, ended, report)
                    known.ended[ended.run_id] = max(known.ended.get(ended.run_id, 0), missing)
        return sum(known.ended.values())


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
