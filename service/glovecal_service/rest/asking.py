"""The routes of every registered question, of a model, a subject or takes: each begins a job, or answers; and
of those that make models."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from inspect import Parameter, Signature
from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse
from pydantic import create_model

from glovecal_service.plain import document_of
from glovecal_service.questions.at_once import AskedAtOnce, AtOnce
from glovecal_service.questions.body import asked_of_model, asked_of_subject, body_of
from glovecal_service.questions.catalogue import AT_ONCE, MAKINGS, QUESTIONS
from glovecal_service.questions.making import Making
from glovecal_service.questions.question import Asked, Question, Who
from glovecal_service.rest.http.dependencies import Parts, PartsNeeded, StoreNeeded
from glovecal_service.rest.http.problem import change_problems
from glovecal_service.rest.http.report_page import REPORT, ReportFormat, report_response
from glovecal_service.rest.http.request_types import EffectInPath, ModelInPath, SubjectInPath
from glovecal_service.rest.job.answer import JobFacts
from glovecal_service.rest.job.jobs import new_job
from glovecal_service.store.records import JobRecord
from glovecal_service.store.store import Store

router = APIRouter()
IN_ADDRESS: dict[str, Any] = {"id": ModelInPath, "name": EffectInPath}
ADDRESS = {"model": "/models/{id}", "subject": "/subjects/{name}", "takes": "/takes"}


def _add_route(question: Question, who: Who) -> None:
    def begun(store: Store, response: Response, asked: Asked) -> JobRecord:
        question.checked(asked)
        return new_job(store, response, question.kind, asked.payload(), asked.subject)

    def of_model(id: ModelInPath, body: Any, store: StoreNeeded, response: Response) -> JobRecord:
        return begun(store, response, asked_of_model(store, question, id, body))

    def of_subject(name: SubjectInPath, body: Any, store: StoreNeeded, response: Response) -> JobRecord:
        return begun(store, response, asked_of_subject(store, question, name, body))

    begin: Callable[..., JobRecord] = of_model if who == "model" else of_subject
    begin.__annotations__["body"] = body_of(question, who)
    begin.__name__ = f"{question.kind}_of_{who}"
    summary = question.summary if len(question.of) == 1 else f"{question.summary}: of a {who}"
    _add(f"{ADDRESS[who]}/{question.kind}", "POST", question, begin, summary)


def _add_making(making: Making) -> None:
    def begin(store: Store, response: Response, body: Any, **named: str) -> JobRecord:
        begun = making.begin(store, body, **named)
        return new_job(store, response, making.kind, begun.payload, begun.subject)

    given = {name: IN_ADDRESS[name] for name in re.findall(r"{(\w+)}", making.address)}
    body: Any = making.request if making.method == "POST" else Annotated[making.request, Query()]
    given |= {"body": body, "store": StoreNeeded, "response": Response}
    parameters = [Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind) for name, kind in given.items()]
    begin.__signature__ = Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    begin.__name__ = making.kind
    _add(making.address, making.method, making, begin, making.summary)


def _add(
    address: str, method: str, asked: Question | Making, begin: Callable[..., JobRecord], summary: str
) -> None:
    begin.__doc__ = f"{asked.help}\n\n`GET /v1/jobs/{{id}}/report` shows it with pictures, as HTML or PDF."
    result: Any = asked.answer | None
    router.add_api_route(
        address,
        begin,
        methods=[method],
        tags=["models"],
        status_code=202,
        response_model=create_model(f"{asked.answer.__name__}Job", __base__=JobFacts, result=result),
        summary=summary,
        responses=change_problems(409),
    )


def _add_at_once(question: AtOnce) -> None:
    """The answer at once, and where it has one its page."""

    def run(parts: Parts, body: Any, id: str | None) -> Any:
        record = None if id is None else parts.store.models.get(id)
        return question.run(AskedAtOnce(body, parts.store, parts.predictors, record))

    def of_takes(body: Any, parts: PartsNeeded) -> Response:
        return JSONResponse(document_of(run(parts, body, None)))

    def of_model(id: ModelInPath, body: Any, parts: PartsNeeded) -> Response:
        return JSONResponse(document_of(run(parts, body, id)))

    def page_of_takes(body: Any, parts: PartsNeeded, form: ReportFormat = "html") -> Response:
        return report_response(run(parts, body, None).presentation(), form)

    address = f"{ADDRESS[question.of]}/{question.kind}"
    tags: list[str | Enum] = ["models" if question.of == "model" else "takes"]
    answered: Callable[..., Response] = of_model if question.of == "model" else of_takes
    for function in (answered, page_of_takes):
        function.__annotations__["body"] = question.request
    answered.__name__ = question.kind.replace("-", "_")
    page_of_takes.__name__ = f"{answered.__name__}_report"
    answered.__doc__ = question.help
    router.post(
        address, tags=tags, response_model=question.answer, summary=question.summary,
        responses=change_problems(409),
    )(answered)  # fmt: skip
    if question.has_page:
        router.post(
            f"{address}/report", tags=tags, response_class=Response,
            summary="The same as a page with pictures", responses=change_problems(409) | REPORT,
        )(page_of_takes)  # fmt: skip


for _at_once in AT_ONCE.values():
    _add_at_once(_at_once)


def _add_answer(question: Question) -> None:
    def answer(id: ModelInPath, body: Any, parts: PartsNeeded) -> dict[str, Any]:
        return document_of(question.answered(parts.store, asked_at_once(parts, question, id, body)))

    answer.__annotations__["body"] = body_of(question, "model")
    answer.__name__ = f"{question.kind}_of_model"
    answer.__doc__ = question.help
    router.post(
        f"{ADDRESS['model']}/{question.kind}",
        tags=["models"],
        response_model=question.answer,
        summary=question.summary,
        responses=change_problems(409),
    )(answer)


def asked_at_once(parts: Parts, question: Question, id: str, body: Any) -> Asked:
    """With the model as it is loaded already. Raises NotFound, Conflict, LayoutMismatch, DamagedArtifact."""
    asked = asked_of_model(parts.store, question, id, body)
    assert asked.model is not None
    return replace(asked, loaded=parts.predictors.get(asked.model.id)[0])


for _question in QUESTIONS.values():
    if _question.at_once is not None:
        _add_answer(_question)
    else:
        for _who in _question.of:
            _add_route(_question, _who)
for _making in MAKINGS.values():
    _add_making(_making)
