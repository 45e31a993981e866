"""A study with other limits: read by name, handed down to the diagnosis, kept apart from usual answers."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from diagnosis_answer import NOTHING, diagnosis_answer
from glove_choices import with_cause
from study import main
from study_limits import digest, limits_from, other_limits, read_limits

from glovecal_models.errors import BadInput
from glovecal_models.improvement.limits import IMPROVEMENT_LIMITS


def test_limits_are_read_by_name(tmp_path):
    file = tmp_path / "stricter.toml"
    file.write_text("[diagnosis]\nclear_share = 0.3\n[comparison]\nat_floor_times = 1.1\n")
    limits = read_limits(file)
    assert (limits.diagnosis.clear_share, limits.comparison.at_floor_times) == (0.3, 1.1)
    assert other_limits(limits) == {"diagnosis.clear_share": 0.3, "comparison.at_floor_times": 1.1}
    assert other_limits(limits_from({"improvement": {"least_gain": 0.08}})) == {}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[diagnosis]\nclear = 0.3\n", r"no limit 'clear'; did you mean 'clear_share'"),
        ("[sampling]\nenough_deg = 1\n", "no table of limits 'sampling'; there are diagnosis, comparison, "),
        ("clear_share = 0.3\n", "no table of limits 'clear_share'"),
        ("[diagnosis\n", "cannot be read as TOML"),
    ],
)
def test_what_is_unknown_is_refused(tmp_path, capsys, text, told):
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(BadInput, match=told):
        read_limits(file)
    with pytest.raises(SystemExit) as ended:
        main(["names", "--limits", str(file), "--folder", str(tmp_path)])
    assert ended.value.code == 2
    assert re.search(f"error: .*{told}", capsys.readouterr().err)


def test_answers_with_other_limits_are_kept_apart():
    software = "a" * 64
    assert digest(software, IMPROVEMENT_LIMITS) == software
    one, two = (digest(software, limits_from({"diagnosis": {"least_share": x}})) for x in (0.05, 0.06))
    assert len({software, one, two}) == 3


def test_other_limits_reach_the_diagnosis():
    glove = with_cause("short", "hysteresis", 2.6, 1)
    assert glove is not None
    glove = replace(glove, rate_hz=30.0, takes_per_wearing=3, take_s=20.0)
    assert diagnosis_answer(glove)["first"] == "hysteresis"
    strict = limits_from(
        {"diagnosis": {"joint_p_value": 0.0, "pooled_p_value": 0.0, "rare_p_value": 0.0, "clear_share": 2.0}}
    )
    assert diagnosis_answer(glove, strict)["first"] == NOTHING
