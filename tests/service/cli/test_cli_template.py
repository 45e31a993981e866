"""A template is a model like any other: trained, compared, diagnosed, given an effect, exported."""

from __future__ import annotations

from pathlib import Path

import pytest
from cli_running import Run

from glovecal_models.simulation.protocol import segments
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.write_table import write_takes

GLOVE = SimulatedGlove(3)


@pytest.fixture
def tina(run: Run, tmp_path: Path) -> Run:
    """The command on a folder with four takes of one simulated glove."""
    motions = ("key_poses", "evaluation", "thumb", "free")
    takes = [simulate_take(GLOVE, segments(each, 3), rate_hz=10, name=each).take for each in motions]
    write_takes(takes, tmp_path / "takes.csv")
    assert run("take", "import", tmp_path / "takes.csv", "-s", "tina", "--layout", "cyberglove18").code == 0
    return run


def test_it_is_trained_compared_diagnosed_and_given_an_effect(tina: Run, tmp_path: Path) -> None:
    trained = tina("train", "-s", "tina", "--method", "template", "--leave-out", "free", "--json").json
    model = trained["model"]
    assert (model["method"], model["active"]) == ("template", True)
    assert 0.5 < trained["result"]["held_out_rmse_deg"] < 12
    compared = tina("compare", model["id"], "-t", "free", "--json")
    assert compared.code == 0, compared.err
    diagnosed = tina("diagnose", model["id"], "--json")
    assert diagnosed.code == 0, diagnosed.err
    given = tina("add-effect", model["id"], "cross_coupling", "--rotation", "IM_ABD", "--json")
    assert given.code == 0, given.err
    refused = tina("model", "export", model["id"], tmp_path / "tina.cal", "--format", "virtualhand")
    assert refused.code == 0, refused.err
    assert "TI_ABD: no line of one sensor" in refused.said


def test_a_prior_mean_must_be_linear_and_the_subjects_own(tina: Run) -> None:
    base = tina("train", "-s", "tina", "--method", "two_shapes", "--folds", "0", "--json").json["model"]
    wrong = tina("train", "-s", "tina", "--method", "spgp", "--prior", base["id"])
    assert wrong.code == 1
    assert "a prior mean is for method lmc_gpr, not for spgp" in wrong.said
    assert tina("train", "-s", "tina", "--prior", "000000000000").code == 1
