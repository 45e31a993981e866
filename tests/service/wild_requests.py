"""Wild requests for every route of an OpenAPI document: what is asked for, with one thing in it gone wild."""

from __future__ import annotations

import copy
import io
import json
import re
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from typing import Any

from hypothesis import strategies as st

DEEP = 200_000
WILD_JSON = (
    *("NaN", "Infinity", "1e400", "-1e400", "1e308", "-1e308", "1e-320", "9" * 400, "9" * 5000, "-0.0"),
    *("null", "true", "[]", "{}", '""', "0", "-1", "3.5", "1" + "0" * 18, "[[]]", "[null]", '{"": null}'),
    *('"\\ud800"', '"\\u0000"', '"a\\nb"', '"$\\\\frac{"', '"${}$"', '"' + "x" * 100_000 + '"'),
    *("[" * DEEP + "]" * DEEP, '{"a":' * DEEP + "1" + "}" * DEEP, "[" * 900 + "]" * 900),
)
"""Stand in place of one value, as they are, whether or not they are JSON."""
WILD_TEXTS = (
    *("[" * DEEP, '{"a":' * DEEP, '{"a": 1e400}', '{"a": ' + "9" * 5000 + "}", "<a>" * 20_000, "<", "a = ["),
    *("((" * 2000, "-" * 3000 + "1", "name = x; columns = " + "(" * 900 + "c.t" + ")" * 900),
    *("name = x; columns = 1e400 * own", "name = x; columns = 9e999", "name = x; columns = own ^ own ^ own"),
    *("name = x; columns = lowpass(lowpass(own, 1e-300 s), 1e300 s)", "$x$", "$\\frac{$", "%s %n", "\x7f"),
    *(
        "1:2 3:4",
        "0:1e400",
        "nan:nan nan:nan",
        "a" * 70_000,
        "'cyberglove_calibration': [['a', [[1,1e999]]]]",
    ),
)
"""Stand in place of any text: some of them are read as a language of their own."""
WILD_QUERIES = ("nan", "1e400", "-1", "9" * 5000, "", "\x00", "$x$", "\ud7ff", "a" * 3000, "true", "..", "[")


@dataclass(frozen=True)
class Operation:
    """One method of one path of the document."""

    method: str
    path: str
    parameters: list[dict[str, Any]]
    body: dict[str, Any] | None
    """Schema of its JSON body."""
    media_types: list[str]
    document: Mapping[str, Any] = field(repr=False)

    def __str__(self) -> str:
        return f"{self.method} {self.path}"

    @property
    def query(self) -> list[str]:
        return [item["name"] for item in self.parameters if item["in"] == "query"]

    @property
    def takes_upload(self) -> bool:
        """Its JSON body names an upload, itself or one level below."""
        text = json.dumps(self.body or {})
        for reference in re.findall(r"#/components/schemas/(\w+)", text):
            text += json.dumps(self.document["components"]["schemas"][reference])
        inner = re.findall(r"#/components/schemas/(\w+)", text)
        named = [self.document["components"]["schemas"][each].get("properties", {}) for each in inner]
        return any("upload" in fields for fields in named)


def operations(document: Mapping[str, Any]) -> list[Operation]:
    found = []
    for path, methods in document["paths"].items():
        for method, item in methods.items():
            content = item.get("requestBody", {}).get("content", {})
            body = content.get("application/json", {}).get("schema")
            found.append(
                Operation(method.upper(), path, item.get("parameters", []), body, list(content), document)
            )
    return found


class Samples:
    """Right values: of what is stored by the names of fields, of all else by their schemas."""

    def __init__(self, document: Mapping[str, Any], known: Mapping[str, Any]) -> None:
        self._document = document
        self._known = known

    def path(self, operation: Operation) -> str:
        path = operation.path
        for item in operation.parameters:
            if item["in"] == "path":
                noun = operation.path.split("/")[2].rstrip("s")
                value = self._known.get(f"{noun}.{item['name']}", self._known.get(item["name"]))
                if value is None:
                    value = self.value(item["schema"], item["name"])
                path = path.replace(f"{{{item['name']}}}", str(value))
        return path

    def value(
        self, schema: Mapping[str, Any], name: str = "", choose: Callable[[list[Any]], Any] = itemgetter(0)
    ) -> Any:
        """Every field is given: what is optional is read, too. ``choose``: a value of an enum."""

        def inner(schema: Mapping[str, Any], name: str = "") -> Any:
            return self.value(schema, name, choose)

        if "$ref" in schema:
            return inner(self._document["components"]["schemas"][schema["$ref"].rpartition("/")[2]], name)
        if name in self._known:
            found = copy.deepcopy(self._known[name])
            return found[: schema.get("maxItems")] if isinstance(found, list) else found
        for key in ("anyOf", "oneOf", "allOf"):
            if key in schema:
                return inner(next(each for each in schema[key] if each.get("type") != "null"), name)
        if "const" in schema or "enum" in schema:
            return choose(schema.get("enum") or [schema["const"]])
        match schema.get("type"):
            case "object":
                own = {key: inner(item, key) for key, item in schema.get("properties", {}).items()}
                for item in schema.get("patternProperties", {}).values():
                    own |= {key: inner(item) for key in self._known["keys"] if not own}
                return own
            case "array":
                first = schema.get("prefixItems") or [schema["items"]] * max(1, schema.get("minItems", 1))
                return [inner(item, f"{name}[]") for item in first]
            case "integer" | "number" as kind:
                return schema.get("default", schema.get("minimum", 0 if kind == "integer" else 0.5))
            case "boolean":
                return schema.get("default", False)
        return schema.get("default") or "a"


def places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where something can go wild in a JSON value, itself included."""
    yield at
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*at, key))


MARK = "7c1d2a90-here"


def with_wild(value: Any, place: tuple[Any, ...], wild: str) -> bytes:
    """JSON text of ``value`` with the text ``wild`` at ``place``."""
    if not place:
        return wild.encode("utf-8", "surrogatepass")
    changed = copy.deepcopy(value)
    inner = changed
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = MARK
    return json.dumps(changed).replace(f'"{MARK}"', wild).encode("utf-8", "surrogatepass")


def wild_files(whole: list[bytes]) -> st.SearchStrategy[bytes]:
    """Of files that can be read: flipped, cut, or with wild text in place of a part."""

    @st.composite
    def damaged(draw: st.DrawFn) -> bytes:
        content = draw(st.sampled_from(whole))
        at = draw(st.integers(0, len(content) - 1))
        match draw(st.sampled_from(["flip", "cut", "number", "text"])):
            case "flip":
                return content[:at] + bytes([content[at] ^ draw(st.integers(1, 255))]) + content[at + 1 :]
            case "cut":
                return content[:at]
            case "number":
                parts = content.split(b",")
                if len(parts) > 1:
                    parts[at % len(parts)] = draw(st.sampled_from(WILD_JSON[:10])).encode()
                return b",".join(parts)
        return content[:at] + draw(st.sampled_from(WILD_TEXTS)).encode()[:5000] + content[at:]

    return st.one_of(damaged(), st.sampled_from(wild_archives()))


def wild_archives() -> list[bytes]:
    """Zip files that cannot be read: encrypted, of an unknown method, with a wrong checksum, bombs."""
    plain = io.BytesIO()
    with zipfile.ZipFile(plain, "w") as file:
        for name in ("video.json", "time_s.npy", "000000.jpg"):
            file.writestr(name, b'{"times_s": [1]}' * 20)
    whole = bytearray(plain.getvalue())
    central = whole.index(b"PK\x01\x02")

    def patched(offset: int, value: int) -> bytes:
        """Of each entry's header, local (``offset``) and central (2 more)."""
        content, at = bytearray(whole), 0
        while (at := content.find(b"PK\x03\x04", at)) >= 0:
            content[at + offset] = value
            at += 4
        at = central
        while (at := content.find(b"PK\x01\x02", at)) >= 0:
            content[at + offset + 2] = value
            at += 4
        return bytes(content)

    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("video.json", b" " * 10_000_000)
        file.writestr(
            "time_s.npy",
            b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999,)}",
        )
    deep = io.BytesIO()
    with zipfile.ZipFile(deep, "w") as file:
        file.writestr("video.json", b"[" * DEEP)
        file.writestr("time_s.npy", b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': " + b"(" * 100)
    huge = io.BytesIO()
    with zipfile.ZipFile(huge, "w") as file:
        file.writestr("video.json", b'{"times_s": [' + b"9" * 5000 + b"]}")
    return [
        patched(6, 1), patched(8, 99), patched(8, 14), patched(14, 7), bytes(whole[:-30]), bytes(whole[:-1]),
        packed.getvalue(), deep.getvalue(), huge.getvalue(), b"PK\x03\x04" + bytes(100),
        b"PK\x05\x06" + bytes(18),
        b"", b"\x00" * 100, b"PAR1" + bytes(50) + b"PAR1", b"[" * DEEP, b'{"a":' * DEEP,
        (1 << 40).to_bytes(8, "little") + b"{}", (20).to_bytes(8, "little") + b"[" * 20,
        (DEEP).to_bytes(8, "little") + b"[" * DEEP, (17).to_bytes(8, "little") + b'{"a": 1e400, "b":',
    ]  # fmt: skip
