"""The verbs of every registered question: options from its request, a bar, a table or JSON, a page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from inspect import Parameter, Signature, signature
from types import NoneType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from glovecal_models.presentation.field_descriptions import description_of
from glovecal_service.cli.terminal.connection import connect, subject_names
from glovecal_service.cli.terminal.options import AsJson, Model
from glovecal_service.cli.terminal.presenting import present
from glovecal_service.cli.terminal.printing import (
    Overwrite,
    Report,
    fetch_job_report,
    read_or_print,
    require_place,
    write_report,
)
from glovecal_service.cli.terminal.waiting import begun_job, wait_for_job
from glovecal_service.questions.at_once import AtOnce
from glovecal_service.questions.body import body_of
from glovecal_service.questions.declarations import Declared
from glovecal_service.questions.question import AsOption, Question

Ceiling = Annotated[
    bool, typer.Option("--ceiling", help="Ask whether anything is left to gain from what was recorded.")
]
if TYPE_CHECKING:
    from glovecal_client.rest import RestClient

SubjectOrModel = Annotated[
    str, typer.Argument(metavar="SUBJECT_OR_MODEL", help="A subject's name, or a model's id.")
]


def verb(question: Question) -> Callable[..., None]:
    """The question's verb, for ``typer``."""
    detail = question.detail
    fields = _fields(*(body_of(question, who) for who in question.of))

    def ask(report: Any, overwrite: bool, as_json: bool, **given: Any) -> None:
        who = given.pop(of.name)
        if report is not None:
            require_place(report, overwrite=overwrite)
        with_ceiling = given.pop("ceiling", False)
        also = detail.heading if detail is not None and given.pop(detail.option) else None
        body = _body(fields, given)
        with connect() as service:
            if with_ceiling:
                wait_for_ceiling(service, who, body.get("takes", ()), quiet=as_json)
            address = f"/models/{who}"
            if "subject" in question.of and who.lower() in subject_names(service):
                address = f"/subjects/{who.lower()}"
            job = begun_job(service.post(f"{address}/{question.kind}", body))
            result = wait_for_job(service, job, quiet=as_json).result
            page = fetch_job_report(service, job, report) if report is not None else b""
        if report is not None:
            write_report(report, page, as_json=as_json)
        present(read_or_print(question.answer, result, as_json).presentation(), also)

    of = _parameter("who", SubjectOrModel) if len(question.of) > 1 else _parameter("model", Model)
    after = [_parameter("report", Report, None), _parameter("overwrite", Overwrite, False)]
    if question.shows_ceiling:
        after.insert(0, _parameter("ceiling", Ceiling, False))
    if detail is not None:
        told = typer.Option(f"--{detail.option}", help=detail.help)
        after.insert(0, _parameter(detail.option, Annotated[bool, told], False))
    return _with_options(ask, question.help, [of], fields, after)


def wait_for_ceiling(
    service: RestClient, model: str, takes: Sequence[str] = (), *, quiet: bool = False
) -> None:
    """Ends when the ceiling is known; at once where it was asked for before."""
    job = begun_job(service.post(f"/models/{model}/ceiling", {"takes": list(takes) or None}))
    wait_for_job(service, job, quiet=quiet)


def verb_at_once(question: AtOnce) -> Callable[..., None]:
    """The verb of a question about a model, for ``typer``."""
    fields = _fields(question.request)

    def ask(model: str, as_json: bool, **given: Any) -> None:
        with connect() as service:
            document = service.post(f"/models/{model}/{question.kind}", _body(fields, given))
        present(read_or_print(question.answer, document, as_json).presentation())

    return _with_options(ask, question.help, [_parameter("model", Model)], fields, [])


def _with_options(
    ask: Callable[..., None],
    help: str,
    before: list[Parameter],
    fields: Mapping[str, FieldInfo],
    after: list[Parameter],
) -> Callable[..., None]:
    options = [_parameter(name, *_option(name, field)) for name, field in fields.items()]
    parameters = [*before, *options, *after, _parameter("as_json", AsJson, False)]
    ask.__doc__ = help
    ask.__signature__ = Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
    ask.__annotations__ = {item.name: item.annotation for item in parameters}
    return ask


def options_of(request: type[BaseModel], *names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Gives a verb of its own file options for those fields of a request; it is called with ``asked``, their
    values by name."""

    def with_options(own: Callable[..., None]) -> Callable[..., None]:
        def ask(**given: Any) -> None:
            asked = {name: given.pop(name) for name in names}
            own(**given, asked={name: value for name, value in asked.items() if value is not None})

        kept = [item for item in signature(own, eval_str=True).parameters.values() if item.name != "asked"]
        fields = _fields(request)
        parameters = [
            *(_parameter(item.name, item.annotation, item.default) for item in kept),
            *(_parameter(name, *_option(name, fields[name])) for name in names),
        ]
        ask.__doc__, ask.__name__ = own.__doc__, own.__name__
        ask.__signature__ = Signature(parameters)  # pyright: ignore[reportFunctionMemberAccess]
        ask.__annotations__ = {item.name: item.annotation for item in parameters}
        return ask

    return with_options


def _fields(*requests: type[BaseModel]) -> dict[str, FieldInfo]:
    """With their docstrings as descriptions."""
    fields = {}
    for request in requests:
        for name, field in request.model_fields.items():
            fields[name] = described = copy(field)
            described.description = field.description or description_of(request, name)
    return fields


def _body(fields: Mapping[str, FieldInfo], given: Mapping[str, Any]) -> dict[str, Any]:
    return {name: _as_asked(fields[name], value) for name, value in given.items() if value not in (None, [])}


def _parameter(name: str, annotation: Any, default: Any = Parameter.empty) -> Parameter:
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def _option(name: str, field: FieldInfo) -> tuple[Any, Any]:
    """As typer declares it, and its default."""
    called = next((item for item in field.metadata if isinstance(item, AsOption)), None)
    names = called.names if called else (f"--{name.replace('_', '-')}",)
    kind, is_list = _kind(field.annotation), _is_list(field.annotation)
    default: Any = Parameter.empty if field.is_required() else field.default
    help = (field.description or "").replace("; null:", ". Default:")
    if is_list and kind is float:
        default = ",".join(f"{value:g}" for value in default)
        return Annotated[str, typer.Option(*names, help=f"{help} Separated by commas.")], default
    if is_list:
        words = Annotated[list[str] | None, typer.Option(*names, help=f"{help} Repeat.")]
        return words, None
    bounds = {
        bound: getattr(item, at) for item in field.metadata for bound, at in (("min", "ge"), ("max", "le"))
        if hasattr(item, at)
    }  # fmt: skip
    if default is None:
        kind = kind | None
    return Annotated[kind, typer.Option(*names, help=help, **bounds)], default


def _as_asked(field: FieldInfo, value: Any) -> Any:
    if not _is_list(field.annotation):
        return value
    if _kind(field.annotation) is float:
        try:
            return [float(part) for part in value.split(",") if part.strip()]
        except ValueError as error:
            raise typer.BadParameter(f"{value!r} is no list of numbers such as 0.5,1,2") from error
    return [{"declaration": item} for item in value] if _kind(field.annotation) is Declared else value


def _kind(annotation: Any) -> Any:
    """What it holds, without Annotated, None and list; a Literal stays."""
    if get_origin(annotation) is Literal or not get_args(annotation):
        return annotation
    return _kind(next(item for item in get_args(annotation) if item is not NoneType))


def _is_list(annotation: Any) -> bool:
    if get_origin(annotation) in (list, Literal) or not get_args(annotation):
        return get_origin(annotation) is list
    return _is_list(next(item for item in get_args(annotation) if item is not NoneType))
