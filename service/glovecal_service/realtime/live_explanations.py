"""What the angles of a glove's next pose are made of, as an answer to queries on ``pose/explain``.

The prediction that is served writes its terms down for one frame; a thread of its own puts them together,
ten times a second at most whatever is asked, and those who ask at once get the same frame. A query that
finds too many others waiting is refused, never queued.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from threading import Condition, Event

import zenoh

from glovecal_client.errors import BadName
from glovecal_client.keys import JSON_ENCODING, all_gloves, parse_glove_key
from glovecal_client.session import REFUSAL_ENCODING
from glovecal_models.calibration.answer import FrameExplanation, LiveExplanation
from glovecal_models.calibration.explanation import chosen_rotations
from glovecal_models.errors import BadInput
from glovecal_service.plain import json_of
from glovecal_service.realtime.frame_record import FrameRecord
from glovecal_service.realtime.glove_lanes import GlovePipeline

EVERY_S = 0.1
FRAME_WITHIN_S = 0.3
GLOVES_WAITING, QUERIES_WAITING = 16, 8
"""So many gloves that are asked about at once, and so many queries of each."""
_ROTATIONS = "rotations"

_log = logging.getLogger("glovecal.realtime")


class LiveExplanations:
    """Answers ``glovecal/<site>/<glove>/pose/explain?rotations=I_PIP,T_IP``; without names, all rotations."""

    def __init__(
        self,
        session: zenoh.Session,
        site: str,
        lanes: Callable[[], list[GlovePipeline]],
        is_mine: Callable[[str], bool],
    ) -> None:
        """``is_mine``: whether this process speaks for a glove; of others it says nothing."""
        self._lanes, self._is_mine = lanes, is_mine
        self._asked = Condition()
        self._queries: dict[str, list[zenoh.Query]] = {}
        hear = zenoh.handlers.Callback(self._hear, indirect=False)
        self._queryable = session.declare_queryable(all_gloves(site, "pose/explain"), hear)

    def run(self, stopped: Event) -> None:
        """Answer until ``stopped``."""
        while not stopped.is_set():
            with self._asked:
                if not self._queries:
                    self._asked.wait(EVERY_S)
                glove = next(iter(self._queries), None)
            if glove is None:
                continue
            began = time.monotonic()
            self._explain(glove)
            stopped.wait(max(0.0, began + EVERY_S - time.monotonic()))

    def _hear(self, query: zenoh.Query) -> None:
        """On zenoh's own thread."""
        try:
            glove = parse_glove_key(str(query.key_expr))[0].glove
        except BadName as error:
            _refuse(query, f"ask about one glove: {error}")
            return
        if not self._is_mine(glove):
            query.drop()
            return
        with self._asked:
            waiting = self._queries.get(glove)
            if waiting is None and len(self._queries) < GLOVES_WAITING:
                waiting = self._queries[glove] = []
            if waiting is not None and len(waiting) < QUERIES_WAITING:
                waiting.append(query)
                self._asked.notify()
                return
        _refuse(query, "too many ask at once; ask again in a second")

    def _explain(self, glove: str) -> None:
        record, found, problem = FrameRecord(), None, ""
        try:
            problem = self._record(glove, record)
            found = None if problem else record.explanation()
        except Exception:  # an effect may be somebody else's code; the poses must go on
            _log.exception("glove %s: its newest frame cannot be explained", glove)
            problem = f"the newest frame of glove {glove} cannot be explained; the service's log tells why"
        with self._asked:
            queries = self._queries.pop(glove, [])
        for query in queries:
            if found is None:
                _refuse(query, problem)
            else:
                _answer(query, glove, record, found)

    def _record(self, glove: str, record: FrameRecord) -> str:
        """Have the glove's next frame written down; why that cannot be, "" once it is there."""
        lane = next((lane for lane in self._lanes() if lane.glove == glove), None)
        if lane is None:
            return f"no frame of glove {glove} has arrived"
        if lane.model_id is None:
            return f"glove {glove} is uncalibrated: no angle is served that could be explained"
        lane.record = record
        is_served = record.is_served.wait(FRAME_WITHIN_S)
        lane.record = None
        if is_served:
            return ""
        return f"no frame of glove {glove} arrives: there is no new angle to explain"


def _answer(query: zenoh.Query, glove: str, record: FrameRecord, found: FrameExplanation) -> None:
    model, frame = record.model, record.frame
    assert model is not None
    assert frame is not None
    named = query.selector.parameters.get(_ROTATIONS) or ""
    try:
        rotations = chosen_rotations(model.model, [name for name in named.split(",") if name])
    except BadInput as error:
        _refuse(query, str(error))
        return
    explanation = LiveExplanation(
        **found.facts(rotations), glove=glove, model=model.model_id, run_id=f"{frame.run_id:016x}",
        sequence=frame.sequence,
    )  # fmt: skip
    document = json_of(explanation)
    with query:
        query.reply(query.key_expr, document, encoding=JSON_ENCODING)


def _refuse(query: zenoh.Query, sentence: str) -> None:
    with query:
        query.reply_err(sentence, encoding=REFUSAL_ENCODING)
