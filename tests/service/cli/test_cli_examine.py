"""The independence examination on the command line: from takes to a layout that is trained with."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from cli_running import Answer, Run, glovecal, simulated
from still_take import still_take

from glovecal_models.simulation.simulated_glove import SimulatedGlove
from glovecal_models.takes.write_table import write_takes

PLAIN = """name = "plain"
sensors = ["I_MCP", "M_MCP", "IM_ABD", "I_PIP"]
counts = [1, 255]
[rotations]
I_MCP = ["I_MCP"]
M_MCP = ["M_MCP"]
IM_ABD = ["IM_ABD"]
I_PIP = ["I_PIP"]
"""


@pytest.fixture(scope="module")
def eve(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A subject whose layout does not know yet that knuckles stretch the sensor between the fingers."""
    tmp_path = tmp_path_factory.mktemp("eve")
    run = partial(glovecal, {"GLOVECAL_DATA": str(tmp_path / "data")})
    glove = SimulatedGlove(1)
    still = [
        still_take(glove, "IM_ABD", ("I_MCP", "M_MCP"), name="still-IM_ABD", rate_hz=30),
        still_take(glove, "I_PIP", ("I_MCP", "M_MCP"), name="still-I_PIP", rate_hz=30),
    ]
    ranges = [
        still_take(glove, None, (name,), name=f"range-{name}", seconds=6, rate_hz=30)
        for name in ("I_MCP", "M_MCP", "IM_ABD", "I_PIP")
    ]
    write_takes([*still, *ranges], tmp_path / "still.csv")
    write_takes([simulated("cross_couple", "cross"), simulated("free", "free")], tmp_path / "train.csv")
    (tmp_path / "plain.toml").write_text(PLAIN)
    assert run("subject", "add", "eve").code == 0
    assert run("glove", "add", tmp_path / "plain.toml").code == 0
    for table in ("still.csv", "train.csv"):
        imported = run("take", "import", tmp_path / table, "-s", "eve", "-l", "plain")
        assert imported.code == 0, imported.err
    return run


def test_from_still_takes_to_a_model_that_reads_the_neighbours(eve: Run, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    told = eve("take", "examine", "-s", "eve", "--report", page)
    assert told.code == 0, told.err
    assert "IM_ABD is cross-coupled by I_MCP" in told.out
    assert "read it from IM_ABD, I_MCP and M_MCP (MS1R). (a change)" in told.out
    assert "I_PIP stays within" in told.out
    assert "--keep NAME" in told.out
    html = page.read_text()
    assert "Which sensor affects which" in html
    assert "Proposed layout" in html
    assert "plain" in html
    kept = eve("take", "examine", "-s", "eve", "--keep", "eves")
    assert "it reads IM_ABD otherwise" in kept.out
    ids = {row["name"]: row["id"] for row in eve("take", "list", "--json").json}
    cross, free = ids["cross"], ids["free"]
    used = eve("take", "use-layout", "eves", cross, free)
    assert used.out == "Read by layout eves from now on: cross, free.\n"
    errors = {}
    for layout, takes in (("eves", (cross, free)), ("plain", (cross, free))):
        eve("take", "use-layout", layout, *takes)
        options = ("--samples", "150", "--take", cross, "--folds", "0", "--json")
        model = eve("train", "-s", "eve", "-l", layout, *options).json["model"]["id"]
        compared = eve("compare", model, "--take", free, "--json").json
        errors[layout] = compared[model]["rotations"]["IM_ABD"]["rmse_deg"]
    assert errors["eves"] < 0.7 * errors["plain"]


def test_json_and_a_choice_of_proposals(eve: Run) -> None:
    found = eve("take", "examine", "still-IM_ABD", "--json").json
    assert found["rule"] == {"std_pct": 5.0, "max_pct": 12.0}
    (item,) = found["rotations"]
    assert (item["rotation"], item["is_coupled"]) == ("IM_ABD", True)
    assert item["active_range"]["source"] == "its own range take"
    assert {share["sensor"] for share in item["affecting"]} == {"I_MCP", "M_MCP"}
    assert all(share["std_low"] <= share["std_pct"] <= share["std_high"] for share in item["affecting"])
    assert found["worn_side"]["verdict"] == "not identifiable"
    options = ("--keep", "chosen", "--rotation", "IM_ABD")
    assert "IM_ABD otherwise" in eve("take", "examine", "still-IM_ABD", *options).out
    document = eve("glove", "show", "chosen").json
    assert set(document["rotations"]["IM_ABD"]) == {"IM_ABD", "I_MCP", "M_MCP"}
    assert document["counts"] == [1, 255]


def test_what_cannot_be_examined_is_refused(eve: Run) -> None:
    def refused(*arguments: object) -> Answer:
        answer = eve("take", "examine", *arguments)
        assert answer.code in (1, 2)
        return answer

    assert "does not tell which rotation was kept still" in refused("cross").said
    assert "layout 'plain' has no rotation 'X'" in refused("free", "--still", "free=X").said
    assert "no proposal for 'I_MCP'" in refused("still-IM_ABD", "--keep", "n", "--rotation", "I_MCP").said
    assert "give both" in refused("still-IM_ABD", "--rotation", "I_MCP").said
    assert "write TAKE=ROTATION" in refused("--still", "free").said
    assert "there is no take 'nine'" in refused("nine").said
    assert "is built in" in refused("still-IM_ABD", "--keep", "cyberglove18").said
    eve("subject", "add", "zoe")
    assert "no take called still-" in refused("-s", "zoe").said
    other = eve("take", "use-layout", "lucidglove", "free")
    assert other.code == 1
    assert "has no sensor" in other.said
    assert eve("take", "use-layout", "plain").code == 2
