"""Takes of one subject in, a stored (and, if wished, active) calibration model out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Annotated, Any

from pydantic import Field, field_validator

from glovecal_models.calibration.answer import Trained
from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.fit_task import FitResult, FitTask
from glovecal_models.calibration.fit_task import run_task as run_fit
from glovecal_models.calibration.methods import LINEAR_METHODS, Method
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.order_confounding import order_confounding
from glovecal_models.calibration.people_prior import PeoplePrior
from glovecal_models.calibration.template import planes_of
from glovecal_models.calibration.text import (
    order_sentences,
    plan_sentences,
    wearing_sentences,
    weight_sentence,
)
from glovecal_models.calibration.training import assemble, train
from glovecal_models.calibration.training_plan import TrainingPlan, plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.odd_takes import odd_takes
from glovecal_models.errors import BadInput, LayoutMismatch, NotTrainable
from glovecal_models.hand.rotations import Handedness
from glovecal_models.progress import Report
from glovecal_models.regression.kernel_scores import choice_of, kernel_sentences
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.plain import document_of
from glovecal_service.questions.making import Begun, Making, keep
from glovecal_service.questions.people import prior_of_people
from glovecal_service.questions.question import AsOption
from glovecal_service.questions.training_takes import TrainingTakes, require_one_hand
from glovecal_service.request_types import Id, Identifier, ModelReference, StrictBody, SubjectName
from glovecal_service.store import Store
from glovecal_service.store.errors import Conflict
from glovecal_service.store.records import JobRecord, ModelRecord, TakeRecord, hand_of

MOST_TAKES = 1000
_SETTINGS = {field.name for field in fields(TrainingSettings)} - {"kernels", "optima", "prior", "people"}


class TrainingRequest(StrictBody):
    subject: SubjectName
    layout: Identifier | None = None
    """Null: that of the takes, if it is one."""
    hand: Handedness | None = None
    """Only its takes, and those of which nobody said it; needed where there are both hands'."""
    method: Method = "lmc_gpr"
    """auto chooses each rotation's kernel by evidence and error, for hardware nobody knows. raw is no
    calibration at all: the scale to read the others against. template is a scale and an offset for each
    sensor and the palm's part, from five hand shapes; two_shapes is the glove maker's line through two."""
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)] | None = None
    """Null: all takes of the subject (and layout) that have a reference, or in which fingertips were kept
    together."""
    activate: Annotated[bool, AsOption(("--activate/--no-activate",))] = True
    """Predict live with the model once it is trained."""
    pseudo_inputs: Annotated[int, Field(ge=2, le=1000)] = 100
    """SPGP's number of pseudo-inputs."""
    parent: ModelReference | None = None
    prior: ModelReference | None = None
    """A linear model of the same glove, such as a template: lmc_gpr's mean where samples say nothing."""
    people: Annotated[bool, AsOption(("--people",))] = False
    """For method linear: other people's takes of the layout are a prior, so that half a minute is enough."""
    people_prior: dict[str, Any] | None = None
    """Such a prior from a file that was written by glovecal glove people."""
    people_wearing: Annotated[str, AsOption(("--for-wearing",)), Field(max_length=200)] = ""
    """With a prior of people and takes of several wearings: the one that is worn now. Default: the next."""
    samples: Annotated[int, Field(ge=10, le=5000)] = 2000
    """At most, for one rotation; fewer train faster."""
    folds: Annotated[int, Field(ge=0, le=20)] = 3
    """Held-out folds for the error estimate; 0: no estimate, fastest."""
    iterations: Annotated[int, Field(ge=1, le=2000)] = 200
    """SPGP only."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0
    """Of what is chosen at random."""
    keep_dead: Annotated[bool, AsOption(("--keep-dead",))] = False
    """Refuse sensors that never move in the takes, or are clipped, instead of leaving them out."""

    @field_validator("folds")
    @classmethod
    def _not_one(cls, folds: int) -> int:
        if folds == 1:
            raise BadInput("one fold would hold out everything; 0 or at least 2")
        return folds


def begin(store: Store, body: TrainingRequest) -> Begun:
    takes = _chosen_takes(store, body)
    payload = body.model_dump() | {"layout": takes[0].layout, "takes": [take.id for take in takes]}
    if body.parent is not None:
        payload["parent"] = store.models.get(body.parent).id
    if body.prior is not None:
        payload["prior"] = _prior(store, body, body.prior).id
    if body.people or body.people_prior is not None:
        payload["people_prior"] = _people(store, body, takes).to_document()
    return Begun(body.subject, payload)


def _people(store: Store, body: TrainingRequest, takes: Sequence[TakeRecord]) -> PeoplePrior:
    """From a file, else from the takes of others that whoever asks may see: means and variances, no takes."""
    if body.method != "linear":
        raise NotTrainable(f"a prior of people is for method linear, not for {body.method}: --method linear")
    if body.people_wearing and body.people_wearing not in {take.wearing for take in takes}:
        raise NotTrainable(f"no take is of wearing {body.people_wearing!r}; name a wearing of the takes")
    layout = takes[0].layout
    if body.people_prior is None:
        return prior_of_people(store, layout, hand_of(takes), besides=body.subject)
    prior = PeoplePrior.from_document(body.people_prior, "the prior of people")
    if prior.layout != layout:
        raise LayoutMismatch(
            f"the prior of people is of layout {prior.layout!r}; the takes are of {layout!r}"
        )
    return prior


def _prior(store: Store, body: TrainingRequest, id: str) -> ModelRecord:
    prior = store.models.get(id)
    if prior.subject != body.subject:
        raise Conflict(f"model {prior.id} is of subject {prior.subject!r}, not {body.subject!r}")
    if body.method != "lmc_gpr":
        raise NotTrainable(f"a prior mean is for method lmc_gpr, not for {body.method}")
    return prior


def _chosen_takes(store: Store, body: TrainingRequest) -> list[TakeRecord]:
    """Of one layout and hand. Raises NotFound, Conflict, LayoutMismatch, NotTrainable."""
    store.subjects.get(body.subject)
    if body.layout is not None:
        store.layouts.get(body.layout)
    if body.takes is None:
        every = store.takes.list(subject=body.subject, layout=body.layout)
        takes = [take for take in every if take.teaches_by(body.method) and take.is_of(body.hand)]
    else:
        takes = [store.takes.get(id) for id in dict.fromkeys(body.takes)]
    for take in takes:
        if take.subject != body.subject:
            raise Conflict(
                f"take {take.id} ({take.name!r}) is of subject {take.subject!r}, not {body.subject!r}"
            )
        if body.layout not in (None, take.layout):
            raise LayoutMismatch(
                f"take {take.id} ({take.name!r}) has layout {take.layout!r}, not {body.layout!r}"
            )
    if not any(take.teaches_by(body.method) for take in takes):
        of_layout = f" with layout {body.layout!r}" if body.layout is not None else ""
        raise NotTrainable(
            f"no take of subject {body.subject!r}{of_layout} has reference angles; "
            "import some with r.ROTATION columns, or attach a reference to a recording"
        )
    require_one_hand(takes)
    layouts = sorted({take.layout for take in takes})
    if len(layouts) > 1:
        raise LayoutMismatch(f"the takes have layouts {', '.join(layouts)}; choose one of them as layout")
    return takes


def plan(store: Store, job: JobRecord) -> JobPlan:
    """Raises BadInput (payload), NotFound (subject, layout, takes, parent), NotTrainable."""
    asked = TRAIN.requested(job.payload)
    settings = TrainingSettings(**{name: getattr(asked, name) for name in _SETTINGS})
    if asked.prior is not None:
        settings = replace(settings, prior=planes_of(load(store.models.load_bytes(asked.prior))))
    if asked.people_prior is not None:
        people = PeoplePrior.from_document(asked.people_prior, "the prior of people")
        settings = replace(settings, people=people.planes)
    parent = None if asked.parent is None else store.models.get(asked.parent).id
    records = _chosen_takes(store, asked)
    layout = records[0].layout
    taught = TrainingTakes.of(
        store, records, store.layouts.get(layout), store.subjects.get(asked.subject), settings
    )
    plan = plan_training(taught.takes, taught.layout, asked.subject, taught.settings)

    def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
        hashes = [record.artifact for record in records]
        fits = [_fit_result(result) for result in results]
        model = taught.finished(assemble(plan, fits, take_hashes=hashes, parent=parent))
        order = order_confounding(taught.takes)
        found = Trained(
            model="",
            held_out_rmse_deg=model.error_estimate.get("rmse_deg"),
            rmse_unseen_wearing_deg=model.error_estimate.get("rmse_unseen_wearing_deg"),
            per_rotation={item.rotation: item.held_out_rmse_deg for item in model.rotations},
            sentences=[
                *taught.sentences,
                *_odd_sentences(taught, records),
                *order_sentences(order),
                *plan_sentences(plan),
                *_kernel_sentences(model),
                *_weight_sentences(model),
            ],
            confounded_order=[item for item in order if item.is_confounded],
            camera_ranges=plan.camera_ranges,
            active=asked.activate,
            subject=model.subject,
            method=model.method,
            held_out_how=str(model.error_estimate.get("how")),
            wearing_sentences=wearing_sentences(model, model.error_estimate.get("rmse_deg")),
            people=max((plane.people for plane in settings.people), default=0),
            alone_rmse_deg=_alone(taught, asked.subject) if settings.people else None,
        )
        document = document_of(found)
        facts = {name: document[name] for name in ("sentences", "confounded_order", "camera_ranges")}
        kept = keep(store, model, layout, records, settings, facts, activate=asked.activate)
        return document_of(replace(found, model=kept.id))

    return JobPlan(
        tasks=[Task(task.key, _label(task), fit, task, _effort(task)) for task in plan.tasks],
        step=_stepper(plan),
        finish=finish,
        in_this_process=settings.method in LINEAR_METHODS,
    )


def _alone(taught: TrainingTakes, subject: str) -> float | None:
    """The held-out error without other people."""
    settings = replace(taught.settings, people=(), people_wearing="")
    try:
        return train(taught.takes, taught.layout, subject, settings).error_estimate.get("rmse_deg")
    except NotTrainable:
        return None


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


def _label(task: FitTask) -> str:
    if task.without:
        return f"{task.rotation}, without {', '.join(task.without)}"
    return task.rotation if task.fold is None else f"{task.rotation}, fold {task.fold + 1}"


TRAIN = Making(
    kind="train",
    address="/models/train",
    summary="Train a calibration model",
    help="Answers at once with the job; what cannot be trained is refused here, before anything is fitted.",
    request=TrainingRequest,
    answer=Trained,
    begin=begin,
    planned=plan,
)
