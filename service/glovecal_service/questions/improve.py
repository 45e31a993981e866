"""Takes in; out every model from the base to the last effect, each step stored as the next one's parent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import Field

from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput
from glovecal_models.improvement.answer import Improved, ImprovedSoFar, OnTheWay, falls_of
from glovecal_models.improvement.text import improved
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take
from glovecal_service.jobs.job_kind import JobPlan, Step, TaskReport, TaskResult
from glovecal_service.questions.chosen_takes import TakesNamed, takes_named
from glovecal_service.questions.making import Begun, Making, keep, made, models_of, one_task
from glovecal_service.questions.model_work import is_short, model_title
from glovecal_service.questions.question import AsOption
from glovecal_service.questions.training_takes import require_one_hand
from glovecal_service.request_types import Identifier, StrictBody, SubjectName
from glovecal_service.settings import Settings
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, incomplete_sentences


class ImprovementRequest(StrictBody):
    subject: SubjectName
    layout: Identifier
    takes: TakesNamed
    """Ids or names of the takes to learn from."""
    holdout: TakesNamed | None = None
    """Errors are on these; null: on takes held out of each fit."""
    method: Literal["linear", "lmc_gpr", "spgp", "auto", "polynomial_gpr", "general_gpr"] = "lmc_gpr"
    """The base that effects are added to."""
    samples: Annotated[int, Field(ge=10, le=5000)] = 2000
    """At most, for one rotation."""
    max_steps: Annotated[int, Field(ge=0, le=20)] = 6
    """Effects to add at most."""
    seed: Annotated[int, Field(ge=0, le=2**31 - 1)] = 0
    """Of controls and floors."""
    ceiling: Annotated[bool, AsOption(("--ceiling/--no-ceiling",))] = True
    """Ask at the end whether anything is left to gain from what was recorded."""
    activate: Annotated[bool, AsOption(("--activate",))] = False
    """Predict live with the last model."""


def begin(store: Store, body: ImprovementRequest) -> Begun:
    store.subjects.get(body.subject)
    store.layouts.get(body.layout)
    takes = takes_named(store, body.takes, body.subject, body.layout)
    holdout = takes_named(store, body.holdout or (), body.subject, body.layout)
    require_one_hand([*takes, *holdout])
    both = {take.id for take in takes} & {take.id for take in holdout}
    if both:
        name = next(take.name for take in takes if take.id in both)
        raise BadInput(f"take {name!r} is to be learned from and held out; choose one of the two")
    ids = {"takes": [take.id for take in takes], "holdout": [take.id for take in holdout] or None}
    return Begun(body.subject, body.model_dump() | ids)


@dataclass(frozen=True)
class ImprovementWork:
    takes: tuple[Take, ...]
    take_hashes: tuple[str, ...]
    holdout: tuple[Take, ...]
    layout: Layout
    asked: ImprovementRequest

    @property
    def settings(self) -> TrainingSettings:
        return TrainingSettings(self.asked.method, samples=self.asked.samples)


def plan(store: Store, job: JobRecord) -> JobPlan:
    """Raises NotFound (subject, layout, takes), BadInput, DamagedArtifact."""
    asked = IMPROVE.requested(job.payload)
    takes = [store.takes.get(id) for id in asked.takes]
    holdout = [store.takes.get(id) for id in asked.holdout or ()]
    work = ImprovementWork(
        tuple(store.takes.load(take.id) for take in takes),
        tuple(take.artifact for take in takes),
        tuple(store.takes.load(take.id) for take in holdout),
        store.layouts.get(asked.layout),
        asked,
    )
    subject = store.subjects.get(asked.subject).name
    facts = {
        "subject": subject,
        "layout": work.layout.to_document(),
        "takes": [[take.name, take.artifact] for take in takes],
        "holdout": [take.artifact for take in holdout],
        "left_out": [take.left_out for take in (*work.takes, *work.holdout)],
        "settings": asdict(work.settings),
        "most_steps": asked.max_steps,
        "seed": asked.seed,
        "ceiling": asked.ceiling,
    }

    def finish(result: TaskResult) -> Improved:
        """Stores each step's model under the one before it."""
        found, models = IMPROVE.read(result.facts), models_of(result)
        steps, parent = [], None
        learned = [take for take in takes if take.artifact in set(models[0].takes)]
        for number, (step, model, document) in enumerate(
            zip(found.steps, models, result.facts["steps"], strict=True)
        ):
            is_last = number == len(models) - 1
            own: dict[str, Any] = {"held_out_rmse_deg": step.rmse_deg, "per_rotation": step.per_rotation}
            own |= {} if step.added is None else {"addition": document["added"]}
            own |= {"ceiling": result.facts["ceiling"]} if is_last and found.ceiling else {}
            child = replace(model, parent=parent)
            activate = is_last and asked.activate
            parent = keep(store, child, asked.layout, learned, work.settings, own, activate=activate).id
            steps.append(replace(step, model=parent))
        return replace(
            found,
            steps=steps,
            sentences=[*incomplete_sentences([*takes, *holdout]), *found.sentences],
            title=model_title(store, parent or ""),
            active=asked.activate,
        )

    return one_task(
        "improve",
        facts,
        f"improving {subject}",
        run,
        work,
        _step,
        finish,
        is_short=is_short([*work.takes, *work.holdout]),
    )


def run(work: ImprovementWork, cancelled: Callable[[], bool], report: TaskReport) -> TaskResult:
    """In a worker. Raises BadInput, NotTrainable, Cancelled."""
    from glovecal_models.improvement.improve import improve  # heavy, and many commands run no job

    asked, so_far = work.asked, ImprovedSoFar()

    def stepped(steps: Sequence[OnTheWay]) -> None:
        nonlocal so_far
        so_far = ImprovedSoFar(falls_of(asked.method, steps))

    def say(sentence: str, share: float) -> None:
        report(sentence, share, asdict(so_far))

    found = improve(
        work.takes,
        work.layout,
        asked.subject,
        work.settings,
        holdout=work.holdout,
        max_steps=asked.max_steps,
        seed=asked.seed,
        take_hashes=work.take_hashes,
        ceiling=asked.ceiling,
        workers=Settings().workers or 1,
        cancelled=cancelled,
        report=say,
        stepped=stepped,
    )
    return made(improved(found), found.models)


def _step(facts: Mapping[str, Any]) -> Step:
    """The last word before the models are stored: the errors of all steps."""
    found = IMPROVE.read(facts)
    errors = [step.rmse_deg for step in found.steps]
    shown = " to ".join(f"{error:.2f}" for error in errors if error is not None)
    return Step(f"the error goes from {shown} degrees", {"rmse_deg": errors, "stopped": found.stopped})


IMPROVE = Making(
    kind="improve",
    address="/improve",
    summary="Train, and add what the diagnosis names while it pays",
    help="The job's result: `steps` (model, effect added, errors), noise floors, why it stopped, what "
    "remains.\n\nEach step's model is stored, with the one before it as its parent.",
    request=ImprovementRequest,
    answer=Improved,
    begin=begin,
    planned=plan,
)
