"""The loop on the command line: effects, diagnose, add-effect, remove-effect, improve on files."""

from __future__ import annotations

import dataclasses
import re
import shlex
from functools import partial
from pathlib import Path

import pytest
from cli_running import Run, glovecal
from small_session import CAUSE, ROTATIONS, sticky_session, write_sticky

from glovecal_models.takes.write_table import write_takes


@pytest.fixture(scope="module")
def loop(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, str, Path]:
    """The command on a folder with a linear model of ``anna``, the model's id, and the folder of tables."""
    folder = tmp_path_factory.mktemp("loop")
    run = partial(glovecal, {"GLOVECAL_DATA": str(folder / "data")})
    run("subject", "add", "anna")
    table = write_sticky(folder)
    imported = run("take", "import", table, "-s", "anna")
    assert imported.code == 0, imported.err
    assert "Next: glovecal train --subject anna\n" in imported.out
    options = ("--method", "linear", "--folds", "0", "--json")
    model = run("train", "-s", "anna", *options).json["result"]["model"]
    assert "Next" not in run("take", "import", table, "-s", "anna").out, "it was trained on them all"
    return run, model, folder


def test_the_catalogue_in_words_and_one_effect_in_full(anna: Run) -> None:
    answer = anna("effects")
    assert answer.code == 0, answer.err
    assert "hysteresis" in answer.out
    assert "c.temperature_c" in answer.out
    one = anna("effects", "hysteresis")
    assert "time-reversed" in one.out
    assert "widest_play" in one.out
    assert anna("effects", "hysteresis", "--json").json["name"] == "hysteresis"
    unknown = anna("effects", "glue")
    assert unknown.code == 1
    assert "there is no effect 'glue'; there are" in unknown.said


def test_diagnose_names_shows_evidence_and_says_what_to_run(loop: tuple[Run, str, Path]) -> None:
    run, model, folder = loop
    page = folder / "diagnosis.html"
    answer = run("diagnose", model[:8], "--report", page, "--explain")
    assert answer.code == 0, answer.err
    assert "Rules that decided:\n  rank: hysteresis on I_PIP, M_PIP saves most" in answer.out
    assert "Verdict: hysteresis is missing" in answer.out
    assert "Place: I_PIP, M_PIP\n" in answer.out
    assert "hysteresis on I_PIP, M_PIP explains" in answer.out
    assert "contact_pressure: no context column c.contact_n was recorded" in answer.out
    command = f"glovecal add-effect {model[:12]} hysteresis --rotation I_PIP --rotation M_PIP"
    assert f"Next: {command}\n" in answer.out
    assert "a straight line cannot use: nonlinearity of the base; train with --method lmc_gpr" in answer.out
    assert f"Wrote {page}" in answer.out
    assert "<svg" in page.read_text()
    again = run("diagnose", model, "--json").json
    assert again["named"]["effect"] == CAUSE
    assert again["decided"][0] | {"sentence": ""} == {"rule": "rank", "effects": [CAUSE], "sentence": ""}
    assert "Rules that decided" not in run("diagnose", model).out
    lonely = run("diagnose", model, "--take", "w1-t1")
    assert lonely.code == 0, lonely.err
    assert "Take the glove off and put it on again, then record" in lonely.out
    assert "further takes (" in lonely.out.partition("What to record next:\n")[2].partition("\n")[0]
    assert "permutations" not in lonely.out
    why = {
        item["effect"]: item["why"]
        for item in run("diagnose", model, "--take", "w1-t1", "--json").json["not_identifiable"]
    }
    assert why["donning_shift"] == "all takes are of one wearing"


SHORT_WALK = ("add-effect", "diagnose")
WHOLE_WALK = (*SHORT_WALK, "train", *reversed(SHORT_WALK), "diagnose", "where")


@pytest.mark.parametrize(
    "is_short", [True, pytest.param(False, marks=pytest.mark.slow)], ids=["short", "whole"]
)
def test_one_command_after_the_other_as_each_prints_it(
    loop: tuple[Run, str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_short: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    run, model, _ = loop
    answer, walked = run("diagnose", model), {}
    while printed := re.search(r"^Next: glovecal (.*)$", answer.out, re.MULTILINE):
        if "GLOVE" in printed[1] or printed[1] in walked:  # first somebody has to move a hand
            break
        if is_short and len(walked) == len(SHORT_WALK):
            break
        answer = run(*shlex.split(printed[1]))
        assert answer.code == 0, (printed[0], answer.err)
        walked[printed[1]] = answer
    verbs = [command.split()[0] for command in walked]
    assert verbs == [*(SHORT_WALK if is_short else WHOLE_WALK)]
    assert is_short or "this is not a held-out error" in answer.err
    added = next(iter(walked.values()))
    assert "reduces the held-out error" in added.out
    assert f", made from {model[:12]}. Not active; glovecal model activate" in added.out
    child = added.out.split("Model ")[1].split(",")[0]
    shown = run("model", "show", child).out
    assert f"made from     {model[:12]}" in shown
    assert CAUSE in shown
    removed = run("remove-effect", child, CAUSE, "--json").json
    assert removed["parent"].startswith(child)
    assert removed["model"]


def test_an_own_effect_and_what_is_undone(loop: tuple[Run, str, Path]) -> None:
    run, model, _ = loop
    answer = run("add-effect", model, "sag", "--expression", "c.supply_v * own; unit = deg/V", "-r", "I_PIP")
    assert answer.code == 0, answer.err
    assert "sag on I_PIP was undone" in answer.out
    assert "nothing was stored" in answer.out
    other = run("add-effect", model, "sag", "--expression", "name = slack; columns = own")
    assert other.code == 2
    assert "the effect is called 'sag', but --expression names it 'slack'" in other.said
    unknown = run("add-effect", model, "strap", "-e", "c.strap_n * own")
    assert unknown.code == 1
    assert "no context column 'c.strap_n'; known are own, own_deg, t" in unknown.said
    divided = run("add-effect", model, "zero", "-e", "1 / (t - t)")
    assert divided.code == 1
    assert "division by zero" in divided.said


def test_improve_on_files_prints_the_contract_and_nothing_else(run: Run, tmp_path: Path) -> None:
    """Two files behind one option, a holdout in two tables, a layout file; the same again imports nothing."""
    takes, last = sticky_session().takes, sticky_session().also("natural", 12, 1).take
    write_takes(takes[:4], tmp_path / "first.csv")
    write_takes(takes[4:], tmp_path / "second.csv")
    late = dataclasses.replace(last, reference_time_s=last.reference_time_s + 0.004)
    write_takes([late], tmp_path / "last.csv")
    layout = tmp_path / "pair.toml"
    lines = [f'{name} = ["{name}"]' for name in ROTATIONS]
    layout.write_text('name = "pair"\nsensors = ["I_PIP", "M_PIP"]\n[rotations]\n' + "\n".join(lines) + "\n")
    files = ("--takes", tmp_path / "first.csv", tmp_path / "second.csv", "--holdout")
    files = (*files, tmp_path / "last.frames.csv")
    options = ("--method", "linear", "--layout", layout, "--max-steps", "1")
    answer = run("improve", *files, *options, "--json")
    found = answer.json
    assert answer.err == ""
    wanted = {"steps", "noise_floor_deg", "stopped", "unexplained_residual", "next_take", "sentences"}
    assert wanted <= set(found)
    for step in found["steps"]:
        assert {"model", "added", "rmse_deg", "per_rotation"} <= set(step)
    assert found["steps"][1]["added"]["effect"] == CAUSE
    assert {"where", "verdict", "confidence_set", "parameters"} <= set(found["steps"][1]["added"])
    assert run("model", "show", found["steps"][-1]["model"], "--json").json["layout"] == "pair"
    (subject,) = run("subject", "list", "--json").json
    assert subject["name"].startswith("improve-")

    page = tmp_path / "fall.html"
    again = run("improve", *files, *options, "--report", page, "--activate")
    assert again.code == 0, again.err
    assert "+" not in again.out.split("Noise floors")[0]
    assert "hysteresis on I_PIP, M_PIP" in again.out
    assert f"The models are kept for subject {subject['name']}." in again.out
    assert "The last is active." in again.out
    assert "<svg" in page.read_text()
    assert len(run("take", "list", "--json").json) == 9
    assert len(run("model", "list", "--json").json) == len(found["steps"])
    stored = run("improve", "-s", subject["name"], "--take", "w1-t1", "w1-t2", "--max-steps", "0",
                 "--method", "linear", "--json").json  # fmt: skip
    assert len(stored["steps"]) == 1
    other = run("improve", *files, "--layout", "cyberglove18")
    assert other.code == 1
    assert "was imported before with layout pair, not cyberglove18" in other.said


def test_improve_without_anything_to_learn_from(run: Run, loop: tuple[Run, str, Path]) -> None:
    *_, folder = loop
    nothing = run("improve")
    assert nothing.code == 2
    assert "name files with --takes, or a subject with --subject" in nothing.said
    stranger = run("improve", "-s", "carl")
    assert stranger.code == 1
    assert "there is no subject 'carl'" in stranger.said
    run("subject", "add", "ben")
    empty = run("improve", "-s", "ben")
    assert empty.code == 1
    assert "subject ben has no take with reference angles" in empty.said
    mute = run("improve", "--takes", folder / "mute.csv")
    assert mute.code == 1
    assert "mute.csv" in mute.said


def test_takes_that_the_model_has_not_seen_are_held_against_it(
    loop: tuple[Run, str, Path], tmp_path: Path
) -> None:
    run, _, _ = loop
    write_takes([sticky_session().also("natural", 12, 1, repeat=1).take], tmp_path / "new.csv")
    imported = run("take", "import", tmp_path / "new.csv", "-s", "anna")
    (active,) = [row["id"] for row in run("model", "list", "--json").json if row["active"]]
    assert f"Next: glovecal compare {active[:12]}\n" in imported.out
    assert run("compare", active[:12]).code == 0
