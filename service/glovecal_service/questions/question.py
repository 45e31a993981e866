"""A question as it is registered: what it takes, what it works out, what it answers.

From it follow the job kind, the REST routes (``rest/asking.py``), the verb (``cli/asking.py``) with
``--json`` and ``--report``, and the page of a finished job.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Literal, TypeVar

from pydantic import BaseModel

from glovecal_models.calibration.artifact import load
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import effect_of_declaration
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.layout import Layout
from glovecal_models.parts import Part, Parted
from glovecal_models.presentation.document import AboutTakes, TakeNamed
from glovecal_models.progress import Cancel, Report
from glovecal_models.takes.take import Take
from glovecal_service.jobs.job_kind import JobPlan, Step, Task, TaskResult
from glovecal_service.jobs.task_key import task_key
from glovecal_service.plain import document_of, plain, read
from glovecal_service.questions.model_work import is_short, model_title, settings_of, stored_takes, takes_of
from glovecal_service.store import Store
from glovecal_service.store.records import JobRecord, ModelRecord, TakeRecord

Request = TypeVar("Request", bound=BaseModel)
Found = TypeVar("Found", bound=AboutTakes)
Who = Literal["model", "subject"]


@dataclass(frozen=True)
class AsOption:
    """How a field of a request is called on the command line; a list of numbers is one text with commas."""

    names: tuple[str, ...]
    metavar: str | None = None


@dataclass(frozen=True)
class Detail:
    """A section that is printed where its option asks for it."""

    option: str
    help: str
    heading: str


@dataclass(frozen=True)
class Asked(Generic[Request]):
    """A request, with what it names looked up."""

    request: Request
    subject: str
    layout: Layout
    takes: Sequence[TakeRecord]
    model: ModelRecord | None = None
    declarations: Sequence[dict[str, Any]] = ()
    """Effects of the user's own."""
    loaded: CalibrationModel | None = None
    """The model, where it is loaded already."""

    def payload(self) -> dict[str, Any]:
        """As the job's row keeps it."""
        return {
            **self.request.model_dump(mode="json"),
            "subject": self.subject,
            "layout": self.layout.name,
            "model": None if self.model is None else self.model.id,
            "takes": [take.id for take in self.takes],
            "declarations": list(self.declarations),
        }


@dataclass(frozen=True)
class WorkOnTakes:
    """What a worker needs to know, as plain data; ``model`` is the sha256 of ``artifact``."""

    question: str
    request: dict[str, Any]
    takes: tuple[Take, ...]
    take_hashes: tuple[str, ...]
    layout: Layout
    declarations: tuple[dict[str, Any], ...]
    model: str | None = None
    artifact: bytes = b""
    ready: CalibrationModel | None = None
    """The model, where it is loaded already."""
    hand: HandDimensions | None = None
    """Of the subject."""
    settings: TrainingSettings | None = None
    """How the model was trained."""

    @property
    def own(self) -> tuple[Effect, ...]:
        """Effects of the user's own that are asked for."""
        return tuple(effect_of_declaration(item) for item in self.declarations)

    @property
    def loaded(self) -> CalibrationModel:
        if self.ready is not None:
            return self.ready
        assert self.model is not None
        return load(self.artifact, expected_id=self.model)

    @property
    def on(self) -> ModelOnTakes:
        if self.model is None:
            return ModelOnTakes(self.takes, self.layout, own=self.own)
        return ModelOnTakes.of(self.loaded, self.takes, self.own)

    @property
    def identity(self) -> dict[str, Any]:
        """What decides every result of the work, beside the part's own facts."""
        return {
            "model": self.model,
            "layout": self.layout.to_document(),
            "takes": list(self.take_hashes),
            "left_out": [take.left_out for take in self.takes],
            "declarations": list(self.declarations),
        }


@dataclass(frozen=True)
class Question(Generic[Request, Found]):
    """One question about takes, or about a model on takes: answered by a job, or at once."""

    kind: str
    """The end of its routes, and the kind of its jobs."""
    verb: str | None
    """None: its verb is special, and has a file of its own."""
    of: tuple[Who, ...]
    """What it can be asked of."""
    summary: str
    """One line, for a list of routes."""
    help: str
    """What it finds, and how long that takes."""
    request: type[Request]
    answer: type[Found]
    work: Callable[[WorkOnTakes, Request], Parted[Found]] | None = None
    """Of its jobs."""
    at_once: Callable[[WorkOnTakes, Request], Found] | None = None
    """Works the answer out while the asker waits: it takes about a second, and there are no jobs."""
    of_any_takes: bool = False
    """Whether a model is asked about takes of other people too, and about such that nobody measured."""
    of_training: bool = False
    """Whether a model is asked about its training: the takes are those of its training that are still stored,
    and no others can be named."""
    own_effects: str | None = None
    """The field of its body with effects of the user's own, which are tried too; None: it tries none."""
    detail: Detail | None = None
    shows_ceiling: bool = False
    """Whether it shows the ceiling of a model, for which its verb can ask first."""
    is_short: bool = False
    """Whether on few frames it is over before worker processes would have started."""
    finish: Callable[[Store, Asked[Request], Found], Found] = lambda store, asked, found: found
    """Adds what only the store knows."""

    def read(self, document: Any) -> Found:
        """The answer from its document. Raises pydantic.ValidationError."""
        return read(self.answer, document)

    def requested(self, payload: Mapping[str, Any]) -> Request:
        """The question's own part of a job's row."""
        fields = self.request.model_fields
        return self.request.model_validate({name: payload[name] for name in fields if name in payload})

    def asked(self, store: Store, payload: Mapping[str, Any]) -> Asked[Request]:
        """Of a job's row. Raises NotFound, NotTrainable, BadInput."""
        request, own = self.requested(payload), tuple(payload.get("declarations") or ())
        if payload.get("model") is None:
            takes = [store.takes.get(id) for id in payload.get("takes") or ()]
            return Asked(request, payload["subject"], store.layouts.get(payload["layout"]), takes, None, own)
        model = store.models.get(payload["model"])
        ids = payload.get("takes")
        takes = stored_takes(store, ids or ()) if self.of_training else takes_of(store, model, ids)
        return Asked(request, model.subject, store.layouts.get(model.layout), takes, model, own)

    def checked(self, asked: Asked[Request]) -> None:
        """Refuse at once what the work would refuse. Raises BadInput."""
        declarations = tuple(asked.declarations)
        assert self.work is not None
        self.work(WorkOnTakes(self.kind, {}, (), (), asked.layout, declarations), asked.request).require()

    def on_takes(self, store: Store, asked: Asked[Request], request: dict[str, Any]) -> WorkOnTakes:
        """Raises NotFound, DamagedArtifact."""
        model = asked.model
        return WorkOnTakes(
            self.kind,
            request,
            tuple(store.takes.load(take.id) for take in asked.takes),
            tuple(take.artifact for take in asked.takes),
            asked.layout,
            tuple(asked.declarations),
            None if model is None else model.id,
            b"" if model is None or asked.loaded is not None else store.models.load_bytes(model.id),
            asked.loaded,
            store.subjects.get(asked.subject).skeleton().dimensions,
            None if model is None else settings_of(model),
        )

    def named(self, store: Store, asked: Asked[Request], found: Found) -> Found:
        """The answer with what was asked about, and what only the store knows."""
        model = asked.model
        known = replace(
            found,
            subject=asked.subject,
            model=None if model is None else model.id,
            method=None if model is None else model.method,
            title="" if model is None else model_title(store, model.id),
            takes=[TakeNamed(take.id, take.name) for take in asked.takes],
            simulated=any(take.simulated for take in asked.takes),
        )
        return self.finish(store, asked, known)

    def answered(self, store: Store, asked: Asked[Request]) -> Found:
        """At once. Raises NotFound, BadInput, DamagedArtifact."""
        assert self.at_once is not None
        work = self.on_takes(store, asked, {})
        return self.named(store, asked, self.at_once(work, asked.request))

    def plan(self, store: Store, job: JobRecord) -> JobPlan:
        """Raises NotFound (model, takes), NotTrainable, BadInput, DamagedArtifact."""
        asked = self.asked(store, job.payload)
        work = self.on_takes(store, asked, job.payload)
        assert self.work is not None
        parted = self.work(work, asked.request)
        parts = parted.parts()

        def finish(results: Sequence[TaskResult]) -> dict[str, Any]:
            given = [read(item.gives, result.facts) for item, result in zip(parts, results, strict=True)]
            return document_of(self.named(store, asked, parted.answer(given)))

        return JobPlan(
            [
                Task(
                    task_key(self.kind, {**work.identity, **plain(item.facts)}),
                    item.label,
                    run_part,
                    (work, item),
                    item.effort,
                )
                for item in parts
            ],
            lambda number, results: Step(f"{parts[number].label}: done"),
            finish,
            self.is_short and is_short(work.takes),
        )


def run_part(payload: tuple[WorkOnTakes, Part], cancelled: Cancel, report: Report) -> TaskResult:
    """In a worker. Raises BadInput, Cancelled."""
    from glovecal_service.questions.catalogue import QUESTIONS

    work, piece = payload
    question = QUESTIONS[work.question]
    assert question.work is not None
    parted = question.work(work, question.requested(work.request))
    return TaskResult({}, document_of(parted.run(piece, cancelled, report)))
