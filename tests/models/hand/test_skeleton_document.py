"""The skeleton as JSON and back: the same hand, and a sentence for whatever is none."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from glovecal_models.errors import BadInput
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import HANDS, Handedness
from glovecal_models.hand.skeleton import Palm, hand_skeleton, skeleton_document, skeleton_from_document

SIZES = HandDimensions.from_measured({"hand_length": 182, "P_metacarpal": 80})


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("palm", ["rigid", "arching"])
def test_a_skeleton_comes_back_as_it_was(hand: Handedness, palm: Palm) -> None:
    skeleton = hand_skeleton(SIZES, hand, palm)
    assert skeleton_from_document(json.loads(json.dumps(skeleton_document(skeleton)))) == skeleton


def put(*path: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    """Writes ``value`` over what stands at ``path``."""

    def change(document: Any) -> None:
        *way, last = path
        for step in way:
            document = document[step]
        document[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (put("format", value="glovecal.skeleton.v2"), "format is 'glovecal.skeleton.v2', expected"),
        (put("length_unit", value="m"), "length_unit is 'm', expected 'mm'"),
        (put("hand", value="unknown"), "hand is 'unknown', expected 'right' or 'left'"),
        (put("joints", value={}), "joints is {}, expected a list"),
        (put("joints", 3, value="T_IP"), "joint is 'T_IP', expected a JSON object"),
        (put("joints", 3, "name", value="T_TMC"), "joint 'T_TMC' has no name of its own"),
        (put("joints", 3, "parent", value="P_DIP"), "hangs on 'P_DIP', which is no joint before it"),
        (put("joints", 3, "parent", value=None), "hangs on None"),
        (put("joints", 3, "parent", value=[1]), r"hangs on \[1\]"),
        (put("joints", 3, "offset", value=[1, 2]), r"offset is \[1, 2\], expected 3 numbers"),
        (put("joints", 3, "offset", 0, value=float("nan")), "offset is nan, expected a number from -1000"),
        (put("joints", 3, "offset", 0, value=True), "offset is True"),
        (put("joints", 3, "axis", value=[0, 0, 2]), "axis has length 2, expected 1"),
        (put("joints", 3, "orientation", value=[0, 0, 0, 0]), "orientation has length 0, expected 1"),
        (put("joints", 3, "rotations", value={"I_MPC": 1.0}), "no rotation 'I_MPC'; did you mean 'I_MCP'"),
        (put("joints", 3, "rotations", "TI_ABD", value="1"), "weight of TI_ABD is '1'"),
        (put("tips", 0, "finger", value="toe"), "tip of 'toe' on 'T_IP'"),
        (put("tips", 0, "joint", value="T_DIP"), "tip of 'thumb' on 'T_DIP'"),
        (put("tips", value=[]), "tips are not those of thumb, index"),
        (put("dimensions", "sizes", "hand_length", value=-1), "size hand_length is -1"),
        (put("dimensions", value=None), "dimensions is None, expected a JSON object"),
    ],
)
def test_what_is_no_skeleton_is_refused_by_name(
    change: Callable[[dict[str, Any]], None], sentence: str
) -> None:
    document = json.loads(json.dumps(skeleton_document(hand_skeleton(SIZES))))
    change(document)
    with pytest.raises(BadInput, match=sentence):
        skeleton_from_document(document)


def test_what_is_no_object_is_refused() -> None:
    with pytest.raises(BadInput, match="skeleton is None, expected a JSON object"):
        skeleton_from_document(None)
