"""The thread that keeps every glove on the model it should have, without ever holding up a frame."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from threading import Event

from sqlalchemy.exc import SQLAlchemyError

from glovecal_models.errors import BadInput, GlovecalError
from glovecal_models.takes.known_latency import KnownLatency
from glovecal_service.plain import reason_of
from glovecal_service.realtime.glove_lane import GloveLane
from glovecal_service.realtime.glove_metas import GloveMetas
from glovecal_service.realtime.model_choice import choose
from glovecal_service.realtime.pose_meta import PoseMetas, Serving
from glovecal_service.realtime.served_model import ServedModels
from glovecal_service.realtime.worn_gloves import WornGlove, WornGloves
from glovecal_service.store.errors import StoreDamaged, StoreError, StoreUnavailable
from glovecal_service.store.store import Store

LOOK_EVERY_S = 0.1
TRY_AGAIN_AFTER_S = 5.0

_log = logging.getLogger("glovecal.realtime")


class ModelWatcher:
    """Looks ten times a second whether the store or a glove has news; prepares models; swaps them.

    A store that does not answer changes nothing: every glove keeps the model it has.
    """

    def __init__(
        self,
        open_store: Callable[[], Store],
        metas: GloveMetas,
        lanes: Callable[[], list[GloveLane]],
        models: ServedModels,
        pose_metas: PoseMetas,
        worn: WornGloves,
    ) -> None:
        self.database_problem = ""
        """Why the store does not answer, "" while it does."""
        self._open_store = open_store
        self._store: Store | None = None
        self._metas = metas
        self._lanes = lanes
        self._models = models
        self._pose_metas = pose_metas
        self._worn = worn
        self._revision: int | None = None
        self._gloves: set[str] = set()
        self._unnoted: set[str] = set()
        self._to_choose: set[str] = set()
        self._troubled_at: dict[str, float] = {}
        self._artifacts_at = 0.0
        self._damaged: set[str] = set()

    def run(self, stopped: Event) -> None:
        """Until ``stopped``."""
        self._unnoted |= self._metas.ask()
        while not stopped.is_set():
            self.look()
            stopped.wait(LOOK_EVERY_S if not self.database_problem else 1.0)
        if self._store is not None:
            self._store.close()

    def look(self) -> None:
        """One look; problems end up in ``database_problem`` and in the gloves' sentences."""
        lanes = self._lanes()
        self._unnoted |= self._metas.news(lanes)
        heard = {lane.glove for lane in lanes if lane.gate.run_id is not None}  # not names with junk only
        self._forget([glove for glove in self._gloves - heard if self._metas.of(glove) is None])
        self._to_choose |= heard - self._gloves
        try:
            self._follow(self._opened())
        except (StoreError, SQLAlchemyError, OSError) as error:
            if not self.database_problem:
                _log.warning("the store does not answer, models stay as they are: %s", error)
            self.database_problem = reason_of(error)
        else:
            self.database_problem = ""

    def _forget(self, gloves: list[str]) -> None:
        """Names that lost their place and of which no capture daemon knows anything."""
        for glove in gloves:
            self._gloves.discard(glove)
            self._troubled_at.pop(glove, None)
            self._models.put(glove, None)
            self._pose_metas.forget(glove)
            self._worn.forget(glove)
            self._metas.forget(glove)

    def _opened(self) -> Store:
        if self._store is None:
            self._store = self._open_store()
        return self._store

    def _follow(self, store: Store) -> None:
        for glove in sorted(self._unnoted):
            self._note(store, glove)
        revision = store.revision()
        if revision != self._revision:
            self._to_choose |= self._gloves
        late = time.monotonic() - TRY_AGAIN_AFTER_S
        self._to_choose |= {glove for glove, at in self._troubled_at.items() if at < late}
        self._look_at_artifacts(store)
        for glove in sorted(self._to_choose):
            self._choose(store, glove)
        self._revision = revision

    def _look_at_artifacts(self, store: Store) -> None:
        """Frames do not read them, so that a damage would only be noticed at the next start."""
        if time.monotonic() < self._artifacts_at:
            return
        self._artifacts_at = time.monotonic() + TRY_AGAIN_AFTER_S
        damaged = {id for id, _ in self._models.in_use() if not store.artifacts.is_sound(id)}
        if damaged != self._damaged:
            self._to_choose |= self._gloves
        self._damaged = damaged

    def _note(self, store: Store, glove: str) -> None:
        try:
            store.gloves.seen(glove, self._metas.of(glove) or {})
        except (BadInput, StoreDamaged) as error:
            _log.warning("glove %s: its meta cannot be used: %s", glove, error)
        self._unnoted.discard(glove)
        if (self._metas.of(glove) or {}).get("makes_poses") is not True:  # a camera says itself what they are
            self._to_choose.add(glove)

    def _choose(self, store: Store, glove: str) -> None:
        try:
            serving = choose(store, glove, self._metas.of(glove), self._models.in_use())
        except (StoreUnavailable, SQLAlchemyError, OSError):
            raise
        except GlovecalError as error:
            serving = self._keep(glove, str(error))
        except Exception:  # whatever is wrong with one wearer's model, the other gloves keep theirs
            _log.exception("glove %s: its model cannot be prepared", glove)
            serving = self._keep(glove, "the newer one fails here, the log of real time says where")
        self._worn.put(glove, WornGlove.of(self._metas.of(glove), serving.wearing, serving.latency))
        self._serve(glove, serving)
        self._gloves.add(glove)
        self._to_choose.discard(glove)

    def _keep(self, glove: str, problem: str) -> Serving:
        model = self._models.of(glove)
        known = self._pose_metas.documents().get(glove, {})
        sentence = f"the model stays: {problem}"
        wearing, run_id, late_s = known.get("wearing"), known.get("run_id", ""), known.get("glove_latency_s")
        latency = None if late_s is None else KnownLatency(late_s, known["glove_latency_sd_s"])
        return Serving(known.get("subject"), known.get("layout"), model, sentence, wearing, run_id, latency)

    def _serve(self, glove: str, serving: Serving) -> None:
        """Say first what the poses will mean, then let the next frame have it."""
        if serving.model is not None and serving.sentence:
            self._troubled_at[glove] = time.monotonic()
        else:
            self._troubled_at.pop(glove, None)
        earlier = self._models.of(glove)
        said = self._pose_metas.documents().get(glove, {}).get("sentence", "")
        self._pose_metas.put(glove, serving)
        self._models.put(glove, serving.model)
        if earlier is not serving.model or said != serving.sentence:
            name = "no model" if serving.model is None else f"model {serving.model.model_id[:12]}"
            _log.info("glove %s: %s. %s", glove, name, serving.sentence)
