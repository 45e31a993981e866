"""A recording of an unknown glove, dropped on a page: what it is, imported, trained, explained."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from dropping import drop
from foreign_tables import SHAPES, laboratory, logger, semicolons
from playwright.sync_api import Browser, FloatRect, Locator, Page, expect
from studio_support import PATIENCE_MS, Open, serious

from glovecal_client.rest import RestClient

pytestmark = pytest.mark.needs_chromium
MOST_CLICKS = 8
JOB_PATIENCE_MS = 400_000
"""For what a job makes, after those of other tests."""
NAMED = "hysteresis"
"""What a play between joint and strip is to Glovecal."""


@pytest.fixture(scope="module")
def client(address: str) -> Iterator[RestClient]:
    with RestClient(address) as client:
        yield client


class Clicks:
    """Of the mouse, counted."""

    def __init__(self) -> None:
        self.count = 0

    def on(self, page: Page, role: str, name: str) -> None:
        what = page.get_by_role(role, name=name, exact=False)  # pyright: ignore[reportArgumentType]
        what.first.click(timeout=JOB_PATIENCE_MS)
        self.count += 1


def from_the_drop_to_the_effect(page: Page, files: Sequence[Path], subject: str, takes: int) -> int:
    """How many clicks it took."""
    clicks = Clicks()
    drop(page, files)
    page.get_by_label("Whose takes").fill(subject)
    clicks.on(page, "button", f"Import {takes} takes")
    expect(page.get_by_role("heading", name=f"Train a model of {subject}")).to_be_visible()
    clicks.on(page, "button", f"Train on {takes} takes")
    clicks.on(page, "button", "Which effect is missing?")
    clicks.on(page, "button", f"Add {NAMED}")
    added = page.get_by_role("heading", name=f"{NAMED} was added")
    expect(added).to_be_visible(timeout=JOB_PATIENCE_MS)
    return clicks.count


def test_a_foreign_table_becomes_a_model_and_its_effect(
    opened: Open, client: RestClient, tmp_path: Path
) -> None:
    seen = opened("diagnose")
    files = semicolons(tmp_path, 6, seconds=20.0)
    assert from_the_drop_to_the_effect(seen.page, files, "dora", 6) <= MOST_CLICKS
    *_, before, after = client.get("/models", {"subject": "dora"})
    assert after["effects"] == [NAMED]
    assert after["held_out_rmse_deg"] < 0.8 * before["held_out_rmse_deg"]
    page = opened("takes?who=dora").page
    expect(page.get_by_text("Gaussian process for the rest. Last time: ")).to_contain_text(" s, 6 takes.")
    assert not before["active"], "nothing is activated unasked"
    assert seen.complaints == []


def test_improving_shows_the_error_fall_step_by_step(
    opened: Open, client: RestClient, tmp_path: Path
) -> None:
    seen = opened("takes")
    page = seen.page
    drop(page, semicolons(tmp_path, 6, seconds=21.0))
    page.get_by_label("Whose takes").fill("ida")
    page.get_by_role("button", name="Import 6 takes").click()
    page.get_by_text("Linear: ").click()
    page.get_by_role("button", name="Improve").click()
    chart = page.get_by_role("img", name="Held-out error of each step so far")
    expect(chart).to_be_visible(timeout=JOB_PATIENCE_MS)
    expect(page.get_by_text("being made")).to_be_visible(timeout=JOB_PATIENCE_MS)
    follow = page.get_by_role("button", name="See the error fall")
    expect(follow).to_be_visible(timeout=JOB_PATIENCE_MS)
    expect(chart).to_be_visible()
    expect(page.get_by_text("being made")).to_be_hidden()
    assert NAMED in client.get("/models", {"subject": "ida"})[1]["effects"]
    assert serious(page) == []
    follow.click()
    expect(page.get_by_text("The error falls from").first).to_contain_text(NAMED)
    assert seen.complaints == []


@pytest.mark.slow
@pytest.mark.parametrize("write", SHAPES)
def test_twelve_takes_of_any_shape(opened: Open, tmp_path: Path, write: Callable[..., list[Path]]) -> None:
    page = opened("live").page
    assert from_the_drop_to_the_effect(page, write(tmp_path), f"dora-{write.__name__}", 12) <= MOST_CLICKS


def test_files_of_one_shape_are_read_alike_and_corrected_at_once(
    opened: Open, client: RestClient, tmp_path: Path
) -> None:
    seen = opened("takes")
    page = seen.page
    drop(page, logger(tmp_path, 3, seconds=4.0))
    expect(page.get_by_role("button", name="Import 3 takes")).to_be_enabled()
    page.get_by_text("Columns: how they are read").click()
    page.get_by_label("Name of joint1").fill("joint2")
    expect(page.get_by_role("alert")).to_contain_text("would be r.joint2, as 'joint1' is")
    expect(page.get_by_role("button", name="Import 0 takes")).to_be_disabled()
    page.get_by_label("Name of joint1").fill("I_PIP")
    expect(page.get_by_role("button", name="Import 3 takes")).to_be_enabled()
    page.get_by_label("Whose takes").fill("emil")
    page.get_by_role("button", name="Import 3 takes").click()
    expect(page.get_by_role("button", name="Train on 3 takes")).to_be_visible()
    takes = client.get("/takes", {"subject": "emil"})
    assert [take["rotations"][1] for take in takes] == ["I_PIP"] * 3
    assert [take["wearing"] for take in takes] == ["w1"] * 3
    assert seen.complaints == []


def test_wrong_files_get_a_sentence_each_and_the_right_one_is_shown(opened: Open, tmp_path: Path) -> None:
    page = opened("compare").page
    (tmp_path / "hand.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(64))
    (tmp_path / "notes.txt").write_text("to do: glue the ring finger\n")
    [right] = laboratory(tmp_path, 2, seconds=3.0)
    rows = "".join(f"{i / 50},{7 * i % 70},{i % 90}.5\n" for i in range(90))
    (tmp_path / "odd.csv").write_text(f'seconds,"x"" innerHTML=""<b>",angle\n{rows}')
    drop(page, [tmp_path / "hand.png", right, tmp_path / "notes.txt", tmp_path / "odd.csv"])
    expect(page.get_by_role("button", name="Import 2 takes")).to_be_visible()
    expect(page.get_by_text("hand.png: not a table")).to_be_visible()
    expect(page.get_by_text("notes.txt: no table of numbers")).to_be_visible()
    page.get_by_text("Columns: how they are read").first.click()
    expect(page.get_by_text("it counts the rows")).to_be_visible()
    page.get_by_text("Columns: how they are read").last.click()
    expect(page.get_by_label('Name of x" innerHTML="<b>', exact=True)).to_be_visible()
    assert serious(page) == []


def test_a_model_dropped_on_a_page_is_imported(opened: Open, client: RestClient, tmp_path: Path) -> None:
    model = next(each for each in client.get("/models") if each["method"] == "lmc_gpr")
    file = tmp_path / "hers.safetensors"
    file.write_bytes(client.download(f"/models/{model['id']}/export"))
    page = opened("jobs").page
    drop(page, [file])
    expect(page.get_by_text(f"of {model['subject']} was here already")).to_be_visible()


def test_a_take_is_looked_at_with_another_over_it(opened: Open, client: RestClient) -> None:
    first, *others = client.get("/takes")
    second = next(each for each in others if each["subject"] == first["subject"])
    seen = opened(f"take?id={first['id']}&beside={second['id']}")
    page = seen.page
    expect(page.get_by_role("heading", name=first["name"])).to_be_visible()
    chart = page.get_by_role("img", name=f"Readings and reference of take {first['name']}")
    page.wait_for_function(
        "bands => document.querySelector('.take-plot canvas')?.clientHeight > 60 * bands",
        arg=len(first["sensors"]) + len(first["rotations"]),
    )
    before = chart.screenshot()
    page.get_by_role("button", name="Spectra of the readings").click()
    page.wait_for_function(
        "bands => document.querySelector('.take-plot canvas')?.clientHeight < 150 + 100 * bands",
        arg=len(first["sensors"]),
    )
    assert chart.screenshot() != before
    chosen = page.get_by_role("button", name="Spectra of the readings")
    expect(chosen).to_have_css("background-color", "rgb(48, 63, 159)")  # its colour fades in
    assert serious(page) == []
    assert seen.complaints == []
    missing = opened("take?id=0000").page
    expect(missing.get_by_text("There is no take 0000.")).to_be_visible()


TIPS = "view => getElement(view).places().tips.index"
"""Where the index finger's tip is, mm."""


def hand_of(page: Page) -> int:
    """The id of the hand's element."""
    return int(page.locator(".take-hand").get_attribute("id").removeprefix("c"))  # pyright: ignore


def box_of(what: Locator) -> FloatRect:
    """Where it is on the page."""
    box = what.bounding_box()
    assert box is not None
    return box


def stand_at(page: Page, seconds: float) -> list[float]:
    """Move the slider there; where the index finger's tip is then."""
    slider = page.get_by_role("slider", name="Moment of the take")
    slider.fill(str(seconds))
    expect(slider).to_have_attribute("aria-valuetext", re.compile(f"^{seconds:.2f} of"))
    replay = page.locator(".take-replay").get_attribute("id")
    page.wait_for_function(
        "([replay, at]) => getElement(replay.slice(1)).part(at)", arg=[replay, seconds]
    )  # longer takes come in parts
    return page.evaluate(TIPS, hand_of(page))


def test_the_hand_of_a_take_is_replayed_in_step_with_its_curves(opened: Open, client: RestClient) -> None:
    take = client.get("/takes")[0]
    part = client.get(f"/takes/{take['id']}/hand")
    bends = [sum(row) for row in part["values"]]
    straight, bent = (part["time_s"][bends.index(extreme(bends))] for extreme in (min, max))
    seen = opened(f"take?id={take['id']}")
    page = seen.page
    expect(
        page.get_by_text(f"Measured: {len(take['rotations'])} rotations; all others rest.")
    ).to_be_visible()
    line = page.locator(".take-cursor")
    expect(line).to_be_visible()
    places, lines = [], []
    for at in (straight, bent):
        places.append(stand_at(page, round(20 * at) / 20))
        lines.append(box_of(line))
    assert abs(places[0][0] - places[1][0]) > 40, "a bent finger's tip is nearer to the wrist"
    assert (lines[0]["x"] < lines[1]["x"]) == (straight < bent)
    stand_at(page, 0.0)
    began = box_of(line)["x"]
    page.get_by_label("Speed").select_option("4")
    page.get_by_role("button", name="Play").click()
    page.wait_for_function("document.querySelector('.take-replay .replay-slider').value > 4")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play", exact=True).wait_for()
    assert box_of(line)["x"] > began + 100
    at = page.get_by_role("slider", name="Moment of the take")
    plot = box_of(page.locator(".take-plot"))
    page.mouse.click(plot["x"] + 0.5 * plot["width"], plot["y"] + 60)
    expect(at).to_have_attribute("aria-valuetext", re.compile(r"^[456]\.\d\d of"))
    assert serious(page) == []
    assert seen.complaints == []


def test_a_stretch_is_left_out_and_used_again(opened: Open, client: RestClient) -> None:
    take = client.get("/takes")[1]
    seen = opened(f"take?id={take['id']}")
    page = seen.page
    page.locator(".take-plot canvas").wait_for()
    stand_at(page, 2.0)
    page.get_by_role("button", name="From here").click()
    expect(page.get_by_label("From, s")).to_have_value("2")
    page.get_by_label("To, s").fill("4.5")
    expect(page.locator(".take-marked")).to_be_visible()
    page.get_by_role("button", name="Leave out", exact=True).click()
    expect(page.get_by_text("Left out: 2.00 to 4.50 s")).to_be_visible()
    assert client.get(f"/takes/{take['id']}")["left_out"] == [[2.0, 4.5]]
    expect(page.locator(".take-marked")).to_be_hidden()

    plot = page.locator(".take-plot")
    plot.scroll_into_view_if_needed()
    box = box_of(plot)
    page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.8 * box["width"], box["y"] + 70, steps=4)
    page.mouse.up()
    expect(page.get_by_label("To, s")).not_to_have_value("")
    page.get_by_role("button", name="Leave out", exact=True).click()
    expect(page.get_by_role("button", name="again")).to_have_count(2)

    again = opened(f"take?id={take['id']}").page
    expect(again.get_by_text("Left out: 2.00 to 4.50 s")).to_be_visible()
    again.get_by_role("button", name="Undo: use 2.00 to 4.50 s again").click()
    expect(again.get_by_role("button", name="again")).to_have_count(1)
    again.get_by_role("button", name="again").click()
    expect(again.get_by_role("button", name="again")).to_have_count(0)
    assert client.get(f"/takes/{take['id']}")["left_out"] == []
    again.get_by_role("button", name="Leave out", exact=True).click()
    expect(again.get_by_text("Say from when to when")).to_be_visible()
    assert serious(again) == []
    assert seen.complaints == []


def test_the_raw_hand_moves_where_nothing_was_measured(
    opened: Open, client: RestClient, tmp_path: Path
) -> None:
    rows = "".join(f"{i / 50:.2f},300,{400 + 200 * math.sin(i / 40):.0f}\n" for i in range(3000))
    (tmp_path / "bare.csv").write_text(f"time_s,s.I_MCP,s.I_PIP\n{rows}")
    client.post("/subjects", {"name": "bare"})
    layout = client.get("/takes")[0]["layout"]
    [take] = client.upload_takes(tmp_path / "bare.csv", subject="bare", layout=layout)["takes"]
    seen = opened(f"take?id={take['id']}")
    page = seen.page
    expect(page.get_by_text("Nothing was measured, and there is no model: readings alone.")).to_be_visible()
    tips = []
    for at in (1.25, 3.75, 41.45):  # the greatest reading, the least one; the greatest again, in another part
        stand_at(page, at)
        tips.append(page.evaluate("view => getElement(view).placesOfRaw().tips.index", hand_of(page)))
    assert abs(tips[0][0] - tips[1][0]) > 20
    assert tips[0] == pytest.approx(tips[2], abs=1.0)
    assert len([url for url in seen.asked if "/hand?" in url]) == 2
    assert seen.complaints == []


def test_a_stretch_is_left_out_by_touch_on_a_phone(
    browser: Browser, address: str, client: RestClient
) -> None:
    take = client.get("/takes")[2]
    context = browser.new_context(viewport={"width": 390, "height": 844}, has_touch=True)
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(f"{address}/studio/take?id={take['id']}")
    page.get_by_text(f"Measured: {len(take['rotations'])} rotations; all others rest.").wait_for()
    plot = page.locator(".take-plot")
    plot.scroll_into_view_if_needed()
    box = box_of(plot)
    page.touchscreen.tap(box["x"] + 0.7 * box["width"], box["y"] + 60)
    at = page.get_by_role("slider", name="Moment of the take")
    expect(at).not_to_have_attribute("aria-valuetext", re.compile(r"^0\.00 of"))
    page.get_by_role("button", name="To here").tap()
    stand_at(page, 1.5)
    page.get_by_role("button", name="From here").tap()
    expect(page.get_by_label("From, s")).to_have_value("1.5")
    page.get_by_role("button", name="Leave out", exact=True).tap()
    page.get_by_role("button", name="again").tap()
    expect(page.get_by_role("button", name="again")).to_have_count(0)
    assert client.get(f"/takes/{take['id']}")["left_out"] == []
    context.close()
