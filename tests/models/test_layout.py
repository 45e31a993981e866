"""Layouts: the built-in ones against the paper, any other from TOML, clear refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glovecal_models.errors import BadInput, BadLayout
from glovecal_models.layout import BUILT_IN, Layout, built_in_toml

# Wang & Neff 2013, Table 1: measured rotation -> affecting sensors (the wrist pair included).
TABLE_1 = {
    "TI_ABD": {"T_TMC"},
    "IM_ABD": {"I_MCP", "M_MCP"},
    "MR_ABD": {"M_MCP", "R_MCP"},
    "RP_ABD": {"R_MCP", "P_MCP"},
    "PALM_ARCH": {"T_TMC", "TI_ABD", "I_MCP", "IM_ABD", "M_MCP", "R_MCP", "MR_ABD", "P_MCP", "RP_ABD"},
    "W_FLEX": {"W_ABD"},
    "W_ABD": {"W_FLEX"},
}

HALF_HAND = """
name = "half-hand"
sensors = ["I_MCP", "I_PIP", "M_MCP", "IM_ABD"]
[rotations]
I_MCP = ["I_MCP"]
IM_ABD = ["IM_ABD", "I_MCP", "M_MCP"]
[simulated]
I_DIP = "2/3 * I_PIP"
"""


@pytest.mark.parametrize("name", ["cyberglove18", "cyberglove22"])
def test_couplings_include_the_papers_table_1(name):
    layout = Layout.built_in(name)
    for rotation, affecting in TABLE_1.items():
        sensors = layout.correspondence(rotation).sensors
        assert sensors[0] == rotation
        assert affecting <= set(sensors)


def test_cyberglove18_has_the_papers_22_rotations_and_the_palm_arch():
    layout = Layout.built_in("cyberglove18")
    assert len(layout.sensors) == 18
    assert len(layout.rotations) == 23
    kinds = {item.rotation: item.kind for item in layout.correspondences}
    assert [name for name, kind in kinds.items() if kind == "0S1R"] == [
        "T_VIR",
        "I_DIP",
        "M_DIP",
        "R_DIP",
        "P_DIP",
    ]
    assert kinds["PALM_ARCH"] == "MSMR"


def test_the_thumb_is_read_from_all_four_thumb_sensors():
    layout = Layout.built_in("cyberglove18")
    for rotation in ("T_TMC", "TI_ABD", "T_MCP", "T_IP"):
        assert set(layout.correspondence(rotation).sensors) == {"T_TMC", "TI_ABD", "T_MCP", "T_IP"}


@pytest.mark.parametrize("name", BUILT_IN)
def test_document_round_trip(name):
    layout = Layout.built_in(name)
    assert Layout.from_document(layout.to_document()) == layout
    assert built_in_toml(name).startswith("#")


def test_a_small_layout_and_its_pseudo_sensor():
    layout = Layout.from_toml(HALF_HAND)
    dip = layout.correspondence("I_DIP")
    assert dip.kind == "0S1R"
    columns = dip.input_columns(np.array([[10.0, 30.0, 20.0, 5.0]]), layout.sensors)
    assert columns.tolist() == [[20.0]]


def test_without_a_file_a_rotation_is_read_from_its_name_else_from_all():
    layout = Layout.from_columns("ankle", ["PF", "INV", "DF"], ["PF", "FLEXION"])
    assert layout.correspondence("PF").sensors == ("PF",)
    assert layout.correspondence("FLEXION").sensors == ("PF", "INV", "DF")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 'x'\nsensors = []", "no sensors"),
        ("sensors = ['A', 'A']", "more than once"),
        ("sensors = ['A']\n[rotations]\nR = ['B']", "reads sensor 'B'"),
        ("sensors = ['A']\n[rotations]\nR = []", "read from no sensor"),
        ("sensors = ['A']\n[simulated]\nR = '2 * B'", "reads sensor 'B'"),
        ("sensors = ['A']\n[simulated]\nR = '1/0 * A'", "divides by zero"),
        ("sensors = ['A']\n[simulated]\nR = '__import__(1)'", "cannot read|expected"),
        ("sensors = ['A']\n[rotations]\nR=['A']\n[simulated]\nR='A'", "both"),
        ("sensors = ['A']\ncounts = [5, 1]", "smallest, largest"),
        ("sensors = ['../A']", "not a channel name"),
        ("sensors = 'A'", "list of names"),
        ("sensors = ['A']\ncolour = 'red'", "unknown key 'colour'"),
        ("sensors = [", "not valid TOML"),
    ],
)
def test_refusals_name_what_is_wrong(text, message):
    with pytest.raises(BadInput, match=message):
        Layout.from_toml(text, source="glove.toml")


def test_unknown_built_in_layout_lists_the_known_ones():
    with pytest.raises(BadLayout, match="cyberglove18"):
        Layout.built_in("cyberglove19")


@given(st.text(max_size=200))
def test_wild_layout_text_is_refused_or_read_never_anything_else(text):
    try:
        layout = Layout.from_toml(text)
    except BadInput:
        return
    assert layout.sensors
