"""A page with nothing to show says what to do next: as a button, and as a command that can be copied."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from foreign_tables import semicolons
from playwright.sync_api import expect
from realtime_support import free_endpoint, part_of_service
from studio_support import Open, serious

from glovecal_client.rest import RestClient
from glovecal_service.serve import web
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
WITHOUT_A_MODEL = ["compare", "diagnose", "fall", "models"]


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a service on a folder of its own."""
    port = int(free_endpoint().rpartition(":")[2])
    data = tmp_path_factory.mktemp("empty") / "data"
    with part_of_service(web, Settings(data=data, zenoh=free_endpoint(), port=port, workers=1)):
        yield f"http://127.0.0.1:{port}"


@pytest.mark.parametrize("name", [*WITHOUT_A_MODEL, "takes"])
def test_with_nothing_there_are_four_ways_in(opened: Open, empty: str, name: str) -> None:
    page = opened(name, at=empty).page
    steps = page.get_by_role("region", name="What to do next")
    ways = ("Import a recording", "Connect a glove", "Try a simulated glove", "Find a hidden effect")
    for way in ways:
        expect(steps.get_by_role("link", name=way)).to_be_visible()
    expect(steps.get_by_text("glovecal demo", exact=True)).to_be_visible()
    assert serious(page) == []


def test_with_takes_the_next_step_is_training(opened: Open, empty: str, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 4, seconds=3.0)
    with RestClient(empty) as client:
        file = {"upload": client.upload(path), "filename": path.name}
        seen = client.post("/takes/preview", file)
        body = {"subject": "dora", "create_subject": True, "mapping": seen["mapping"]}
        client.post("/takes/import", file | body)
    for name in WITHOUT_A_MODEL:
        page = opened(name, at=empty).page
        expect(page.get_by_text("glovecal train --subject dora", exact=True)).to_be_visible()
    page = opened("models", at=empty).page
    page.get_by_role("link", name="Train a model").click()
    expect(page.get_by_role("button", name="Train on 4 takes")).to_be_visible()
