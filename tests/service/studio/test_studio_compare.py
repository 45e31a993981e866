"""The Compare page shows what REST answers; its charts, its cursors and its hand, by mouse and keyboard."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlparse

import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect
from studio_support import Open, Opened

from glovecal_client.rest import RestClient

pytestmark = pytest.mark.needs_chromium
TAKES = ("w2-t3", "w3-t2")


@pytest.fixture(scope="module")
def client(address: str) -> Iterator[RestClient]:
    with RestClient(address) as client:
        yield client


@pytest.fixture(scope="module")
def takes(client: RestClient) -> list[str]:
    """Ids of two takes of the stored example."""
    ids = {take["name"]: take["id"] for take in client.get("/takes") if take["subject"] == "anna"}
    return [ids[name] for name in TAKES]


@pytest.fixture(scope="module")
def corrected(client: RestClient) -> dict:
    """A model with an effect, so that its angles have more than one term."""
    return next(model for model in client.get("/models") if model["effects"] and model["method"] == "lmc_gpr")


def filled(opened: Open, address: str) -> Opened:
    seen = opened(address)
    for selector in (".stretch", ".term-table", ".rotation-button"):
        seen.page.locator(selector).first.wait_for()
    return seen


def asked(page: Page) -> dict[str, str]:
    """What the page's address holds now."""
    return {name: value for name, [value] in parse_qs(urlparse(page.url).query).items()}


def cells(page: Page, row: str) -> list[str]:
    return page.locator(f"{row} > *").all_inner_texts()


def chart(page: Page) -> dict:
    return page.evaluate("getElement(document.querySelector('.time-chart').id.slice(1)).state()")


def number(text: str) -> float:
    return float(text.rstrip("°").split()[0].rstrip("°"))


def cursor(page: Page, name: str) -> Locator:
    return page.get_by_role("slider", name=f"Cursor {name}")


def test_opened_without_a_choice_it_shows_the_active_model_and_its_worst_rotation(
    opened: Open, client: RestClient
) -> None:
    subjects = {(take["subject"], take["layout"]) for take in client.get("/takes")}
    models = [one for one in client.get("/models") if (one["subject"], one["layout"]) in subjects]
    who = models[-1]["subject"]
    own = [one for one in client.get("/models") if one["subject"] == who]
    chosen = next((one for one in reversed(own) if one["active"]), own[-1])
    newest = chosen if chosen in models else [one for one in models if one["subject"] == who][-1]
    seen = filled(opened, f"compare?who={who}")
    page = seen.page
    link = asked(page)
    assert newest["id"].startswith(link["models"])
    answer = client.post(f"/models/{newest['id']}/compare", {"takes": link["takes"].split(",")})
    ceilings = set()
    for name, errors in [("all rotations", answer["overall"]), *answer["rotations"].items()]:
        _, error, floor, ceiling, baseline = cells(page, f'tr[data-rotation="{name}"]')
        ceilings.add(ceiling)
        assert error.split()[0] == f"{errors['rmse_deg']:.2f}°"
        assert f"{errors['rmse_deg'] / errors['floor']['floor_deg']:.1f} × floor" in error
        assert f"{errors['floor']['floor_deg']:.2f}°" in floor
        assert ceiling == "–" or ceiling.endswith("°")
        assert baseline == f"{errors['baseline_deg']:.2f}°"
    worst = max(answer["rotations"], key=lambda name: answer["rotations"][name]["rmse_deg"])
    assert link["rotation"] == worst
    expect(page.get_by_role("button", name=worst, exact=True)).to_have_attribute("aria-pressed", "true")
    expect(page.get_by_role("button", name="Find the ceiling")).to_be_visible(visible=ceilings == {"–"})
    assert seen.complaints == []


def test_cursors_tell_values_and_differences_by_keyboard_and_series_stand_alone(
    opened: Open, client: RestClient, corrected: dict, takes: list[str]
) -> None:
    model = corrected["id"]
    other = next(
        one["id"] for one in client.get("/models") if one["method"] == "linear" and not one["parent"]
    )
    page = filled(
        opened, f"compare?models={model[:12]},{other[:12]}&takes={','.join(takes)}&rotation=I_PIP"
    ).page
    both = [
        client.post(f"/models/{each}/series", {"takes": takes, "rotation": "I_PIP"})["takes"]
        for each in (model, other)
    ]
    cursor(page, "A").focus()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    cursor(page, "B").focus()
    page.keyboard.press("Home")
    for _ in range(3):
        page.keyboard.press("Shift+ArrowRight")
    rows = {name: cells(page, f'tr[data-cursor="{name}"]') for name in ("A", "B", "B − A")}
    at = {"A": 1, "B": int(np.searchsorted(both[0][0]["time_s"], both[0][0]["time_s"][0] + 3.0 - 1e-6))}
    for name, frame in at.items():
        first, second = (series[0] for series in both)
        assert rows[name][1] == TAKES[0]
        values = [
            first["measured_deg"], first["predicted_deg"], first["error_deg"],
            second["predicted_deg"], second["error_deg"],
        ]  # fmt: skip
        shown = [number(text) for text in rows[name][3:]]
        np.testing.assert_allclose(shown, [column[frame] for column in values], atol=0.006)
    seconds = both[0][0]["time_s"][at["B"]] - both[0][0]["time_s"][at["A"]]
    assert number(rows["B − A"][2]) == pytest.approx(seconds, abs=0.0011)
    differences = [number(text) for text in rows["B − A"][3:]]
    right = [number(b) - number(a) for a, b in zip(rows["A"][3:], rows["B"][3:], strict=True)]
    np.testing.assert_allclose(differences, right, atol=0.011)

    every = ["predicted 0", "error 0", "predicted 1", "error 1", "measured"]
    assert sorted(chart(page)["series"]) == sorted(every)
    alone = page.locator(".chart-series", has_text="Error").last
    alone.click()
    assert chart(page)["series"] == ["error 1"]
    expect(alone).to_have_attribute("aria-pressed", "true")
    alone.press("Enter")
    assert sorted(chart(page)["series"]) == sorted(every)

    page.get_by_role("button", name="Zoom in").press("Enter")
    begin, end = chart(page)["shown"]
    assert end - begin == pytest.approx(0.5 * (both[0][1]["linked_s"] + 11.95), rel=0.01)
    page.get_by_role("button", name="Click sets B").click()
    page.locator(".time-plot").click(position={"x": 300, "y": 150})
    assert begin < chart(page)["at"]["B"] < end


def test_a_bad_stretch_is_replayed_on_the_hand_beside_its_ghost(
    opened: Open, client: RestClient, corrected: dict, takes: list[str]
) -> None:
    model = corrected["id"]
    stretches = client.post(f"/models/{model}/where", {"takes": takes})["stretches"]
    chosen, stretch = len(stretches) - 1, stretches[-1]
    rotation = stretch["rotation"]
    [other] = {"I_MCP", "I_PIP"} - {rotation}
    seen = filled(opened, f"compare?models={model}&takes={','.join(takes)}&rotation={other}")
    page = seen.page
    page.emulate_media(reduced_motion="no-preference")  # a replay begins by itself
    shown = page.locator(".stretch")
    expect(shown).to_have_count(len(stretches))
    expect(shown.nth(chosen)).to_contain_text(f"{rotation} {stretch['rotation_rmse_deg']:.2f}°")
    canvas = page.locator(".compare-hand canvas")
    page.wait_for_timeout(300)
    before = canvas.screenshot()
    shown.nth(chosen).press("Enter")
    body = {"take": takes[stretch["number"]], "from_s": stretch["start_s"], "to_s": stretch["end_s"]}
    answer = client.post(f"/models/{model}/replay", body)
    expect(page.get_by_text(answer["sentence"])).to_be_visible()
    slider = page.get_by_role("slider", name="Moment of the stretch")
    expect(slider).to_have_value(str(len(answer["time_s"]) - 1))
    assert canvas.screenshot() != before
    played = canvas.screenshot()
    slider.focus()
    page.keyboard.press("Home")
    expect(page.locator(".tips li", has_text="index")).to_contain_text(
        f"{answer['tips_mm']['index'][0]:.1f} mm"
    )
    page.wait_for_timeout(300)
    assert canvas.screenshot() != played
    expect(page.get_by_role("button", name=rotation, exact=True)).to_have_attribute("aria-pressed", "true")
    begin, end = chart(page)["shown"]
    assert begin < chart(page)["at"]["A"] < chart(page)["at"]["B"] < end
    assert asked(page)["rotation"] == rotation

    moment = {"take": body["take"], "at_s": body["from_s"], "rotations": [rotation]}
    [angle] = client.post(f"/models/{model}/explain", moment)["rotations"]
    for term in angle["terms"]:
        expect(page.locator(".term-table tr", has_text=term["name"]).first).to_be_visible()
    expect(page.locator(".term-sum")).to_contain_text(f"{angle['degrees']:.2f}°")
    assert seen.complaints == []


def test_moving_cursor_a_explains_that_moment_and_a_column_is_chosen(
    opened: Open, client: RestClient, corrected: dict, takes: list[str]
) -> None:
    model = corrected["id"]
    page = filled(opened, f"compare?models={model[:12]}&takes={TAKES[0]}&rotation=I_PIP&column=speed").page
    body = {"takes": takes[:1], "rotation": "I_PIP"}
    by_speed = client.post(f"/models/{model}/residual", body | {"column": "speed"})["sentence"]
    expect(page.get_by_text(by_speed)).to_be_visible()
    page.get_by_role("combobox", name="Column").click()
    page.get_by_role("option", name="The angle of I_MCP").click()
    by_joint = client.post(f"/models/{model}/residual", body | {"column": "joint I_MCP"})["sentence"]
    expect(page.get_by_text(by_joint)).to_be_visible()
    assert asked(page)["column"] == "joint I_MCP"

    cursor(page, "A").press("End")
    series = client.post(f"/models/{model}/series", body)["takes"][0]
    moment = {"take": takes[0], "at_s": series["time_s"][-1], "rotations": ["I_PIP"]}
    [angle] = client.post(f"/models/{model}/explain", moment)["rotations"]
    expect(page.locator(".term-sum")).to_contain_text(f"{angle['degrees']:.2f}°")


def test_a_take_of_another_layout_is_refused_and_names_are_text(
    opened: Open, client: RestClient, corrected: dict, takes: list[str], tmp_path: Path
) -> None:
    layout = tmp_path / "lone.toml"
    layout.write_text('name = "lone"\nsensors = ["W_FLEX"]\n[rotations]\nW_FLEX = ["W_FLEX"]\n')
    client.add_layout(layout)
    file = tmp_path / "<b>lone<b>.csv"
    time = np.arange(60) / 60
    np.savetxt(
        file, np.column_stack([time, 100 + time, time]), delimiter=",", header="time_s,s.W_FLEX,r.W_FLEX",
        comments="",
    )  # fmt: skip
    [lone] = client.upload_takes(file, subject="anna", layout="lone")["takes"]
    page = filled(opened, f"compare?models={corrected['id'][:12]},123456&takes={takes[0]},{lone['id']}").page
    notice = page.locator(".compare-notice")
    expect(notice).to_contain_text("There is no model 123456. take '<b>lone<b>' has no sensor 'I_MCP'")
    assert lone["id"] not in asked(page)["takes"]
    page.get_by_role("combobox", name="Takes").click()
    option = page.get_by_role("option", name="<b>lone<b>")
    expect(option).to_contain_text("layout lone")
    before = asked(page)
    option.click()
    expect(notice).to_contain_text("which layout")
    assert asked(page) == before
