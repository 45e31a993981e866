"""From a diagnosis that cannot decide to the recording of its plan: a real browser, service and capture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import pytest
from playwright.sync_api import Page, expect
from realtime_support import eventually, part_of_service
from studio_support import Open, serious

from glovecal_client.rest import RestClient
from glovecal_models.simulation.session import record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.write_table import write_takes
from glovecal_service.demo.processes import DemoPlace, running_capture
from glovecal_service.serve import recorder
from glovecal_service.settings import Settings

pytestmark = pytest.mark.needs_chromium
SUBJECT, GLOVE = "wanda", "wanted-right"
SESSION = SessionPlan(
    seed=4, sensors=("I_MCP", "I_PIP", "M_MCP"), wearings=1, takes_per_wearing=4, take_s=6.0
)


@dataclass(frozen=True)
class Undecided:
    """The service, a model of few short takes, and what its diagnosis answered."""

    client: RestClient
    model: str
    plan: dict[str, Any]


@pytest.fixture(scope="module")
def undecided(
    settings: Settings, address: str, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Undecided]:
    """A glove streams on and on, whose subject recorded four takes of 6 s."""
    folder = tmp_path_factory.mktemp("wanted")
    session = record_session(SESSION)
    write_takes(session.takes, folder / "few.csv")
    write_takes([session.also("natural", 20.0, 0).take], folder / "more.csv")
    with ExitStack() as running:
        client = running.enter_context(RestClient(address))
        client.post("/subjects", {"name": SUBJECT})
        few = client.upload_takes(folder / "few.csv", subject=SUBJECT)
        running.enter_context(part_of_service(recorder, settings))
        running.enter_context(
            running_capture(
                DemoPlace(folder, settings.zenoh, settings.port),
                device=f"replay:{folder / 'more.csv'}",
                glove=GLOVE,
                subject=SUBJECT,
                wearing="wearing-1",
                options={"layout": few["layout"], "loop": "yes"},
            )
        )
        body = {"subject": SUBJECT, "method": "linear", "takes": [take["id"] for take in few["takes"]]}
        trained = result_of(client, client.post("/models/train", body))
        answer = result_of(client, client.post(f"/models/{trained['model']}/diagnose", {}))
        eventually(lambda: GLOVE in [each["name"] for each in client.get("/gloves")["seen"]], "it is seen")
        yield Undecided(client, trained["model"], answer["take_plan"])


def result_of(client: RestClient, job: dict[str, Any]) -> dict[str, Any]:
    def finished() -> dict[str, Any] | None:
        now = client.get(f"/jobs/{job['id']}")
        assert now["state"] not in ("failed", "cancelled"), now
        return now if now["state"] == "done" else None

    return eventually(finished, f"job {job['kind']}", 180.0)["result"]


def recorded(page: Page, name: str) -> None:
    """Two seconds of what the page is filled in for."""
    page.get_by_label("Stop after, s").fill("2")
    page.keyboard.press("Tab")
    page.evaluate("document.activeElement.blur()")
    page.keyboard.press("Space")
    page.get_by_role("heading", name=f"{name}: done").wait_for()


def test_a_plan_is_recorded_take_by_take(opened: Open, undecided: Undecided) -> None:
    first, anew = undecided.plan["steps"]
    assert (first["take_names"], anew["is_put_on_anew"]) == (["ramps"] * 3, True)
    seen = opened(f"diagnose?model={undecided.model}")
    page = seen.page
    section = page.locator("section.finding", has=page.get_by_role("heading", name="What to record next"))
    expect(section).to_contain_text("7 further takes (3 min 20 s in all) would decide more:")
    expect(section.locator("li").first).to_contain_text(first["what"])
    expect(page.get_by_text("Not judged")).to_be_visible()
    expect(page.locator(".reasons", has_text="permutations")).to_have_count(0)
    assert serious(page) == []
    section.get_by_role("button", name="Record them").click()
    page.get_by_role("heading", name="Take 1 of 7 that the diagnosis wants").wait_for()
    expect(page.locator(".board-ask")).to_have_text(first["what"])
    expect(page.get_by_label("Subject")).to_have_value(SUBJECT)
    expect(page.get_by_label("Name of the take")).to_have_value("ramps")
    expect(page.get_by_label("Stop after, s")).to_have_value(str(first["seconds"]))
    expect(page.get_by_label("Name of the new wearing")).to_be_hidden()
    assert serious(page) == []
    for following in range(2, 5):
        recorded(page, "ramps")
        page.get_by_role("heading", name=f"Take {following} of 7 that the diagnosis wants").wait_for()
    expect(page.get_by_text("Take the glove off and put it on again.")).to_be_visible()
    expect(page.get_by_label("Name of the take")).to_have_value(anew["take_names"][0])
    page.get_by_label("Name of the new wearing").fill("wearing-2")
    recorded(page, anew["take_names"][0])
    page.get_by_role("heading", name="Take 5 of 7 that the diagnosis wants").wait_for()
    page.reload()
    page.get_by_role("heading", name="Take 5 of 7 that the diagnosis wants").wait_for()
    expect(page.get_by_label("Name of the new wearing")).to_be_hidden()
    takes = undecided.client.get("/takes", {"subject": SUBJECT})
    wearings = [take["wearing"] for take in takes if take["name"] == "ramps"]
    assert wearings == ["wearing-1"] * 3
    assert [t["wearing"] for t in takes if t["name"] == anew["take_names"][0]] == ["wearing-2"]
    assert seen.complaints == []
