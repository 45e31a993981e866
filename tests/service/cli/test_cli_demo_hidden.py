"""The demo's second act on a service in this process: hidden, found or honestly not, and told."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from cli_running import glovecal

from glovecal_client.rest import RestClient
from glovecal_models.comparison.answer import Comparison, RotationErrors
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.answer import FoundInRecording, MissingEffects, NamedEffect
from glovecal_models.diagnosis.residual_answer import Unexplained
from glovecal_models.errors import BadInput
from glovecal_models.takes.table import read_takes
from glovecal_service.demo.second_act import (
    Findings,
    chart,
    hidden_contract,
    prepare,
    second_act,
    told_wrongly,
    verdict,
)
from glovecal_service.first_run.hidden_session import RANDOM_EFFECTS, check_effect, hidden_session
from glovecal_service.rest.in_process import in_process_client
from glovecal_service.settings import Settings

TAKE_S = 10.0


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RestClient]:
    with in_process_client(Settings(data=tmp_path_factory.mktemp("demo") / "data")) as client:
        yield client


def walked(
    service: RestClient, folder: Path, effect: str, seed: int
) -> tuple[Findings, list[str], list[str], dict]:
    """What was found, said in the walk, said at its end, and the JSON."""
    hidden = hidden_session(effect, seed, take_s=TAKE_S)
    said: list[str] = []
    found = prepare(service, hidden, folder, subject=effect)
    second_act(service, found, said.append, said.append)
    return found, said, [*chart(found), *verdict(hidden, found)], hidden_contract(hidden, found)


def test_a_hidden_effect_is_compared_placed_named_added_and_revealed(service, tmp_path):
    found, said, ending, figures = walked(service, tmp_path, "cross_coupling", 3)
    assert figures["hidden"] == {
        "truth": "cross_coupling",
        "form": figures["hidden"]["form"],
        "seed": 3,
        "named": "cross_coupling",
        "confidence_set": ["cross_coupling"],
        "right": True,
    }
    fall = figures["error_fall_deg"]
    assert list(fall) == ["raw", "linear", "lmc_gpr", "with_effect"]
    assert fall["with_effect"] < 0.6 * fall["lmc_gpr"] < fall["raw"]
    assert 0 < figures["noise_floor_deg"] < fall["with_effect"]
    assert found.child is not None
    text = "\n".join(said)
    for part in (
        "noise floor",
        "Where: ",
        "Diagnosis: cross_coupling on",
        "control: ",
        "Confidence set: cross",
    ):
        assert part in text
    assert "so far" in text, "the held-out error is reported while it is measured"
    before, after = (f"{fall[name]:.2f}" for name in ("lmc_gpr", "with_effect"))
    assert f"Held-out error, all rotations: from {before} to {after} degrees." in text
    assert sum(line.count("held-out error from") for line in said) == 0, "one error for one step"
    assert "% of the squared error of these sensors on held-out takes (control: " in text
    assert "Right: cross_coupling was named." in ending
    assert any(line.strip().startswith("+ cross_coupling") for line in ending)


@pytest.mark.slow
def test_a_cause_without_a_name_is_said_to_be_left(service, tmp_path):
    found, said, ending, figures = walked(service, tmp_path, "unknown", 3)
    assert list(figures["error_fall_deg"]) == ["raw", "linear", "lmc_gpr"]
    assert found.child is None
    assert found.served == found.models["lmc_gpr"]
    assert any("no known effect beats its control" in sentence for sentence in said)
    assert figures["hidden"]["truth"].startswith("unknown:")
    assert figures["hidden"]["right"] is True
    assert any("No known effect explains the residual" in sentence for sentence in said)
    assert any("an unexplained residual was reported" in sentence for sentence in ending)


def compared(rmse_deg: float, floor: NoiseFloor | None) -> Comparison:
    """One rotation, whose error is that of all."""
    errors = RotationErrors(100, rmse_deg, rmse_deg, 0.0, 2 * rmse_deg, 0.68, None, 20.0, floor)
    return Comparison(errors, {"I_PIP": errors}, (), (), (), None)


def diagnosed(
    named: tuple[str, ...] = (),
    *,
    is_left: bool = False,
    problems: Sequence[str] = (),
    findings: Sequence[FoundInRecording] = (),
) -> MissingEffects:
    """``named``: the confidence set, the effect that is named first."""
    effect = NamedEffect(named[0], (), "correction", named, {}) if named else None
    left = Unexplained(is_left, "")
    return MissingEffects({}, effect, (), (), left, None, (), reference_problems=problems, findings=findings)


def test_a_wrong_name_is_called_wrong():
    hidden, healthy = (hidden_session(name, 1, take_s=6.0) for name in ("lag", "none"))
    found = Findings(comparisons={"lmc_gpr": compared(2.0, None)}, diagnosis=diagnosed(("creep", "lag")))
    assert verdict(hidden, found)[-1].startswith("Partly right: creep was named first; lag is in")
    found.diagnosis = diagnosed(("creep",))
    assert verdict(hidden, found)[-1] == "Wrong: creep was named."
    assert hidden_contract(hidden, found)["hidden"]["right"] is False
    assert verdict(healthy, found)[-1] == "Wrong: creep was named."
    found.diagnosis = diagnosed()
    assert verdict(hidden, found)[-1] == "Wrong: nothing was named."
    assert verdict(healthy, found)[-1] == "Right: nothing was named."
    unknown = hidden_session("unknown", 1, take_s=6.0)
    found.diagnosis = diagnosed(is_left=True)
    assert "an unexplained residual was reported" in verdict(unknown, found)[-1]
    assert hidden_contract(unknown, found)["hidden"]["right"] is True
    found.diagnosis = diagnosed()
    assert hidden_contract(healthy, found)["hidden"]["truth"] == "none"
    assert hidden_contract(hidden, found)["noise_floor_deg"] is None


def test_what_is_told_beside_the_first_name_and_is_not_so_is_called_wrong():
    hidden, healthy = (hidden_session(name, 1, take_s=6.0) for name in ("lag", "none"))

    def errors(rmse_deg: float) -> Comparison:
        return compared(rmse_deg, NoiseFloor(0.6, 0.5, 0.7, 0.0, "still hand", 9))

    found = Findings(
        comparisons={"lmc_gpr": errors(3.0), "with_effect": errors(0.8)},
        diagnosis=diagnosed(("lag",)),
        diagnosis_after=diagnosed(),
    )
    assert told_wrongly(hidden, found) == []
    problem = "t1 and t2 contradict each other."
    fault = FoundInRecording("sensor_fault", "stuck", ("A",), "It stands still.")
    found.diagnosis = diagnosed(("lag",), problems=[problem], findings=[fault])
    found.diagnosis_after = diagnosed(("creep",), is_left=True)
    wrong = told_wrongly(hidden, found)
    assert wrong[:3] == [f"{problem!r} was told", "sensor_fault was found", "creep was named afterwards"]
    assert "of an error as in healthy gloves" in wrong[3]
    assert verdict(hidden, found)[-4:] == [f"Wrong: {said}." for said in wrong]
    overall, one = found.comparisons["with_effect"], errors(1.0).rotations
    found.comparisons["with_effect"] = replace(overall, rotations=one)
    assert len(told_wrongly(hidden, found)) == 3, "of one rotation something is left"
    found.comparisons["with_effect"] = errors(1.5)
    assert len(told_wrongly(hidden, found)) == 3, "an error of 2.5 noise floors: something is left"
    found.comparisons["with_effect"] = errors(0.5)
    assert "lies below its noise floor" in told_wrongly(hidden, found)[-1]
    clean = Findings(comparisons={"lmc_gpr": errors(0.7)}, diagnosis=diagnosed(is_left=True))
    assert told_wrongly(healthy, clean) == ["an unexplained residual was reported of a healthy glove"]


def test_every_effect_that_may_be_drawn_can_be_hidden():
    for name in RANDOM_EFFECTS:
        assert check_effect(name) == name
    with pytest.raises(BadInput, match="palm"):
        check_effect("palm_arch")


def test_takes_for_the_tutorial_are_written_and_marked(tmp_path):
    answer = glovecal({}, "demo", "--effect", "creep", "--seed", 4, "--write-takes", tmp_path / "glove")
    assert answer.code == 0, answer.err
    assert "--effect creep --seed 4" in answer.out
    hidden = json.loads((tmp_path / "glove" / "hidden.json").read_text())
    assert hidden["seed"] == 4
    assert hidden["hidden"]["name"] == "creep"
    training = read_takes(tmp_path / "glove" / "training.csv")
    assert len(training) == 9
    assert all(take.simulated for take in training)
    assert len(read_takes(tmp_path / "glove" / "test.csv")) == 3


def test_an_effect_that_does_not_exist_is_refused_with_those_that_do():
    answer = glovecal({}, "demo", "--effect", "gremlins")
    assert answer.code == 2
    assert "gremlins" in answer.said
    assert "hysteresis" in answer.said
    assert "Traceback" not in answer.err
    assert not answer.out
