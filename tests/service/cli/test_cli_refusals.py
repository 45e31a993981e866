"""What cannot be done: exit code, one sentence that names the value and what would be right, no traceback."""

from __future__ import annotations

import os
import typing

import pytest
from cli_running import glovecal
from typer.testing import CliRunner

from glovecal_client.capture.command import main as capture_alone
from glovecal_client.capture.cyberglove.device import CyberGlove
from glovecal_client.capture.replay import ReplayDevice
from glovecal_client.session import DEFAULT_ENDPOINT
from glovecal_models.calibration.methods import METHODS
from glovecal_service.cli.command import some_verbs
from glovecal_service.cli.terminal import options
from glovecal_service.questions.train import TrainingRequest
from glovecal_service.request_types import IDENTIFIER, SUBJECT
from glovecal_service.simulated_device import SimulatedDevice

HOSTILE = ["", "..", "../x", "a/b", "%2e%2e", "A/", "a b", "-", "x" * 65, "a\x00b", "a\nb", "ä", "a\udc80"]
VERBS = [
    (), ("subject",), ("glove",), ("take",), ("model",), ("job",), ("demo",), ("serve",), ("capture",),
    ("find-port",), ("watch",), ("record",), ("train",), ("compare",), ("take", "import"), ("job", "wait"),
    ("emulate",), ("read-card",), ("diagnose",),
    ("add-effect",), ("remove-effect",), ("improve",), ("effects",),
]  # fmt: skip


@pytest.mark.parametrize("verb", VERBS, ids=" ".join)
def test_every_verb_explains_itself(verb):
    """Typer's own runner; no service is touched."""
    answer = CliRunner().invoke(some_verbs(), [*verb, "--help"], env={"COLUMNS": "80"})
    assert answer.exit_code == 0
    assert "Usage" in answer.output
    assert max(map(len, answer.output.splitlines())) <= 80


def test_capture_explains_the_options_of_each_device(capsys):
    told = CliRunner().invoke(some_verbs(), ["capture", "--help"], env={"COLUMNS": "80"}).output
    with pytest.raises(SystemExit):
        capture_alone(["--help"])
    for text in (" ".join(told.split()), " ".join(capsys.readouterr().out.split())):
        for device in (ReplayDevice, SimulatedDevice, CyberGlove):
            for name, values in device.option_help.items():
                assert f"{name}={values}" in text


def test_the_version_is_told(run):
    assert run("--version").out.startswith("glovecal 0.")


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_names_do_not_leave_the_command(run, name):
    for verb in (
        ("subject", "add", "--", name),
        ("subject", "show", "--", name),
        ("glove", "show", "--", name),
        ("glove", "wear", "right", "--", name),
        ("take", "list", f"--subject={name}"),
        ("model", "rollback", f"--subject={name}"),
        ("train", f"--subject={name}"),
        ("record", "--", name, "take"),
        ("watch", "--connect=tcp/127.0.0.1:9", "--", name),
        ("capture", "--device=simulated", f"--glove={name}"),
        ("model", "show", "--", name),
        ("job", "show", "--", name),
    ):
        answer = run(*verb)
        assert (answer.code, answer.out) == (2, ""), verb
        assert (
            "use a-z" in answer.said or "not a model's id" in answer.said or "not a job's id" in answer.said
        )


def test_what_is_not_there(run):
    for verb, said in (
        (("subject", "show", "ben"), "there is no subject 'ben'"),
        (("subject", "remove", "ben"), "there is no subject 'ben'"),
        (("glove", "show", "mitten"), "there is no layout 'mitten'"),
        (("take", "check", "walk"), "there is no take 'walk'; there are none"),
        (("train", "-s", "ben"), "there is no subject 'ben'"),
        (("model", "show", "abcdef"), "abcdef"),
        (("model", "rollback", "-s", "ben"), "there is no subject 'ben'"),
        (("compare", "abcdef", "-t", "walk"), "abcdef"),
        (("job", "show", "0123456789ab"), "there is no job '0123456789ab'"),
        (("job", "wait", "0123456789ab"), "there is no job '0123456789ab'"),
        (("job", "cancel", "0123456789ab"), "there is no job '0123456789ab'"),
        (("record", "right", "walk"), "no glove 'right' was ever seen"),
    ):
        answer = run(*verb)
        assert (answer.code, answer.out) == (1, ""), verb
        assert said in answer.said
        assert len(answer.err.splitlines()) == 1


def test_a_subject_without_measurements_cannot_be_trained(run):
    run("subject", "add", "ben")
    assert "has no take with reference angles" in run("train", "-s", "ben").said
    assert "has no take with layout lucidglove" in run("train", "-s", "ben", "-l", "lucidglove").said
    assert "has no models; train one" in run("model", "rollback", "-s", "ben").said


def test_a_wrong_take_is_not_left_out_in_silence(anna):
    for option in ("--take", "--leave-out"):
        answer = anna("train", "-s", "anna", option, "third")
        assert answer.code == 1
        assert "there is no take 'third'; there are poses" in answer.said
    assert anna("job", "list", "--json").json == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--method", "magic"), "'raw', 'linear', 'lmc_gpr', 'spgp'"),
        (("--folds", "1"), "0, or 2 or more"),
        (("--folds", "21"), "less than or equal to 20"),
        (("--samples", "9"), "greater than or equal to 10"),
        (("--samples", "many"), "valid integer"),
        (("--pseudo-inputs", "1"), "greater than or equal to 2"),
        (("--no-wait",), "GLOVECAL_URL"),
    ],
)
def test_wrong_numbers_of_training(anna, arguments, said):
    answer = anna("train", "-s", "anna", *arguments)
    assert (answer.code, answer.out) == (2, "")
    assert said in answer.said


def test_the_command_and_rest_agree():
    """Names are written down twice; here is what keeps them the same."""
    assert typing.get_args(TrainingRequest.model_fields["method"].annotation) == METHODS
    assert options.DEFAULT_ZENOH == DEFAULT_ENDPOINT
    assert IDENTIFIER == "^[a-z0-9][a-z0-9_-]{0,63}$"
    assert IDENTIFIER.replace("a-z", "A-Za-z") == SUBJECT


def test_nobody_at_the_address():
    settings = {"GLOVECAL_URL": "http://127.0.0.1:9"}
    for verb in (("subject", "list"), ("take", "list", "--json"), ("train", "-s", "anna")):
        answer = glovecal(settings, *verb)
        assert (answer.code, answer.out) == (3, "")
        assert "nobody answers at http://127.0.0.1:9; start it with `glovecal serve`" in answer.said
    wrong = glovecal({"GLOVECAL_URL": "here"}, "subject", "list")
    assert wrong.code == 1
    assert "GLOVECAL_URL: 'here' is not the address of a service" in wrong.said


def test_nobody_to_watch():
    answer = glovecal({"GLOVECAL_ZENOH": "tcp/127.0.0.1:9"}, "watch", "right", "--json")
    assert (answer.code, answer.out) == (3, "")
    assert "no router at tcp/127.0.0.1:9; is the service running?" in answer.said
    wrong = glovecal({"GLOVECAL_ZENOH": "here"}, "watch", "right")
    assert wrong.code == 1
    assert "endpoint 'here' is not like 'tcp/127.0.0.1:7447'" in wrong.said


def test_a_data_folder_that_cannot_be(tmp_path):
    (tmp_path / "file").write_text("mine")
    answer = glovecal({"GLOVECAL_DATA": str(tmp_path / "file")}, "subject", "list")
    assert answer.code == 1
    assert "set GLOVECAL_DATA to a writable folder" in answer.said
    assert (tmp_path / "file").read_text() == "mine"
    answer = glovecal({"GLOVECAL_DATA": str(tmp_path / "file" / "x")}, "take", "list", "--json")
    assert (answer.code, answer.out) == (1, "")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_data_folder_that_is_read_only(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir(mode=0o500)
    answer = glovecal({"GLOVECAL_DATA": str(folder)}, "subject", "list")
    assert answer.code == 1
    assert "cannot be used" in answer.said


def test_a_damaged_database(tmp_path):
    (tmp_path / "glovecal.sqlite3").write_bytes(b"not a database " * 1000)
    answer = glovecal({"GLOVECAL_DATA": str(tmp_path)}, "subject", "list", "--json")
    assert (answer.code, answer.out) == (1, "")
    assert "glovecal.sqlite3 is damaged" in answer.said


def test_settings_that_cannot_be(tmp_path):
    for variable, value, said in (
        ("GLOVECAL_PORT", "99999", "GLOVECAL_PORT is '99999'"),
        ("GLOVECAL_SITE", "a b", "GLOVECAL_SITE is 'a b': 'a b' is not allowed"),
        ("GLOVECAL_DATABASE", "mysql://x", "use sqlite:///FILE or postgresql"),
    ):
        answer = glovecal({"GLOVECAL_DATA": str(tmp_path / "data"), variable: value}, "subject", "list")
        assert (answer.code, answer.out) == (1, ""), variable
        assert said in answer.said
        assert len(answer.err.splitlines()) == 1
    assert glovecal({"GLOVECAL_PORT": "x"}, "serve").code == 1


def test_capture_says_what_it_cannot(run, tmp_path):
    for arguments, said in (
        (("--device", "mitten", "--glove", "right"), "no device 'mitten'; installed are cyberglove"),
        (("--device", "simulated", "--glove", "right", "--option", "seed"), "'seed' is not KEY=VALUE"),
        (("--device", "simulated", "--glove", "right", "--option", "motion=fly"), "motion='fly'"),
        (("--device", "replay:nothing", "--glove", "right"), "nothing"),
    ):
        answer = run("capture", *arguments)
        assert (answer.code, answer.out) == (1, ""), arguments
        assert said in answer.said


def test_ports_are_looked_at(run, tmp_path):
    nothing = str(tmp_path / "nothing")
    found = {item["path"]: item for item in run("find-port", nothing, "--json").json}
    assert found[nothing]["kind"] == "unusable"
    assert nothing in run("find-port", nothing).out
