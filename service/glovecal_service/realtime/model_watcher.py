"""The thread that keeps every glove on the model it should have, without ever holding up a frame.

That is its wearer's newest active one that reads the glove's sensors.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Event
from typing import Any

from sqlalchemy.exc import SQLAlchemyError

from glovecal_models.calibration.artifact import load
from glovecal_models.errors import BadInput, DamagedArtifact, GlovecalError
from glovecal_models.hand.rotations import Handedness, is_of_hand, known_hand
from glovecal_models.hand.skeleton import skeleton_document
from glovecal_models.takes.take import KnownLatency
from glovecal_service.plain import reason_of
from glovecal_service.realtime.glove_lanes import GlovePipeline
from glovecal_service.realtime.lane_effects import GloveContext, WornGloves
from glovecal_service.realtime.pose_meta import GloveMetas, PoseMetas, Serving
from glovecal_service.realtime.served_model import ServedModel, ServedModels
from glovecal_service.store.changes import Changes
from glovecal_service.store.errors import (
    Conflict,
    DamagedRows,
    NotFound,
    StoreDamaged,
    StoreError,
    StoreUnavailable,
)
from glovecal_service.store.models import other_remedies
from glovecal_service.store.records import ModelRecord
from glovecal_service.store.store import Store

Prepared = Mapping[tuple[str, tuple[str, ...]], ServedModel]
"""Models in use, by id and by the order in which their gloves send the sensors."""
MOST_NAMED = 4


@dataclass(frozen=True)
class ActiveModel:
    """A subject's active model of one layout."""

    record: ModelRecord
    activation: int
    """Of two the larger one is newer."""
    sensors: tuple[str, ...] | None
    """None: nobody stored the layout."""


def choose(store: Store, glove: str, meta: Mapping[str, Any] | None, prepared: Prepared) -> Serving:
    """How ``glove`` is to be served now.

    The name of a layout does not matter, nor the order of its sensors: frames are read by the sensors' names.
    A damaged or missing artifact is named in the sentence with what to do; a model that is in use stays, else
    the one that was active before it is taken. Raises StoreError when the database does not answer.
    """
    serving = _chosen(store, glove, meta, prepared)
    if serving.subject is None:
        return serving
    subject = store.subjects.get(serving.subject)
    hand = serving.hand or subject.known_hand
    if hand is None:
        return serving
    palm = "rigid" if serving.model is None else serving.model.model.palm
    return replace(serving, hand=hand, skeleton=skeleton_document(subject.skeleton(hand, palm)))


def _chosen(store: Store, glove: str, meta: Mapping[str, Any] | None, prepared: Prepared) -> Serving:
    """As ``choose``; the hand as far as the glove or the model says it, and no skeleton."""
    try:
        record = store.gloves.with_meta(glove, meta)
    except BadInput as error:
        return Serving(sentence=str(error))
    subject, layout = record.subject, record.layout
    run_id = str((meta or {}).get("run_id") or "")
    hand = known_hand((meta or {}).get("hand"))
    serving = Serving(
        subject, layout, wearing=record.wearing, run_id=run_id, latency=record.known_latency,
        delay_ms=record.delay_ms, hand=hand,
    )  # fmt: skip
    if layout is None:
        return replace(serving, sentence=f"glove {glove} has not said yet which layout it has")
    if subject is None:
        return replace(
            serving, sentence=f"nobody wears glove {glove}; say who: glovecal glove wear {glove} SUBJECT"
        )
    try:
        models = store.models.list(subject)
    except DamagedRows as error:
        models = error.sound
    if not models:
        sentence = f"subject {subject} has no model yet; train one: glovecal train --subject {subject}"
        return replace(serving, sentence=sentence)
    sent = _sensors_sent(store, layout, meta)
    layouts = dict.fromkeys(model.layout for model in models)
    active = [found for name in layouts if (found := _active(store, subject, name, hand)) is not None]
    fitting = [item for item in active if _fits(item, layout, sent)]
    if not fitting:
        why = _other_hands_model(glove, subject, hand, models) or _why_none(
            store, serving, [each for each in models if is_of_hand(each.hand, hand)], active, sent
        )
        return replace(serving, sentence=why)
    newest = max(fitting, key=lambda item: item.activation)
    chain = _chain(store, newest.record, [item.id for item in models if is_of_hand(item.hand, hand)])
    found = _first_that_loads(store, chain, newest.record, serving, sent, prepared)
    return replace(
        found,
        hand=hand or newest.record.hand,
        sentence="; ".join(filter(None, [_other_hand(store, newest.record, glove, hand), found.sentence])),
    )


def _other_hand(store: Store, model: ModelRecord, glove: str, said: Handedness | None) -> str:
    """That the glove is of another hand than the model's wearer, a clause; "" where it is not: a model whose
    takes say their hand was chosen by it."""
    try:
        hand = store.subjects.get(model.subject).known_hand
    except NotFound:
        return ""
    if model.hand is not None or said is None or hand in (None, said):
        return ""
    return (
        f"wrong hand: {glove} is a {said} glove and {model.subject} a {hand} hand; exchange the gloves, or "
        f"say who wears this one: glovecal glove wear {glove} SUBJECT"
    )


def _other_hands_model(
    glove: str, subject: str, hand: Handedness | None, models: Sequence[ModelRecord]
) -> str:
    """That all models are of the other hand; "" where they are not."""
    if hand is None or any(is_of_hand(model.hand, hand) for model in models):
        return ""
    other = models[-1].hand
    return (
        f"wrong hand: {glove} is a {hand} glove and every model of {subject} is of the {other} hand; "
        f"exchange the gloves, or record and train this hand too: "
        f"glovecal train --subject {subject} --hand {hand}"
    )


def _sensors_sent(store: Store, layout: str, meta: Mapping[str, Any] | None) -> tuple[str, ...] | None:
    """Sensors in the order of the glove's frames; None when neither it nor its layout tells."""
    said = None if meta is None else meta.get("sensors")
    if isinstance(said, list):
        return tuple(map(str, said))
    return _sensors_of(store, layout)


def _sensors_of(store: Store, layout: str) -> tuple[str, ...] | None:
    try:
        return store.layouts.get(layout).sensors
    except NotFound:
        return None


def _active(store: Store, subject: str, layout: str, hand: Handedness | None) -> ActiveModel | None:
    record = store.models.active(subject, layout, hand)
    if record is None:
        return None
    newest = max(item.id for item in store.models.activations(subject, layout) if item.model == record.id)
    return ActiveModel(record, newest, _sensors_of(store, layout))


def _fits(item: ActiveModel, layout: str, sent: tuple[str, ...] | None) -> bool:
    """By its sensors; where they are not known, by the layout's name."""
    if sent is None or item.sensors is None:
        return item.record.layout == layout
    return not _why_not(item.record.id, item.sensors, sent)


def _chain(store: Store, active: ModelRecord, of_the_hand: Sequence[str]) -> list[str]:
    """Model ids: the active one, then what rolling back would lead to, if it is ``of_the_hand``."""
    by_id = {item.id: item for item in store.models.activations(active.subject, active.layout)}
    current, chain = by_id[max(id for id in by_id if by_id[id].model == active.id)], [active.id]
    while current.previous is not None and current.previous in by_id:
        current = by_id[current.previous]
        if current.model not in chain and current.model in of_the_hand:
            chain.append(current.model)
    return chain


def _why_none(
    store: Store,
    serving: Serving,
    models: Sequence[ModelRecord],
    active: Sequence[ActiveModel],
    sent: tuple[str, ...] | None,
) -> str:
    """Which models there are, and why none of them can be served."""
    misfits = {model.id: _why_not(model.id, _sensors_of(store, model.layout), sent) for model in models}
    usable = [model for model in models if not misfits[model.id] and sent is not None]
    said = [f"subject {serving.subject} has no active model for this glove (layout {serving.layout})"]
    if usable:
        count = "1 model exists" if len(usable) == 1 else f"{len(usable)} models exist"
        newest = usable[-1].id[:12]
        said.append(f"{count} that would fit, activate one, such as: glovecal model activate {newest}")
    reasons = [misfits[item.record.id] for item in active if misfits[item.record.id]]
    reasons = reasons or ([] if usable else [misfits[model.id] for model in models if misfits[model.id]])
    said += reasons[:MOST_NAMED]
    if len(reasons) > MOST_NAMED:
        said.append(f"and {len(reasons) - MOST_NAMED} more that do not fit")
    return "; ".join(said)


def _first_that_loads(
    store: Store,
    chain: list[str],
    active: ModelRecord,
    serving: Serving,
    sent: tuple[str, ...] | None,
    prepared: Prepared,
) -> Serving:
    problems = []
    for model_id in chain:
        model = _in_use(prepared, model_id, sent)
        try:
            if model is None:
                model = _prepare(model_id, store.artifacts.get(model_id), sent)
            else:
                store.artifacts.verify(model_id)
        except (DamagedArtifact, NotFound, BadInput) as error:
            remedies = other_remedies(active, can_roll_back=len(chain) > 1)
            if model is None:
                problems.append(f"model {model_id[:12]} cannot be served: {error}{remedies}")
                continue
            problems.append(f"model {model_id[:12]} is served as it was loaded before: {error}{remedies}")
        misfit = _why_not(model_id, model.sensors, sent)
        if misfit:
            return replace(serving, sentence="; ".join([*problems, misfit]))
        if model_id != chain[0]:
            problems.append(f"model {model_id[:12]}, active before it, is served")
        return replace(serving, model=model, sentence="; ".join(problems))
    return replace(serving, sentence="; ".join(problems))


def _in_use(prepared: Prepared, model_id: str, sent: tuple[str, ...] | None) -> ServedModel | None:
    """The model as it is served already, reading frames whose sensors come in the order of ``sent``."""
    for (known_id, sensors), model in prepared.items():
        if known_id == model_id and sent in (None, sensors):
            return model
    return None


def _prepare(model_id: str, content: bytes, sent: tuple[str, ...] | None) -> ServedModel:
    model = load(content, expected_id=model_id)
    if sent is not None and not _why_not(model_id, model.layout.sensors, sent):
        model = model.with_sensor_order(sent)
    return ServedModel.prepare(model_id, model)


def _why_not(model_id: str, needed: Sequence[str] | None, sent: Sequence[str] | None) -> str:
    """Why a model cannot read a glove, a clause; "" if it can, or if that cannot be told."""
    if needed is None or sent is None:
        return ""
    name, count = f"model {model_id[:12]}", len(sent)
    if len(set(sent)) != count:
        return f"{name} cannot read a glove that names a sensor twice: {', '.join(sent)}"
    lacking = [sensor for sensor in needed if sensor not in sent]
    if lacking:
        return f"{name} needs {_sensors(lacking)}, which this glove does not send"
    unknown = [sensor for sensor in sent if sensor not in needed]
    if unknown:
        return f"{name} does not know {_sensors(unknown)}, which this glove sends"
    return ""


def _sensors(names: Sequence[str]) -> str:
    listed = ", ".join(names[:MOST_NAMED])
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"sensor{'s' if len(names) > 1 else ''} {listed}{more}"


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
        lanes: Callable[[], list[GlovePipeline]],
        models: ServedModels,
        pose_metas: PoseMetas,
        worn: WornGloves,
        is_mine: Callable[[str], bool],
    ) -> None:
        """``is_mine``: whether this process speaks for a glove."""
        self.database_problem = ""
        """Why the store does not answer, "" while it does."""
        self._open_store = open_store
        self._store: Store | None = None
        self._metas = metas
        self._lanes = lanes
        self._models = models
        self._pose_metas = pose_metas
        self._worn = worn
        self._is_mine = is_mine
        self._revision: int | None = None
        self._gloves: set[str] = set()
        self._unnoted: set[str] = set()
        self._not_stored: dict[str, str] = {}
        """Why a glove whose frames came is not, where somebody has to know."""
        self._to_choose: set[str] = set()
        self._troubled_at: dict[str, float] = {}
        self._artifacts_at = 0.0
        self._damaged: set[str] = set()

    def run(self, stopped: Event) -> None:
        """Until ``stopped``."""
        self._metas.ask()
        while not stopped.is_set():
            self.look()
            stopped.wait(LOOK_EVERY_S if not self.database_problem else 1.0)
        if self._store is not None:
            self._store.close()

    def look(self) -> None:
        """One look; problems end up in ``database_problem`` and in the gloves' sentences."""
        lanes = self._lanes()
        changed = set(filter(self._is_mine, self._metas.news(lanes)))
        self._unnoted |= changed
        self._to_choose |= {glove for glove in changed if not self._is_camera(glove)}
        for each in lanes:
            each.declare_rate((self._metas.of(each.glove) or {}).get("rate_hz"))
        heard = {lane.glove for lane in lanes if lane.gate.run_id is not None}  # not names with junk only
        gone = [glove for glove in self._gloves - heard if self._metas.of(glove) is None]
        self._forget(gone + [glove for glove in self._gloves - heard if not self._is_mine(glove)])
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
            self._not_stored.pop(glove, None)
            self._models.forget(glove)
            self._pose_metas.forget(glove)
            self._worn.forget(glove)
            self._metas.forget(glove)

    def _opened(self) -> Store:
        if self._store is None:
            self._store = self._open_store()
        return self._store

    def _follow(self, store: Store) -> None:
        for glove in sorted(filter(self._metas.is_proven, self._unnoted)):
            self._note(store, glove)
        changes = store.changes_since(self._revision)
        self._to_choose |= self._concerned(changes)
        if changes.are_of("glove"):
            self._unnoted |= set(filter(self._is_mine, self._metas.proven() - store.gloves.names()))
        late = time.monotonic() - TRY_AGAIN_AFTER_S
        self._to_choose |= {glove for glove, at in self._troubled_at.items() if at < late}
        self._look_at_artifacts(store)
        for glove in sorted(self._to_choose):
            self._choose(store, glove)
        self._revision = changes.revision

    def _concerned(self, changes: Changes) -> set[str]:
        """Gloves that may have to be served otherwise."""
        if changes.everything:
            return set(self._gloves)
        subjects, documents = changes.names("subject"), self._pose_metas.documents()
        theirs = {name for name, document in documents.items() if document["subject"] in subjects}
        return self._gloves & (changes.names("glove") | theirs)

    def _look_at_artifacts(self, store: Store) -> None:
        """Frames do not read them, so that a damage would only be noticed at the next start."""
        if time.monotonic() < self._artifacts_at:
            return
        self._artifacts_at = time.monotonic() + TRY_AGAIN_AFTER_S
        damaged = {id for id, _ in self._models.in_use() if not store.artifacts.is_sound(id)}
        changed = damaged ^ self._damaged
        documents = self._pose_metas.documents()
        self._to_choose |= {glove for glove in self._gloves if documents[glove]["model"] in changed}
        self._damaged = damaged

    def _is_camera(self, glove: str) -> bool:
        """One says itself what its poses are."""
        return (self._metas.of(glove) or {}).get("makes_poses") is True

    def _note(self, store: Store, glove: str) -> None:
        """Store what a glove whose frames came says of itself."""
        self._unnoted.discard(glove)
        self._not_stored.pop(glove, None)
        try:
            store.gloves.seen(glove, self._metas.of(glove) or {})
        except (BadInput, Conflict, StoreDamaged) as error:
            _log.warning("glove %s is not stored: %s", glove, error)
            self._not_stored[glove] = str(error) if isinstance(error, Conflict) else ""
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
        if not_stored := self._not_stored.get(glove):
            serving = replace(serving, sentence="; ".join(filter(None, [serving.sentence, not_stored])))
        said = self._metas.of(glove)
        context = GloveContext.of(said, serving.wearing, serving.latency, serving.delay_ms)
        self._worn.put(glove, context)
        self._serve(glove, serving)
        self._gloves.add(glove)
        self._to_choose.discard(glove)

    def _keep(self, glove: str, problem: str) -> Serving:
        model = self._models.of(glove)
        known = self._pose_metas.documents().get(glove, {})
        sentence = f"the model stays: {problem}"
        wearing, run_id, late_s = known.get("wearing"), known.get("run_id", ""), known.get("glove_latency_s")
        latency = None if late_s is None else KnownLatency(late_s, known["glove_latency_sd_s"])
        return Serving(
            known.get("subject"), known.get("layout"), model, sentence, wearing, run_id, latency,
            known.get("delay_ms", 0), known_hand(known.get("hand")), known.get("skeleton"),
        )  # fmt: skip

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
