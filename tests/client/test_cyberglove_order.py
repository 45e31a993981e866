"""The order of a CyberGlove's sensors, against a table written from the fact sheet."""

import pytest

from glovecal_client.capture.cyberglove.identity import SENSORS, hardware_order, layout_index
from glovecal_models.layout import Layout
from glovecal_service.emulators.cyberglove import EmulatedBox

# bit, meaning in the sources, place among 22 sensors, place among 18 (None: not there), name in the layouts
TABLE = [
    (0, "thumb roll", 0, 0, "T_TMC"),
    (1, "thumb MCP flexion", 1, 1, "T_MCP"),
    (2, "thumb IP flexion", 2, 2, "T_IP"),
    (3, "thumb-index abduction", 3, 3, "TI_ABD"),
    (4, "index MCP", 4, 4, "I_MCP"),
    (5, "index PIP", 5, 5, "I_PIP"),
    (6, "index DIP", 6, None, "I_DIP"),
    (8, "middle MCP", 7, 6, "M_MCP"),
    (9, "middle PIP", 8, 7, "M_PIP"),
    (10, "middle DIP", 9, None, "M_DIP"),
    (11, "index-middle abduction", 10, 8, "IM_ABD"),
    (12, "ring MCP", 11, 9, "R_MCP"),
    (13, "ring PIP", 12, 10, "R_PIP"),
    (14, "ring DIP", 13, None, "R_DIP"),
    (15, "middle-ring abduction", 14, 11, "MR_ABD"),
    (16, "pinky MCP", 15, 12, "P_MCP"),
    (17, "pinky PIP", 16, 13, "P_PIP"),
    (18, "pinky DIP", 17, None, "P_DIP"),
    (19, "ring-pinky abduction", 18, 14, "RP_ABD"),
    (20, "palm arch", 19, 15, "PALM_ARCH"),
    (21, "wrist pitch", 20, 16, "W_FLEX"),
    (22, "wrist yaw", 21, 17, "W_ABD"),
]


def places(count: int) -> dict[int, str]:
    column = {22: 2, 18: 3}[count]
    return {row[column]: row[4] for row in TABLE if row[column] is not None}


@pytest.mark.parametrize("count", [18, 22])
def test_hardware_order_is_the_tables(count: int) -> None:
    expected = places(count)
    assert list(hardware_order(count)) == [expected[place] for place in range(count)]


@pytest.mark.parametrize("count", [18, 22])
def test_every_sensor_arrives_under_its_own_name(count: int) -> None:
    expected = places(count)
    record = list(range(count))
    arrived = [record[place] for place in layout_index(count)]
    names = SENSORS[f"cyberglove{count}"]
    assert dict(zip(names, arrived, strict=True)) == {name: place for place, name in expected.items()}


@pytest.mark.parametrize("count", [18, 22])
def test_sensor_names_are_the_built_in_layouts(count: int) -> None:
    name = f"cyberglove{count}"
    assert SENSORS[name] == Layout.built_in(name).sensors


@pytest.mark.parametrize("count", [18, 22])
def test_the_emulator_sends_the_tables_bits(count: int) -> None:
    column = {22: 2, 18: 3}[count]
    assert EmulatedBox(count).bits == [row[0] for row in TABLE if row[column] is not None]
