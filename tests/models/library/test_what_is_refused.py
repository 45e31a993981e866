"""Wrong paths, layouts, takes, models and effects are refused with a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import glovecal

LAYOUT = 'name = "two"\nsensors = ["I_MCP", "I_PIP"]\n[rotations]\nI_PIP = ["I_PIP", "I_MCP"]\n'


def test_layouts_by_name_file_and_object(tmp_path: Path, takes):
    file = tmp_path / "two.toml"
    file.write_text(LAYOUT, encoding="utf-8")
    for given in (file, str(file), glovecal.read_layout(file)):
        model = glovecal.train(takes, layout=given, method="linear", folds=0)
        assert model.rotations == ("I_PIP",)
        assert model.held_out_rmse_deg is None
        assert "no cross-validation" in str(model)
    assert glovecal.read_layout("lucidglove") == glovecal.Layout.built_in("lucidglove")
    with pytest.raises(glovecal.BadInput, match=r"no layout 'mine\.toml'.*cyberglove18"):
        glovecal.read_layout("mine.toml")
    file.write_text("name = ", encoding="utf-8")
    with pytest.raises(glovecal.BadInput, match=r"two\.toml: not valid TOML"):
        glovecal.read_layout(file)
    with pytest.raises(glovecal.BadInput, match="cannot be read"):
        glovecal.read_layout(tmp_path)


def test_takes_that_lack_a_sensor_of_the_layout(tmp_path: Path, takes):
    [file] = glovecal.write_takes(takes[0], tmp_path / "one.csv")
    with pytest.raises(glovecal.BadInput, match="has no sensor"):
        glovecal.read_takes(file, layout="cyberglove18")
    with pytest.raises(glovecal.BadInput, match="there is no such file"):
        glovecal.read_takes(tmp_path / "none.csv")
    with pytest.raises(glovecal.BadInput, match="one reference table belongs to one file"):
        glovecal.read_takes(file, file, reference=file)


def test_what_is_no_take(model):
    with pytest.raises(glovecal.BadInput, match=r"'monday\.csv' is a path.*read_takes"):
        glovecal.train("monday.csv")  # pyright: ignore[reportArgumentType]
    with pytest.raises(glovecal.BadInput, match="no takes were given"):
        glovecal.compare(model, [])
    with pytest.raises(glovecal.BadInput, match="takes hold a int"):
        glovecal.compare(model, [3])  # pyright: ignore[reportArgumentType]


def test_what_cannot_be_trained(takes):
    bare = glovecal.Take("bare", "", ("I_PIP",), np.arange(100.0), np.ones((100, 1)))
    with pytest.raises(glovecal.NotTrainable):
        glovecal.train(bare, layout=glovecal.Layout.from_columns("one", ["I_PIP"], ["I_PIP"]))
    with pytest.raises(glovecal.NotTrainable, match="unknown method"):
        glovecal.train(takes, method="magic")  # pyright: ignore[reportArgumentType]


def test_what_is_no_model(takes, model, tmp_path: Path):
    with pytest.raises(glovecal.BadInput, match="a calibration model is wanted, not a str"):
        glovecal.compare("anna", takes)  # pyright: ignore[reportArgumentType]
    with pytest.raises(glovecal.BadInput, match="cannot be read"):
        glovecal.load_model(tmp_path / "none")
    with pytest.raises(glovecal.BadInput, match="cannot be written"):
        glovecal.save_model(model, tmp_path / "no" / "folder")
    file = tmp_path / "model"
    name = glovecal.save_model(model, file)
    file.write_bytes(file.read_bytes()[:-1] + b"x")
    with pytest.raises(glovecal.GlovecalError, match="the file was changed"):
        glovecal.load_model(file, sha256=name)


def test_effects_and_sensors_that_do_not_exist(model, takes):
    with pytest.raises(glovecal.BadInput, match="no effect 'magic'"):
        glovecal.add_effect(model, takes, "magic")
    with pytest.raises(glovecal.BadInput, match="the model has no effect 'lag'"):
        glovecal.remove_effect(model, takes, "lag")
    with pytest.raises(KeyError, match="no effect 'magic'"):
        glovecal.effects()["magic"]
    with pytest.raises(glovecal.BadInput, match="no sensor 'THUMB'"):
        glovecal.simulate("lag", on=["THUMB"])
    with pytest.raises(glovecal.BadInput, match="nothing of it is found"):
        glovecal.add_effect(model, takes, "repeated_samples")
