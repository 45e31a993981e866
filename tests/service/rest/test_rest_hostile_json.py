"""JSON that is no JSON, or not what was asked for: always 422, never echoed, never 500."""

from __future__ import annotations

import json
from urllib.parse import quote

import httpx
import pytest

JSON = {"Content-Type": "application/json"}
BODIES = {
    "NaN": '{"readings": [[NaN, 1]]}',
    "Infinity": '{"readings": [[Infinity, 1]]}',
    "minus Infinity": '{"readings": [[-Infinity, 1]]}',
    "beyond float": '{"readings": [[1e400, 1]]}',
    "lone surrogate": '{"readings": [["\\ud800", 1]]}',
    "surrogate as key": '{"\\udfff": 1, "readings": [[1]]}',
    "surrogate sensor": '{"readings": [[1]], "sensors": ["\\ud800"]}',
    "endless nesting": '{"readings": ' + "[" * 200_000 + "]" * 200_000 + "}",
    "endless objects": '{"a":' * 100_000 + "1" + "}" * 100_000,
    "endless integer": '{"readings": [[' + "9" * 10_000 + "]]}",
    "text for number": '{"readings": [["1", 2]]}',
    "boolean for number": '{"readings": [[true, 2]]}',
    "null": "null",
    "list": "[]",
    "text": '"readings"',
    "number": "1e9",
    "empty": "",
    "blank": "   ",
    "cut off": '{"readings": [[1, 2',
    "trailing": '{"readings": [[1]]} {"readings": [[1]]}',
    "not UTF-8": b'{"readings": [["\xff\xfe"]]}',
    "UTF-16": '{"readings": [["a"]]}'.encode("utf-16"),
    "NUL": b'{"readings": [[1]]}\x00',
    "unknown field": '{"readings": [[1]], "admin": true}',
    "no frames": '{"readings": []}',
    "object for list": '{"readings": {"0": [1]}}',
}


@pytest.mark.parametrize("what", BODIES)
def test_predict_refuses(http: httpx.Client, what: str) -> None:
    body = BODIES[what]
    answer = http.post("/models/abcdef/predict", content=body, headers=JSON)
    assert answer.status_code == 422, answer.text
    problem = json.loads(answer.text, parse_constant=lambda word: pytest.fail(f"{word} in an answer"))
    assert problem["status"] == 422
    assert problem["request_id"] == answer.headers["x-request-id"]
    assert len(answer.content) < 10_000
    assert "Traceback" not in answer.text


@pytest.mark.parametrize("word", ["NaN", "Infinity", "-Infinity", "1e400", '"\\ud800"', "true", "[]", "{}"])
@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/subjects", '{"name": "anna", "dimensions": {"hand_length": %s}}'),
        ("POST", "/subjects", '{"name": %s}'),
        ("POST", "/models/train", '{"subject": "anna", "layout": "cyberglove18", "pseudo_inputs": %s}'),
        ("POST", "/models/train", '{"subject": "anna", "layout": "cyberglove18", "takes": [%s]}'),
        ("PUT", "/gloves/mine", '{"name": "mine", "sensors": ["A"], "counts": [0, %s]}'),
        ("PUT", "/gloves/mine", '{"name": "mine", "sensors": [%s]}'),
        ("PUT", "/gloves/mine", '{"name": "mine", "sensors": ["A"], "rotations": {"A": %s, "B": 1}}'),
        ("POST", "/recordings", '{"glove": %s, "name": "x"}'),
        ("POST", "/models/abcdef/compare", '{"takes": %s, "x": 1}'),
    ],
)
def test_every_number_and_name_refuses(
    http: httpx.Client, method: str, path: str, body: str, word: str
) -> None:
    answer = http.request(method, path, content=body % word, headers=JSON)
    assert answer.status_code == 422, answer.text
    json.loads(answer.text, parse_constant=lambda word: pytest.fail(f"{word} in an answer"))


@pytest.mark.parametrize("value", ["nan", "inf", "1e400", "-1", "abc", "\x00", "😀", "9" * 5000])
@pytest.mark.parametrize(
    "path",
    [
        "/takes?subject={}x!",
        "/takes?layout={}!",
        "/jobs?only_unfinished={}",
        "/recordings?glove={}!",
        "/takes/0123456789ab/export?format={}",
        "/takes/0123456789ab/export?part={}",
    ],
)
def test_queries_refuse(http: httpx.Client, path: str, value: str) -> None:
    answer = http.get(path.format(quote(value)))
    assert answer.status_code == 422, answer.text


@pytest.mark.parametrize("text", ["a\x9ab", "a\u2028b", "a\nb", "\ud800", "x" * 201])
def test_titles_are_one_line_of_text(http: httpx.Client, text: str) -> None:
    answer = http.post("/subjects", content=json.dumps({"name": "titled", "title": text}), headers=JSON)
    assert answer.status_code == 422
    assert http.get("/subjects/titled").status_code == 404


def test_refusal_never_repeats_the_input(http: httpx.Client) -> None:
    secret = "hunter2-" * 4
    answer = http.post("/subjects", json={"name": secret + "!", "title": 7, "password": secret})
    assert answer.status_code == 422
    assert secret not in answer.text


@pytest.mark.parametrize(
    "kind", ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data; boundary=x"]
)
def test_forms_of_other_sites_are_no_json(http: httpx.Client, kind: str) -> None:
    body = b'{"name": "anna"}'
    assert http.post("/subjects", content=body, headers={"Content-Type": kind}).status_code == 422
    answer = http.post("/takes", params={"subject": "anna"}, content=body, headers={"Content-Type": kind})
    assert answer.status_code == 415


def test_unknown_paths_and_methods(http: httpx.Client) -> None:
    assert http.get("/nothing").status_code == 404
    assert http.get("/subjects/").status_code == 404
    answer = http.patch("/subjects/anna")
    assert answer.status_code == 405
    assert answer.headers["content-type"] == "application/problem+json"
    assert answer.headers["allow"] == "DELETE, GET"
