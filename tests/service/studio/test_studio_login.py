"""The studio of a service that asks who one is: a key typed once, and a page asks as who opened it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from dropping import LATE_S, drop, motion_file, takes_without_angles
from oidc_providers import CLIENT, SECRET, others_provider
from playwright.sync_api import Browser, expect
from realtime_support import free_endpoint, part_of_service, store_model
from studio_support import PATIENCE_MS, Open, serious

from glovecal_client.rest import RestClient
from glovecal_service.serve import web
from glovecal_service.settings import Settings
from glovecal_service.store.store import Store

pytestmark = pytest.mark.needs_chromium
PASSWORD, OTHER = "correct horse battery", "staple battery horse"


@pytest.fixture(scope="module")
def asking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, dict[str, str]]]:
    """The address, and keys by name; subjects anna and ben have a model each."""
    port = int(free_endpoint().rpartition(":")[2])
    data = tmp_path_factory.mktemp("asking") / "data"
    settings = Settings(data=data, zenoh=free_endpoint(), port=port, workers=1, login="always")
    with Store.open(settings) as store:
        for subject in ("anna", "ben"):
            store_model(store, subject, degrees_per_count=0.5)
        keys = {"of anna": store.keys.create("of-anna", "trainer", ["anna"])[1]}
        keys["training"] = store.keys.create("training", "trainer")[1]
        keys["looking"] = store.keys.create("looking", "viewer")[1]
        store.people.create("lena", "viewer", password=PASSWORD)
    with ExitStack() as running:
        running.enter_context(part_of_service(web, settings))
        yield f"http://127.0.0.1:{port}", keys


def test_a_key_is_typed_once_and_pages_show_what_is_its(
    browser: Browser, asking: tuple[str, dict[str, str]], tmp_path: Path
) -> None:
    address, keys = asking
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme="dark")
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"{address}/studio/models")
    expect(page).to_have_url(f"{address}/login?page=/studio/models")
    page.get_by_label("Your key").fill("glk_wrong")
    page.get_by_role("button", name="Log in with a key").click()
    expect(page.get_by_role("alert")).to_contain_text("no key of this service")
    page.get_by_label("Your key").fill(keys["of anna"])
    page.get_by_role("button", name="Log in with a key").click()
    expect(page).to_have_url(f"{address}/studio/models")
    expect(page.get_by_role("heading", name="Models", level=1)).to_be_visible()
    expect(page.get_by_text("anna").first).to_be_visible()
    expect(page.get_by_text("ben", exact=True)).to_have_count(0)
    page.get_by_role("button", name="Log out").click()
    expect(page).to_have_url(f"{address}/login?page=/studio/start")
    assert complaints == []
    context.close()


def test_a_part_of_a_page_that_clears_itself_asks_on_as_who_opened_it(
    browser: Browser, asking: tuple[str, dict[str, str]], tmp_path: Path
) -> None:
    address, keys = asking
    with RestClient(address, key=keys["training"]) as client:
        angles = takes_without_angles(client, "mona", tmp_path, first=30)
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(f"{address}/login?page=/studio/takes%3Fwho=mona")
    page.get_by_label("Your key").fill(keys["training"])
    page.get_by_role("button", name="Log in with a key").click()
    drop(page, [motion_file(tmp_path / "optical.trc", angles[1], from_s=LATE_S)])
    page.get_by_role("button", name="Attach to the take").click()
    expect(page.get_by_role("heading", name="Train a model of mona")).to_be_visible()
    context.close()


def test_who_may_look_only_is_told_so(browser: Browser, asking: tuple[str, dict[str, str]]) -> None:
    address, keys = asking
    context = browser.new_context(viewport={"width": 1280, "height": 800})
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(f"{address}/login?page=/studio/start")
    page.get_by_label("Your key").fill(keys["looking"])
    page.get_by_role("button", name="Log in with a key").click()
    expect(page.get_by_role("heading", level=1)).to_be_visible()
    page.get_by_role("button", name="simulated glove").first.click()
    expect(page.get_by_text("Key looking is of a viewer; this needs operator")).to_be_visible()
    context.close()


def test_an_admin_makes_and_revokes_keys_and_sees_who_changed_what(opened: Open) -> None:
    seen = opened("access")
    page = seen.page
    page.get_by_label("Name of the key").fill("guest")
    page.get_by_role("button", name="Make a key").click()
    made = page.get_by_label("The key; it is not shown again")
    expect(made).to_have_value(re.compile("glk_.+"))
    expect(page.get_by_role("cell", name="keys guest")).to_be_visible()
    expect(page.get_by_role("cell", name="studio 127.0.0.1").first).to_be_visible()
    assert serious(page) == []
    page.get_by_role("button", name="Make a key").click()
    expect(page.get_by_text("names are not used again")).to_be_visible()
    page.get_by_role("button", name="Revoke guest").click()
    expect(page.get_by_text("Key guest is revoked")).to_be_visible()
    expect(page.get_by_role("button", name="Revoke guest")).to_have_count(0)
    page.get_by_role("button", name="Look whether the log is what was written").click()
    expect(page.get_by_text(re.compile("[0-9]+ entries, each as it was written"))).to_be_visible()
    assert seen.complaints == []


def test_a_name_and_a_password_are_typed_and_the_password_is_changed(
    browser: Browser, asking: tuple[str, dict[str, str]]
) -> None:
    address, _ = asking
    context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme="dark")
    context.set_default_timeout(PATIENCE_MS)
    page = context.new_page()
    page.goto(f"{address}/studio/models")
    assert serious(page) == []
    page.get_by_label("Name").fill("lena")
    page.get_by_label("Password").fill("wrong wrong wrong")
    page.get_by_role("button", name="Log in", exact=True).click()
    expect(page.get_by_role("alert")).to_contain_text("do not belong together")
    page.get_by_role("link", name="Change your password").click()
    assert serious(page) == []
    page.get_by_label("Name").fill("lena")
    page.get_by_label("Password", exact=True).fill(PASSWORD)
    page.get_by_label("New password, at least").fill(OTHER)
    page.get_by_label("The new password again").fill(OTHER)
    page.get_by_role("button", name="Change the password").click()
    expect(page.get_by_role("alert")).to_contain_text("is changed")
    page.get_by_label("Name").fill("Lena")
    page.get_by_label("Password").fill(OTHER)
    page.get_by_role("button", name="Log in", exact=True).click()
    page.get_by_role("link", name="Studio").first.click()
    page.get_by_role("button", name="Log out").click()
    expect(page).to_have_url(f"{address}/login?page=/studio/start")
    context.close()


def test_who_proves_at_a_provider_who_they_are_comes_back_to_the_page(
    browser: Browser, tmp_path: Path
) -> None:
    """``localhost`` and ``127.0.0.1`` are two sites for a browser: cookies are those of a real provider."""
    person = {"sub": "s-1", "preferred_username": "anna", "groups": ["leads"]}
    port = int(free_endpoint().rpartition(":")[2])
    secret = tmp_path / "secret"
    secret.write_text(SECRET)
    secret.chmod(0o600)
    with others_provider("localhost", person) as issuer, ExitStack() as running:
        settings = Settings(
            data=tmp_path / "data", zenoh=free_endpoint(), port=port, workers=1, login="always",
            oidc_issuer=issuer, oidc_client_id=CLIENT, oidc_secret_file=secret, oidc_roles={"leads": "admin"},
            oidc_name="Our Company",
        )  # fmt: skip
        running.enter_context(part_of_service(web, settings))
        address = f"http://127.0.0.1:{port}"
        context = browser.new_context(viewport={"width": 390, "height": 844}, color_scheme="dark")
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.goto(f"{address}/studio/access")
        expect(page).to_have_url(f"{address}/login?page=/studio/access")
        assert serious(page) == []
        page.get_by_role("link", name="Log in with Our Company").click()
        page.get_by_role("button", name="s-1").click()
        expect(page).to_have_url(f"{address}/studio/access")
        expect(page.get_by_role("cell", name="at localhost")).to_be_visible()
        page.get_by_role("button", name="Change anna").click()
        dialog = page.get_by_role("dialog", name="Change a person")
        expect(dialog.get_by_label("Role")).to_be_visible()
        expect(dialog.get_by_label("New password")).to_be_hidden()
        dialog.get_by_role("button", name="Cancel").click()
        page.get_by_role("button", name="Remove anna").click()
        over = page.get_by_role("dialog", name="Session over")
        expect(over).to_contain_text("Your session has ended. Log in to go on")
        over.get_by_role("button", name="Log in").click()
        expect(page).to_have_url(f"{address}/login?page=%2Fstudio%2Faccess")
        page.get_by_role("link", name="Log in with Our Company").click()
        page.get_by_role("button", name="s-1").click()
        expect(page.get_by_role("alert")).to_contain_text("anna was removed by an admin")
        context.close()


def test_an_admin_adds_changes_and_removes_people(opened: Open) -> None:
    seen = opened("access")
    page = seen.page
    page.get_by_label("Name of the person").fill("carla")
    page.get_by_label("Password, at least 12 characters").fill("too short")
    page.get_by_role("button", name="Add the person").click()
    expect(page.get_by_text("a password of 9 characters; give one of 12")).to_be_visible()
    page.get_by_label("Password, at least 12 characters").fill(PASSWORD)
    page.get_by_role("button", name="Add the person").click()
    row = page.get_by_role("row").filter(has=page.get_by_role("button", name="Change carla"))
    expect(row).to_contain_text("viewer")
    expect(page.get_by_label("Password, at least 12 characters")).to_have_value("")
    assert serious(page) == []
    page.get_by_role("button", name="Change carla").click()
    page.get_by_role("button", name="Change", exact=True).click()
    expect(page.get_by_text("Nothing was changed.")).to_be_visible()
    page.get_by_role("button", name="Change carla").click()
    dialog = page.get_by_role("dialog", name="Change a person")
    dialog.get_by_label("Role").click()
    page.get_by_role("option", name="operator").click()
    expect(page.get_by_role("option")).to_have_count(0)
    assert serious(page) == []
    dialog.get_by_label("New password").fill(OTHER)
    dialog.get_by_role("button", name="Change", exact=True).click()
    expect(row).to_contain_text("operator")
    expect(page.get_by_text("carla is changed, and logs in again")).to_be_visible()
    page.get_by_role("button", name="Remove carla").click()
    expect(page.get_by_text("carla is removed, and logs in no more")).to_be_visible()
    expect(page.get_by_role("button", name="Remove carla")).to_have_count(0)
    expect(page.get_by_role("cell", name="keys carla").first).to_be_visible()
    assert seen.complaints == []


def test_pages_left_open_after_their_session_say_so_once_and_lead_to_the_login(
    browser: Browser, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Those that look again and again: none of them leaves a traceback in the log."""
    port = int(free_endpoint().rpartition(":")[2])
    settings = Settings(data=tmp_path / "data", zenoh=free_endpoint(), port=port, workers=1, login="always")
    address = f"http://127.0.0.1:{port}"
    with Store.open(settings) as store, part_of_service(web, settings):
        store_model(store, "anna", degrees_per_count=0.5)
        _, key = store.keys.create("training", "trainer")
        context = browser.new_context(viewport={"width": 390, "height": 844})
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.goto(f"{address}/login?page=/studio/models")
        page.get_by_label("Your key").fill(key)
        page.get_by_role("button", name="Log in with a key").click()
        expect(page).to_have_url(f"{address}/studio/models")
        pages = {"models": page} | {name: context.new_page() for name in ("jobs", "start", "fall", "capture")}
        for name, one in pages.items():
            if name != "models":
                one.goto(f"{address}/studio/{name}")
            expect(one.get_by_role("button", name="Log out")).to_be_visible()
        store.keys.revoke("training")
        for one in pages.values():
            over = one.get_by_role("dialog", name="Session over")
            expect(over).to_have_count(1)
            expect(over).to_contain_text("Your session has ended. Log in to go on")
            assert serious(one) == []
        for name, one in pages.items():
            one.get_by_role("dialog", name="Session over").get_by_role("button", name="Log in").click()
            expect(one).to_have_url(f"{address}/login?page=%2Fstudio%2F{name}")
        context.close()
    assert "Traceback" not in capfd.readouterr().err
