"""Which model a glove is to be served with: the active one of its wearer and layout, if it is undamaged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from glovecal_models.calibration.artifact import load
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.realtime.pose_meta import Serving
from glovecal_service.realtime.served_model import ServedModel
from glovecal_service.store.errors import NotFound
from glovecal_service.store.models import other_remedies
from glovecal_service.store.store import Store


def choose(
    store: Store, glove: str, meta: Mapping[str, Any] | None, prepared: Mapping[str, ServedModel]
) -> Serving:
    """How ``glove`` is to be served now; ``prepared`` holds models that are in use already, by id.

    A damaged or missing artifact is named in the sentence with what to do; a model that is in use stays, else
    the one that was active before it is taken. Raises StoreError when the database does not answer.
    """
    try:
        record = store.gloves.get(glove)
    except NotFound:
        return Serving(sentence=f"glove {glove} has not said yet which layout it has")
    subject, layout = record.subject, record.layout
    serving = Serving(subject, layout, wearing=record.wearing)
    if layout is None:
        return replace(serving, sentence=f"glove {glove} has not said yet which layout it has")
    if subject is None:
        return replace(serving, sentence=f"nobody wears glove {glove}; assign a subject to it")
    layout, chain = _activations(store, subject, layout)
    if not chain:
        sentence = f"subject {subject} has no active model for layout {layout}; train and activate one"
        return replace(serving, sentence=sentence)
    return _first_that_loads(store, chain, layout, serving, meta, prepared)


def _activations(store: Store, subject: str, layout: str) -> tuple[str, list[str]]:
    """Layout and ids of models: the active one, then what rolling back would lead to."""
    newest = {
        name: max((item.id for item in store.models.activations(subject, name)), default=0)
        for name in _of_the_same_sensors(store, layout)
        if store.models.active(subject, name) is not None
    }
    if not newest:
        return layout, []
    layout = max(newest, key=lambda name: newest[name])
    active = store.models.active(subject, layout)
    if active is None:
        return layout, []
    by_id = {item.id: item for item in store.models.activations(subject, layout)}
    current, chain = by_id[max(by_id)], [active.id]
    while current.previous is not None and current.previous in by_id:
        current = by_id[current.previous]
        if current.model not in chain:
            chain.append(current.model)
    return layout, chain


def _of_the_same_sensors(store: Store, layout: str) -> list[str]:
    """The layout, and others that read the same sensors otherwise: an examination proposes such."""
    sensors = {record.name: set(record.document["sensors"]) for record in store.layouts.list()}
    return [layout, *(name for name in sensors if name != layout and sensors[name] == sensors.get(layout))]


def _first_that_loads(
    store: Store,
    chain: list[str],
    layout: str,
    serving: Serving,
    meta: Mapping[str, Any] | None,
    prepared: Mapping[str, ServedModel],
) -> Serving:
    problems = []
    for model_id in chain:
        model = prepared.get(model_id)
        try:
            content = store.artifacts.get(model_id)
            model = model or ServedModel.prepare(model_id, load(content, expected_id=model_id))
        except (DamagedArtifact, NotFound, BadInput) as error:
            remedies = other_remedies(str(serving.subject), layout, can_roll_back=len(chain) > 1)
            if model is None:
                problems.append(f"model {model_id[:12]} cannot be served: {error}{remedies}")
                continue
            problems.append(f"model {model_id[:12]} is served as it was loaded before: {error}{remedies}")
        misfit = _misfit(model, meta)
        if misfit:
            return replace(serving, sentence="; ".join([*problems, misfit]))
        if model_id != chain[0]:
            problems.append(f"model {model_id[:12]}, active before it, is served")
        return replace(serving, model=model, sentence="; ".join(problems))
    return replace(serving, sentence="; ".join(problems))


def _misfit(model: ServedModel, meta: Mapping[str, Any] | None) -> str:
    """Why the model cannot read this glove, "" if it can (or the glove did not say what it sends)."""
    sensors = None if meta is None else meta.get("sensors")
    if not isinstance(sensors, list) or tuple(sensors) == model.sensors:
        return ""
    return (
        f"the glove sends {len(sensors)} sensors ({', '.join(map(str, sensors[:4]))} ...), but model "
        f"{model.model_id[:12]} reads the {len(model.sensors)} of layout {model.layout}: "
        f"{', '.join(model.sensors)}"
    )
