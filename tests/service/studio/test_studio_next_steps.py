"""A page with nothing to show says what to do next: as a button, and as a command that can be copied."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from foreign_tables import semicolons
from playwright.sync_api import expect
from realtime_support import eventually, free_endpoint, part_of_service
from studio_support import Open, moving, serious
from test_studio_pages import PAGES
from unpacked_example import unpacked_example

from glovecal_client.rest import RestClient
from glovecal_client.session import open_client
from glovecal_service.serve import real_time, web
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
WITHOUT_A_MODEL = ["compare", "diagnose", "fall", "models"]
EVERY_PAGE = [*PAGES, "jobs"]
SOME_PAGES = ["start", "capture", "takes", "diagnose", "models"]
"""The line is the shell's, the same on all: those that have more to say, or lead to themselves."""


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


@pytest.fixture(scope="module")
def with_a_glove(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A service that a glove streams to, and that knows nothing else."""
    port = int(free_endpoint().rpartition(":")[2])
    settings = Settings(
        data=tmp_path_factory.mktemp("glove") / "data", zenoh=free_endpoint(), port=port, workers=1
    )
    with part_of_service(real_time, settings), part_of_service(web, settings):
        address = f"http://127.0.0.1:{port}"
        with (
            open_client([settings.zenoh], wait_s=60) as session,
            moving(session, settings, "g1", None),
            RestClient(address) as client,
        ):
            eventually(lambda: client.get("/gloves")["seen"], "the glove is seen")
            yield address


def steps(
    opened: Open, at: str, query: str = "", pages: Sequence[str] = SOME_PAGES
) -> Iterator[tuple[str, str, str]]:
    """Of ``pages``: its name, what it says comes next, and where its button leads, "" where it has none."""
    page = opened("start", at=at).page
    for name in pages:
        page.goto(f"{at}/studio/{name}{query}")
        line = page.get_by_role("note", name="Next step")
        either = line.or_(page.get_by_role("region", name="What to do next"))
        shown = either.locator("visible=true").first
        expect(shown).to_be_visible()
        link = shown.get_by_role("link")
        says, leads = shown.inner_text(), ""
        if link.count():
            leads = (link.first.get_attribute("href") or "").removeprefix("/studio/").removeprefix("/")
        yield name, says, leads


def test_with_nothing_every_page_says_what_is_next(opened: Open, empty: str) -> None:
    for name, says, leads in steps(opened, empty, pages=EVERY_PAGE):
        assert "Drop a recording of a glove on any page of the studio." in says, name
        assert leads == "takes" or name == "takes", name


def test_with_a_glove_pages_say_how_to_calibrate_it(opened: Open, with_a_glove: str) -> None:
    for name, says, leads in steps(opened, with_a_glove):
        assert "Glove g1 has no calibration yet: hold poses with known angles." in says, name
        assert leads == "capture" or name == "capture", name


@pytest.fixture(scope="module")
def with_models(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A service whose takes are older than their models."""
    port = int(free_endpoint().rpartition(":")[2])
    data = unpacked_example(tmp_path_factory.mktemp("models"))
    with part_of_service(web, Settings(data=data, zenoh=free_endpoint(), port=port, workers=1)):
        yield f"http://127.0.0.1:{port}"


def test_with_a_model_pages_say_what_it_lacks(opened: Open, with_models: str) -> None:
    with RestClient(with_models) as client:
        model = max(client.get("/models"), key=lambda each: len(each["effects"]))["id"]
    for name, says, leads in steps(opened, with_models, f"?model={model}"):
        assert f"What model {model[:12]} of " in says, name
        assert leads == f"diagnose?model={model}" or name == "diagnose", name


def test_a_model_with_a_better_version_leads_to_the_fall_of_the_error(
    opened: Open, with_models: str, trained: str
) -> None:
    page = opened(f"diagnose?model={trained}", at=with_models).page
    line = page.get_by_role("note", name="Next step")
    expect(line).to_contain_text("degrees, its version ")
    line.get_by_role("link", name="See the error fall").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Error fall")
    expect(page.get_by_text("The error falls from").first).to_be_visible()


def test_with_takes_the_next_step_is_training(opened: Open, empty: str, tmp_path: Path) -> None:
    [path] = semicolons(tmp_path, 4, seconds=3.0)
    with RestClient(empty) as client:
        file = {"upload": client.upload(path), "filename": path.name}
        seen = client.post("/takes/preview", file)
        body = {"subject": "dora", "create_subject": True, "mapping": seen["mapping"]}
        client.post("/takes/import", file | body)
    for name, says, leads in steps(opened, empty):
        assert "4 takes of dora can teach a model." in says, name
        assert leads == "takes" or name == "takes", name
    for name in WITHOUT_A_MODEL:
        page = opened(name, at=empty).page
        expect(page.get_by_text("glovecal train --subject dora", exact=True)).to_be_visible()
    page = opened("models", at=empty).page
    steps_of_page = page.get_by_role("region", name="What to do next")
    steps_of_page.get_by_role("link", name="Train a model").click()
    expect(page.get_by_role("button", name="Train on 4 takes")).to_be_visible()
