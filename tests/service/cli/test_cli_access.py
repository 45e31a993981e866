"""Keys and the log of changes on the command line, and a service beyond loopback that has no admin yet."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from cli_running import COMMAND, Answer, Run, environment, glovecal
from terminal_process import on_terminal


def test_a_key_is_made_listed_and_revoked_and_the_log_tells_it(run: Run, tmp_path: Path) -> None:
    assert run("subject", "add", "anna").code == 0
    made = run("key", "add", "lena", "--role", "trainer", "--subject", "anna")
    assert made.code == 0, made.err
    key = made.out.splitlines()[0]
    assert key.startswith("glk_")
    assert "of anna alone" in made.out
    listed = run("key", "list")
    assert "lena" in listed.out
    assert key not in listed.out
    assert run("key", "revoke", "lena").code == 0
    assert json.loads(run("key", "list", "--json").out)[0]["revoked_at"]
    again = run("key", "add", "lena")
    assert again.code == 1
    assert "names are not used again" in again.said
    told = run("audit", "list", "--json")
    assert [entry["changes"][0]["table"] for entry in json.loads(told.out)] == ["keys", "keys", "subjects"]
    assert "keys lena" in run("audit", "list").out
    assert "3 entries, each as it was written" in run("audit", "verify").out
    assert run("audit", "export", tmp_path / "changes.jsonl").code == 0
    lines = (tmp_path / "changes.jsonl").read_text().splitlines()
    assert [json.loads(line)["id"] for line in lines] == [1, 2, 3]
    assert key not in "".join(lines)


def test_the_first_admin_key_is_made_where_the_settings_reach_beyond_loopback(tmp_path: Path) -> None:
    """As in a container, whose image sets the address."""
    settings = {"GLOVECAL_DATA": str(tmp_path / "data"), "GLOVECAL_HOST": "0.0.0.0"}
    made = glovecal(settings, "key", "add", "lena", "--role", "admin")
    assert made.code == 0, made.err
    assert made.out.startswith("glk_")
    assert glovecal(settings, "subject", "add", "anna").code == 0


def test_a_service_that_others_reach_does_not_start_without_an_admin(tmp_path: Path) -> None:
    settings = {"GLOVECAL_DATA": str(tmp_path / "data"), "GLOVECAL_LOGIN": "always", "GLOVECAL_PORT": "0"}
    refused = glovecal(settings | {"GLOVECAL_ZENOH": "tcp/127.0.0.1:0"}, "serve")
    assert refused.code == 1
    assert "make one: glovecal key add NAME --role admin" in refused.said
    beyond = glovecal(settings | {"GLOVECAL_HOST": "0.0.0.0"}, "serve")
    assert "glovecal site init --host NAME" in beyond.said


def test_a_person_is_added_changed_and_removed_and_the_password_is_never_an_argument(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def typed(password: str, *verb: str) -> Answer:
        monkeypatch.setattr("sys.stdin", io.StringIO(f"{password}\n"))
        return run("person", *verb)

    assert run("subject", "add", "ben").code == 0
    made = typed("correct horse battery", "add", "anna", "--role", "trainer", "--subject", "ben")
    assert made.code == 0, made.err
    assert "anna (trainer, of ben alone) logs in at /login" in made.out
    short = typed("too short", "add", "carla")
    assert short.code == 1
    assert "9 characters; give one of 12 to 200" in short.said
    assert "give --role, --subject or --everybody" in run("person", "change", "anna").said
    changed = run("person", "change", "anna", "--role", "operator")
    assert "anna has the role operator now, of ben alone" in changed.out
    assert "everybody's takes and models" in run("person", "change", "anna", "--everybody").out
    assert typed("staple battery horse", "password", "anna").code == 0
    assert "there is no person 'ana'; did you mean 'anna'" in run("person", "remove", "ana").said
    assert run("person", "remove", "anna").code == 0
    listed = run("person", "list", "--json").json
    assert [(row["name"], row["role"], row["subjects"]) for row in listed] == [("anna", "operator", None)]
    assert listed[0]["revoked_at"]
    assert "anna" in run("person", "list").out
    assert "keys anna" in run("audit", "list").out
    assert "each as it was written" in run("audit", "verify").out


def test_a_password_is_typed_twice_and_not_shown(tmp_path: Path) -> None:
    settings = environment({"GLOVECAL_DATA": str(tmp_path / "data")})
    with on_terminal([*COMMAND, "person", "add", "anna"], settings) as terminal:
        for question, password in (
            ("Password of anna: ", "correct horse battery"),
            ("The same again: ", "staple battery horse"),
            ("do not match", ""),
            ("Password of anna: ", "correct horse battery"),
            ("The same again: ", "correct horse battery"),
        ):
            terminal.wait_for(question)
            terminal.said = terminal.said.partition(question)[2]
            if password:
                terminal.type(f"{password}\n")
        terminal.wait_for("logs in at /login")
        assert terminal.end() == 0
        assert "horse" not in terminal.said
