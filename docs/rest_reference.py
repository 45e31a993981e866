"""The REST reference as Markdown, read from the service's OpenAPI document while the site is built."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from command_reference import code, plain, table

from glovecal_service.rest.app import create_app
from glovecal_service.settings import Settings

_LIMITS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
_LENGTHS = {"maxLength": "characters", "maxItems": "items"}
Schema = dict[str, Any]


def rest_reference(data: Path) -> str:
    """Every operation by tag, the problems, and the schemas (MyST Markdown). Nothing is kept in ``data``."""
    document = create_app(Settings(data=data)).openapi()
    operations = [
        (method, path, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    tags = dict.fromkeys(tag for _, _, operation in operations for tag in operation["tags"])
    parts: list[str] = []
    for tag in tags:
        parts.append(f"## {tag.capitalize()}")
        for method, path, operation in operations:
            if tag in operation["tags"]:
                parts += _operation(method.upper(), path, operation)
    parts += _problems([operation for _, _, operation in operations])
    parts.append("## Schemas")
    for name, schema in sorted(document["components"]["schemas"].items(), key=lambda item: _title(item[0])):
        parts += _schema(name, schema)
    return "\n\n".join(parts)


def _operation(method: str, path: str, operation: Schema) -> Iterator[str]:
    yield f"### {method} {path.replace('{', chr(92) + '{').replace('_', chr(92) + '_')}"
    yield f"**{plain(operation['summary'])}.**"
    yield from _paragraphs(operation.get("description"))
    rows = [
        (code(each["name"]), each["in"], _type(each["schema"]), _meaning(each, each.get("required", False)))
        for each in operation.get("parameters", [])
    ]
    if rows:
        yield table(("parameter", "in", "type", "meaning"), rows)
    body = operation.get("requestBody")
    if body:
        yield f"Body: {_content(body)}."
    answers = {int(status): answer for status, answer in operation["responses"].items()}
    for status, answer in sorted(answers.items()):
        if status < 400:
            yield f"Answers **{status}**{': ' + _content(answer) if answer.get('content') else ''}."
    yield "Problems: " + ", ".join(f"[{s}](#rest-problems)" for s in sorted(answers) if s >= 400) + "."


def _problems(operations: list[Schema]) -> Iterator[str]:
    meanings = {
        status: answer["description"]
        for operation in operations
        for status, answer in operation["responses"].items()
        if int(status) >= 400
    }
    yield "(rest-problems)=\n## Problems"
    yield "The body of every answer of 400 or more is a [Problem](#schema-Problem)."
    yield table(("status", "meaning"), [(s, _paragraph(meanings[s])) for s in sorted(meanings)])


def _schema(name: str, schema: Schema) -> Iterator[str]:
    yield f"(schema-{name})=\n### {plain(_title(name))}"
    yield from _paragraphs(schema.get("description"))
    required = schema.get("required", ())
    rows = [
        (code(field), _type(each), _meaning(each, field in required))
        for field, each in schema.get("properties", {}).items()
    ]
    yield table(("field", "type", "meaning"), rows) if rows else f"{_type(schema)}."


def _title(name: str) -> str:
    """A component's name; where two modules have one of the same name, with the module behind it."""
    *_, module, short = ("", "", *name.split("__"))
    return f"{short} ({module})" if module else short


def _meaning(described: Schema, required: bool) -> str:
    default = described.get("schema", described).get("default")
    said = [_paragraph(described.get("description", ""))]
    if default not in (None, "", [], {}):
        said.append(f"Default: {code(str(default))}.")
    return " ".join((*said, r"\[required\]" if required else "")).strip()


def _content(holder: Schema) -> str:
    return " or ".join(
        f"{_type(each.get('schema', {}))} ({kind})" for kind, each in holder["content"].items()
    )


def _type(schema: Schema) -> str:
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return f"[{plain(_title(name))}](#schema-{name})"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(_type(each) for each in schema[several]))
    if "enum" in schema or "const" in schema:
        return ", ".join(code(str(each)) for each in schema.get("enum", [schema.get("const")]))
    kind = schema.get("type")
    if kind == "array":
        return f"list of {_type(schema['items'])}{_limits(schema)}" if "items" in schema else "list"
    if kind == "object":
        of = schema.get("additionalProperties") or next(
            iter(schema.get("patternProperties", {}).values()), None
        )
        return f"object of {_type(of)}" if isinstance(of, dict) and of else "object"
    if kind is None:
        return "any"
    return f"{schema.get('format') or kind}{_limits(schema)}"


def _limits(schema: Schema) -> str:
    said = [f"{sign} {schema[key]:.12g}" for key, sign in _LIMITS.items() if key in schema]
    said += [f"at most {schema[key]} {unit}" for key, unit in _LENGTHS.items() if key in schema]
    return f" ({plain(', '.join(said))})" if said else ""


def _paragraph(text: str) -> str:
    """Descriptions are Markdown already (`code`); only what a table or a tag would break is escaped."""
    return " ".join(text.split()).replace("|", "\\|").replace("<", "\\<")


def _paragraphs(text: str | None) -> Iterator[str]:
    for paragraph in (text or "").split("\n\n"):
        if paragraph.strip():
            yield _paragraph(paragraph)
