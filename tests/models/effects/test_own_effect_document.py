"""The tutorial works as it stands: its file is found by its entry point, its trial prints what it says."""

from __future__ import annotations

import re
import runpy
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from glovecal_models.effects import catalogue as catalogue_module
from glovecal_models.effects.base.control import control_columns
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.declared.expression_effect import ExpressionEffect
from glovecal_models.errors import BadInput

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "own-effect.md"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
PYTHON = [text for language, text in BLOCKS if language == "python"]
ONE_LINE, PRINTED = (text for language, text in BLOCKS if language in ("", "text"))


def announce(monkeypatch: pytest.MonkeyPatch, *points: metadata.EntryPoint) -> None:
    real = tuple(metadata.entry_points(group=catalogue_module.GROUP))
    monkeypatch.setattr(catalogue_module, "entry_points", lambda group: (*real, *points))
    catalogue_module.registered_effects.cache_clear()


@pytest.fixture(autouse=True)
def forgotten_afterwards() -> Iterator[None]:
    yield
    catalogue_module.registered_effects.cache_clear()


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tutorial's package, as if pip had installed it."""
    (tmp_path / "my_gloves").mkdir()
    (tmp_path / "my_gloves" / "strap_tension.py").write_text(PYTHON[0], encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    [toml] = [tomllib.loads(text) for language, text in BLOCKS if language == "toml"]
    [(name, value)] = toml["project"]["entry-points"][catalogue_module.GROUP].items()
    announce(monkeypatch, metadata.EntryPoint(name, value, catalogue_module.GROUP))


@pytest.mark.usefixtures("installed")
def test_the_file_is_found_and_the_trial_prints_what_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "trial.py").write_text(PYTHON[1], encoding="utf-8")
    runpy.run_path(str(tmp_path / "trial.py"))
    said = re.findall(r"'(\w+)': (-?[\d.]+)", capsys.readouterr().out)
    promised = re.findall(r"'(\w+)': (-?[\d.]+)", PRINTED)
    assert [name for name, _ in said] == [name for name, _ in promised]
    for (_, value), (_, expected) in zip(said, promised, strict=True):
        assert float(value) == pytest.approx(float(expected), abs=0.02)


@pytest.mark.usefixtures("installed")
def test_it_is_an_effect_like_the_others(signals: list[Signals]) -> None:
    strap = catalogue_module.stored_correction("strap_tension", {})
    assert strap.not_applicable_reason(signals) == "no context column c.strap_n was recorded"
    generator = np.random.default_rng(0)
    takes = [
        Signals(take.time_s, take.own, {}, {"strap_n": 9 + generator.random(len(take))}, take.wearing)
        for take in signals
    ]
    settings = strap.fit_constants(takes)
    shape = strap.shape.grid(takes, settings)[0]
    twins = control_columns(strap, takes, settings, shape, generator)
    true = [strap.columns(take, settings, shape) for take in takes]
    assert all(not np.allclose(a, b) for a, b in zip(true, twins, strict=True))
    assert np.isfinite(strap.columns(signals[0], settings, shape)).all()


def test_the_one_line_can_be_read() -> None:
    effect = ExpressionEffect.parse(ONE_LINE.strip())
    assert (effect.name, effect.context) == ("strap", ("strap_n",))


def test_what_is_no_effect_or_has_a_taken_name_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    group = catalogue_module.GROUP
    announce(monkeypatch, metadata.EntryPoint("odd", "collections:OrderedDict", group))
    with pytest.raises(BadInput, match=r"collections:OrderedDict of glovecal\.effects is not an effect"):
        catalogue_module.catalogue()
    announce(monkeypatch, metadata.EntryPoint("lag", "glovecal_models.effects.delay.lag:Lag", group))
    with pytest.raises(BadInput, match="two packages bring an effect of the name 'lag'"):
        catalogue_module.catalogue()
