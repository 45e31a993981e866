"""Job kind ``train``: takes of one subject in, a stored (and, if wished, active) calibration model out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from typing import Any

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.fit_task import FitResult, FitTask
from glovecal_models.calibration.fit_task import run_task as run_fit
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.order_confounding import OrderConfounding, order_confounding
from glovecal_models.calibration.prior_mean import planes_of
from glovecal_models.calibration.text import order_sentences, plan_sentences, weight_sentence
from glovecal_models.calibration.training import assemble
from glovecal_models.calibration.training_plan import TrainingPlan, plan_training
from glovecal_models.calibration.training_settings import LINEAR_METHODS, TrainingSettings
from glovecal_models.comparison.odd_takes import odd_takes
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.hand.handedness import Handedness
from glovecal_models.progress import Report
from glovecal_models.regression.kernel_scores import choice_of, kernel_sentences
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.training_takes import TrainingTakes
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, TakeRecord, hand_of
from glovecal_service.views.camera_range import camera_range_views

_OWN_KEYS = {"subject", "layout", "takes", "activate", "parent", "prior"}
_SETTINGS = {field.name for field in fields(TrainingSettings)} - {"kernels", "prior"}


class TrainJob:
    """Payload: ``subject``, ``layout``, ``takes`` (ids, or None for all that teach), ``activate``,
    ``parent`` (model id or None), ``prior`` (id of a linear model or None), and any of ``TrainingSettings``.

    Result: ``model``, ``held_out_rmse_deg``, ``rmse_unseen_wearing_deg``, ``per_rotation`` (held-out
    degrees, None for a rule), ``sentences``, ``confounded_order`` (rotations of wearings in which posture
    goes with time), ``camera_ranges`` (angles that a camera saw, where one measured), ``active``.
    """

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises BadInput (payload), NotFound (subject, layout, takes, parent), NotTrainable."""
        payload = job.payload
        subject, layout_name = _text(payload, "subject"), _text(payload, "layout")
        settings = _settings(payload)
        if (prior := payload.get("prior")) is not None:
            settings = replace(settings, prior=planes_of(load(store.models.load_bytes(prior))))
        person = store.subjects.get(subject)
        layout = store.layouts.get(layout_name)
        parent = payload.get("parent")
        parent = None if parent is None else store.models.get(parent).id
        records = _takes(store, payload.get("takes"), subject, layout_name, str(payload.get("method")))
        taught = TrainingTakes.of(store, records, layout, person, settings)
        plan = plan_training(taught.takes, taught.layout, subject, taught.settings)

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            hashes = [record.artifact for record in records]
            fits = [_fit_result(result) for result in results]
            model = taught.finished(assemble(plan, fits, take_hashes=hashes, parent=parent))
            order = order_confounding(taught.takes)
            said = [*taught.sentences, *_odd_sentences(taught, records), *order_sentences(order)]
            facts = _facts(model, plan, records, said) | {"settings": asdict(settings)}
            facts["confounded_order"] = _confounded(order)
            return _keep(
                store, model, layout_name, facts, hand_of(records), bool(payload.get("activate", False))
            )

        return JobPlan(
            tasks=[Task(task.key, _label(task), fit, task, _effort(task)) for task in plan.tasks],
            step=_stepper(plan),
            finish=finish,
            in_this_process=settings.method in LINEAR_METHODS,
        )


def fit(task: FitTask, cancelled: Callable[[], bool], report: Report) -> TaskResult:
    """One fit, run in a worker. Raises Cancelled, NotTrainable."""

    def say(sentence: str, share: float) -> None:
        report(f"{_label(task)}: {sentence}", share)

    result = run_fit(task, cancelled=cancelled, report=say)
    facts = {
        "rotation": result.rotation,
        "fold": result.fold,
        "settings": result.settings,
        "held_out_squared_error": result.held_out_squared_error,
        "held_out_count": result.held_out_count,
        "without": result.without,
    }
    return TaskResult(result.arrays, facts)


def _effort(task: FitTask) -> float:
    """Measured: a process of one sensor takes hundredths of a second, of four or more seconds."""
    return 4.0 ** min(len(task.sensors), 4)


def _fit_result(result: TaskResult) -> FitResult:
    return FitResult(arrays=result.arrays, **{**result.facts, "without": tuple(result.facts["without"])})


def _stepper(plan: TrainingPlan) -> Callable[[int, Mapping[int, TaskResult]], Step]:
    """Says after each fit how far its rotation is, and its held-out error once all its folds are done."""
    planned = Counter(task.rotation for task in plan.tasks)

    def step(number: int, results: Mapping[int, TaskResult]) -> Step:
        rotation = plan.tasks[number].rotation
        done = Counter(plan.tasks[other].rotation for other in results)
        complete = [name for name in planned if done[name] == planned[name]]
        of_all = f"{len(complete)} of {len(planned)} rotations"
        detail: dict[str, Any] = {
            "rotation": rotation,
            "rotations_done": len(complete),
            "rotations": len(planned),
        }
        if rotation not in complete:
            return Step(f"{rotation}: {done[rotation]} of {planned[rotation]} fits done", detail)
        own = [result.facts for result in results.values() if result.facts["rotation"] == rotation]
        count = sum(facts["held_out_count"] for facts in own)
        if not count:
            return Step(f"{rotation} fitted; {of_all}", detail)
        error = (sum(facts["held_out_squared_error"] for facts in own) / count) ** 0.5
        detail["held_out_rmse_deg"] = error
        return Step(f"{rotation} fitted, {error:.2f} degrees on held-out takes; {of_all}", detail)

    return step


def _takes(
    store: Store, ids: Sequence[str] | None, subject: str, layout: str, method: str
) -> list[TakeRecord]:
    if ids is None:
        records = [take for take in store.takes.list(subject, layout) if take.teaches_by(method)]
        if not records:
            raise NotTrainable(
                f"subject {subject!r} has no take with reference angles for layout {layout!r}; import one,"
                " or attach a reference to a recorded take"
            )
        return records
    if not isinstance(ids, list) or not ids or not all(isinstance(id, str) for id in ids):
        raise BadInput(f"takes must be a list of take ids or null, not {ids!r}")
    records = [store.takes.get(id) for id in dict.fromkeys(ids)]
    for record in records:
        if record.subject != subject:
            raise BadInput(f"take {record.id} is of subject {record.subject!r}, not of {subject!r}")
    return records


def _settings(payload: Mapping[str, Any]) -> TrainingSettings:
    unknown = set(payload) - _OWN_KEYS - _SETTINGS
    if unknown:
        known = ", ".join(sorted(_OWN_KEYS | _SETTINGS))
        raise BadInput(f"training does not know {sorted(unknown)[0]!r}; it knows {known}")
    chosen = {name: payload[name] for name in _SETTINGS if payload.get(name) is not None}
    for name, value in chosen.items():
        if name == "keep_dead" and isinstance(value, bool):
            continue
        if name != "method" and (not isinstance(value, int) or isinstance(value, bool) or value < 0):
            raise BadInput(f"{name} must be a whole number, not {value!r}")
    return TrainingSettings(**chosen)


def _facts(
    model: CalibrationModel, plan: TrainingPlan, records: Sequence[TakeRecord], said: Sequence[str]
) -> dict[str, Any]:
    return {
        "takes": [{"id": record.id, "name": record.name, "artifact": record.artifact} for record in records],
        "held_out_rmse_deg": model.error_estimate.get("rmse_deg"),
        "rmse_unseen_wearing_deg": model.error_estimate.get("rmse_unseen_wearing_deg"),
        "held_out_how": model.error_estimate.get("how"),
        "per_rotation": {item.rotation: item.held_out_rmse_deg for item in model.rotations},
        "sentences": [*said, *plan_sentences(plan), *_kernel_sentences(model), *_weight_sentences(model)],
        "simulated": model.simulated,
        "camera_ranges": camera_range_views(plan.camera_ranges),
    }


def _odd_sentences(taught: TrainingTakes, records: Sequence[TakeRecord]) -> list[str]:
    """On takes that do not fit the others; they are trained on all the same, as they were asked for."""
    if len(taught.takes) != len(records):
        return []
    return [
        f"{item.sentence} To train without it: --leave-out {records[item.place].id}"
        if item.is_set_aside
        else item.sentence
        for item in odd_takes(taught.takes, taught.layout)
    ]


def _confounded(order: Sequence[OrderConfounding]) -> list[dict[str, Any]]:
    """Rotations of wearings in which a drift would look like posture."""
    return [asdict(item) for item in order if item.is_confounded]


def _kernel_sentences(model: CalibrationModel) -> list[str]:
    choices = {item.rotation: choice_of(item.regressor) for item in model.rotations}
    return kernel_sentences({name: found for name, found in choices.items() if found is not None})


def _weight_sentences(model: CalibrationModel) -> list[str]:
    said = [
        weight_sentence(item.rotation, item.regressor.evidence)
        for item in model.rotations
        if isinstance(item.regressor, ProcessRegressor)
    ]
    return [sentence for sentence in said if sentence]


def _keep(
    store: Store,
    model: CalibrationModel,
    layout: str,
    facts: dict[str, Any],
    hand: Handedness | None,
    activate: bool,
) -> dict[str, Any]:
    record = store.models.add(
        dump(model),
        subject=model.subject,
        layout=layout,
        method=model.method,
        parent=model.parent,
        facts=facts,
        hand=hand,
    )
    if activate:
        store.models.activate(record.id)
    names = (
        "held_out_rmse_deg", "rmse_unseen_wearing_deg", "per_rotation", "sentences", "confounded_order",
        "camera_ranges",
    )  # fmt: skip
    said = {name: facts[name] for name in names}
    return {"model": record.id, **said, "active": activate}


def _text(payload: Mapping[str, Any], name: str) -> str:
    value = payload.get(name)
    if not isinstance(value, str):
        raise BadInput(f"training needs {name!r} as text, not {value!r}")
    return value


def _label(task: FitTask) -> str:
    if task.without:
        return f"{task.rotation}, without {', '.join(task.without)}"
    return task.rotation if task.fold is None else f"{task.rotation}, fold {task.fold + 1}"
