"""What a pattern leaves ambiguous, and patterns from files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glovecal_models.colour_glove.pattern import glove_pattern, printed_pattern
from glovecal_models.colour_glove.pattern_comparison import ambiguities, read_pattern
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.errors import BadInput


def test_one_colour_leaves_more_open_than_ten_and_nothing_beats_the_nearest_hand() -> None:
    compared = {"printed": printed_pattern(), "one": glove_pattern(hand_skin(), colours=1)}
    found = ambiguities(compared, entries=300, queries=40)
    printed, one = found["printed"], found["one"]
    assert printed.mean_mm + 4 * printed.mean_sd_mm < one.mean_mm
    assert printed.nearest_mm == one.nearest_mm <= printed.mean_mm <= printed.p90_mm
    assert printed.colours == tuple(printed_pattern().colour_of_patch)
    with pytest.raises(BadInput, match="0 hands looked up"):
        ambiguities(compared, queries=0)


def test_a_file_says_the_colour_of_each_patch(tmp_path: Path) -> None:
    file = tmp_path / "own.json"
    colours = [index % 10 + 1 for index in range(20)]
    file.write_text(json.dumps({"colours": colours}))
    own = read_pattern(file)
    assert own.colour_of_patch.tolist() == colours
    assert np.array_equal(own.patch, printed_pattern().patch)
    assert own.same_colour_mm < printed_pattern().same_colour_mm


@settings(max_examples=40)
@given(
    st.one_of(
        st.just(json.dumps({"colours": [1] * 19 + [11]})),
        st.text(max_size=40),
        st.lists(st.integers()).map(json.dumps),
        st.fixed_dictionaries({"colours": st.lists(st.integers(-2, 12), max_size=19)}).map(json.dumps),
        st.just(json.dumps({"colours": [True] * 20})),
        st.just(json.dumps({"colours": [1] * 20, "name": "x"})),
    )
)
def test_other_files_are_refused_by_name(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    file = tmp_path_factory.getbasetemp() / "wild.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=re.escape(str(file))):
        read_pattern(file)
