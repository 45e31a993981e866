"""The page of the examples: drawings go out, inputs come in, nothing but this machine is answered."""

from __future__ import annotations

import http.client
import json
from collections.abc import Iterator

import pytest
from stream.drawing import Drawing
from stream.live_page import MOST_INPUT_BYTES, LivePage


@pytest.fixture
def page() -> Iterator[LivePage]:
    with LivePage("A title", "What to do") as page:
        yield page


def ask(
    page: LivePage, method: str, path: str, body: bytes | None = None, headers: dict[str, str] | None = None
) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(page.host, timeout=120)
    connection.request(method, path, body, headers or {})
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


def test_the_page_and_its_drawings(page: LivePage) -> None:
    status, body = ask(page, "GET", "/")
    assert (status, body.count(b"A title")) == (200, 3)
    assert ask(page, "GET", "/../pyproject.toml")[0] == 404
    drawing = Drawing(100, 50)
    drawing.text((1, 2), "<b>5 mm & more</b>")
    page.show(drawing)
    connection = http.client.HTTPConnection(page.host, timeout=120)
    connection.request("GET", "/drawings")
    line = connection.getresponse().readline()
    connection.close()
    assert json.loads(line.removeprefix(b"data: ")) == drawing.document()
    assert "&lt;b&gt;5 mm &amp; more" in drawing.svg()


def test_inputs_come_in_order_and_what_is_wrong_is_refused(page: LivePage) -> None:
    for number in range(3):
        assert ask(page, "POST", "/input", json.dumps({"kind": "wheel", "dy": number}).encode())[0] == 204
    assert [item["dy"] for item in page.inputs()] == [0, 1, 2]
    for wrong in (b"{", b"[1]", b" " * (MOST_INPUT_BYTES + 1)):
        assert ask(page, "POST", "/input", wrong)[0] == 400
    assert ask(page, "POST", "/other", b"{}")[0] == 400
    assert page.inputs() == []


@pytest.mark.parametrize("headers", [{"Host": "example.org"}, {"Origin": "http://example.org"}])
def test_other_hosts_are_refused(page: LivePage, headers: dict[str, str]) -> None:
    assert ask(page, "GET", "/", headers=headers)[0] == 403
    assert ask(page, "POST", "/input", b"{}", headers)[0] == 403
