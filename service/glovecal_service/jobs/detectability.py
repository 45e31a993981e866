"""Job kind ``detectability``: takes (and a model) in; out how large effects must be to be named in them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from glovecal_models.calibration.artifact import load
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue, effect, effect_of_declaration
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.progress import Report
from glovecal_models.takes.take import Take
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.model_work import takes_of, text_in
from glovecal_service.jobs.task_key import task_key
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, TakeRecord
from glovecal_service.views.detectability import (
    ConfusabilityView,
    DetectabilityControlView,
    DetectabilityResult,
    EffectDetectabilityView,
)

MOST_DIAGNOSES = 5000
VERSION = 1
"""Of the trials: results of another one are not used again."""


@dataclass(frozen=True)
class SessionWork:
    """The takes, and what the model says of them."""

    takes: tuple[Take, ...]
    take_hashes: tuple[str, ...]
    layout: Layout
    declarations: tuple[dict[str, Any], ...]
    """Effects of the user's own."""
    model: str | None
    artifact: bytes = b""


@dataclass(frozen=True)
class DetectabilityWork:
    """One task: how alike effects are; or trials of one size of one effect (None: nothing is put in)."""

    session: SessionWork
    part: Literal["confusability", "control", "size"]
    effect: str | None = None
    rotations: tuple[str, ...] | None = None
    size_deg: float = 0.0
    trials: int = 0
    seed: int = 0


class DetectabilityJob:
    """Payload: ``subject``, ``layout``, ``model`` (or None), ``takes`` (ids), ``effects`` (names, None for
    all), ``declarations``, ``rotations`` (each by itself; None: all at once), ``sizes_deg``, ``trials``,
    ``seed``.

    Result: ``DetectabilityResult``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), NotTrainable, BadInput, DamagedArtifact."""
        payload = job.payload
        session, records = _session(store, payload)
        trials, seed = int(payload.get("trials", 3)), int(payload.get("seed", 0))
        sizes = sorted({float(size) for size in payload["sizes_deg"]})
        whole = DetectabilityWork(session, "confusability", trials=trials, seed=seed)
        works = [whole, replace(whole, part="control")]
        rotations = payload.get("rotations")
        places = [None] if rotations is None else [(name,) for name in rotations]
        targets = [(name, where) for name in _names(payload, session) for where in places]
        works += [
            replace(whole, part="size", effect=name, rotations=where, size_deg=size)
            for name, where in targets
            for size in sizes
        ]
        if len(works) * trials > MOST_DIAGNOSES:
            raise BadInput(
                f"{len(works) * trials} diagnoses are too many; name fewer effects, rotations or sizes"
            )

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            return _result(store, payload, records, targets, sizes, trials, results)

        return JobPlan(
            tasks=[Task(_key(work), _label(work), run, work, _effort(work)) for work in works],
            step=lambda number, results: Step(f"{_label(works[number])}: done"),
            finish=finish,
        )


def run(work: DetectabilityWork, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """In a worker. Raises BadInput, Cancelled."""
    from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession  # heavy
    from glovecal_models.diagnosis.model_on_takes import ModelOnTakes

    session = work.session
    own = [effect_of_declaration(item) for item in session.declarations]
    if session.model is None:
        on = ModelOnTakes(session.takes, session.layout, own=tuple(own))
    else:
        on = ModelOnTakes.of(load(session.artifact, expected_id=session.model), session.takes, own)
    fitted = SurrogateSession.of(on)
    if work.part == "confusability":
        return TaskResult({}, _alike(fitted))
    return TaskResult({}, _tried(fitted, work, cancelled, report))


def _alike(session: Any) -> dict[str, Any]:
    from glovecal_models.diagnosis.detectability.confusability import confusability

    alike = confusability(session.problem, declared=session.on.own)
    every = np.concatenate(session.residual)
    size = np.sqrt(np.nanmean(every**2, axis=0))
    return {
        "confusability": ConfusabilityView.of(alike).document(),
        "residual_deg": dict(zip(session.rotations, map(float, size), strict=True)),
    }


def _tried(
    session: Any, work: DetectabilityWork, cancelled: Callable[[], bool], report: Report
) -> dict[str, Any]:
    from glovecal_models.diagnosis.detectability.detection import trial
    from glovecal_models.diagnosis.detectability.injection import where_injected, why_not_injected

    own = {item.name: item for item in session.on.own}
    put_in: Effect | None = None if work.effect is None else own.get(work.effect) or effect(work.effect)
    where = where_injected(session, put_in, work.rotations)
    why = None if put_in is None else why_not_injected(session, put_in)
    found = []
    for number in range(work.trials if why is None else 0):
        report(f"{_label(work)}, trial {number + 1}", number / work.trials)
        found.append(
            trial(session, put_in, where, work.size_deg, seed=work.seed + number, cancelled=cancelled)
        )
    kept = [{"outcome": item.outcome, "named": list(item.named)} for item in found if item is not None]
    return {"why_not": why, "rotations": list(where), "trials": kept}


def _session(store: Store, payload: Mapping[str, Any]) -> tuple[SessionWork, list[TakeRecord]]:
    ids, own = payload.get("takes"), tuple(payload.get("declarations") or ())
    if payload.get("model") is not None:
        record = store.models.get(text_in(payload, "model"))
        records = takes_of(store, record, ids)
        layout, model, artifact = record.layout, record.id, store.models.load_bytes(record.id)
    else:
        records = [store.takes.get(id) for id in ids or ()]
        layout, model, artifact = text_in(payload, "layout"), None, b""
    work = SessionWork(
        tuple(store.takes.load(take.id) for take in records),
        tuple(take.artifact for take in records),
        store.layouts.get(layout),
        own,
        model,
        artifact,
    )
    return work, records


def _names(payload: Mapping[str, Any], session: SessionWork) -> list[str]:
    """The effects to put in: those named and declared, else every one that a diagnosis compares."""
    wanted = list(payload.get("effects") or ())
    declared = [effect_of_declaration(item).name for item in session.declarations]
    if wanted or declared:
        return list(dict.fromkeys([*wanted, *declared]))
    return [item.name for item in catalogue().values() if item.stage == "compared"]


def _result(
    store: Store,
    payload: Mapping[str, Any],
    records: Sequence[TakeRecord],
    targets: Sequence[tuple[str, tuple[str, ...] | None]],
    sizes: Sequence[float],
    trials: int,
    results: Sequence[TaskResult],
) -> dict[str, Any]:
    from glovecal_models.diagnosis.detectability.detection import Control, Detectability, SizeTried, Trial
    from glovecal_models.diagnosis.detectability.text import trials_sentence

    def those_of(facts: Mapping[str, Any]) -> tuple[Trial, ...]:
        return tuple(Trial(item["outcome"], tuple(item["named"])) for item in facts["trials"])

    alike, control = results[0].facts, Control(those_of(results[1].facts))
    views = []
    for number, (name, _) in enumerate(targets):
        first = 2 + number * len(sizes)
        facts = [item.facts for item in results[first : first + len(sizes)]]
        tried = [SizeTried(size, those_of(each)) for size, each in zip(sizes, facts, strict=True)]
        why = facts[0]["why_not"]
        found = Detectability(
            name, tuple(facts[0]["rotations"]), () if why is not None else tuple(tried), why
        )  # fmt: skip
        view = EffectDetectabilityView.of(found)
        if view not in views:  # a delay is on all rotations, whichever was asked for
            views.append(view)
    views.sort(key=lambda item: item.why_not is not None)
    of_control = DetectabilityControlView.of(control)
    said = [item.sentence for item in views]
    return DetectabilityResult(
        subject=store.subjects.get(text_in(payload, "subject")).name,
        model=payload.get("model"),
        takes=[{"id": take.id, "name": take.name} for take in records],  # pyright: ignore[reportArgumentType]
        simulated=any(take.simulated for take in records),
        trials=trials,
        residual_deg=alike["residual_deg"],
        effects=views,
        control=of_control,
        confusability=ConfusabilityView.model_validate(alike["confusability"]),
        sentences=[*said, of_control.sentence, trials_sentence(trials), *alike["confusability"]["sentences"]],
    ).document()


def _key(work: DetectabilityWork) -> str:
    session = work.session
    facts = {
        "model": session.model,
        "layout": session.layout.to_document(),
        "takes": list(session.take_hashes),
        "declarations": list(session.declarations),
        "rotations": None if work.rotations is None else list(work.rotations),
        **{name: getattr(work, name) for name in ("part", "effect", "size_deg", "trials", "seed")},
        "version": VERSION,
    }
    return task_key("detectability", facts)


def _label(work: DetectabilityWork) -> str:
    if work.part == "confusability":
        return "comparing effects with each other"
    if work.part == "control":
        return "trials with nothing put in"
    where = "" if work.rotations is None else f" on {', '.join(work.rotations)}"
    return f"{work.effect}{where} of {work.size_deg:g} degrees"


def _effort(work: DetectabilityWork) -> float:
    return 0.5 if work.part == "confusability" else float(max(work.trials, 1))
