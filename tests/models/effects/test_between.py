"""What stands between two effects: a table that is checked when effects are loaded, and may be added to."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import glovecal
from glovecal_models.diagnosis.next_take import next_take
from glovecal_models.effects import catalogue as catalogue_module
from glovecal_models.effects.base.facts import About
from glovecal_models.effects.base.relations import Motion, Relations, Rival, Whole
from glovecal_models.effects.between import TABLE
from glovecal_models.effects.catalogue import catalogue, relations
from glovecal_models.errors import BadInput

LOOSEN = Motion("loosen", "Loosen the strap half-way through a take.", 40)


@pytest.fixture(autouse=True)
def forgotten_afterwards() -> Iterator[None]:
    yield
    catalogue_module.registered_effects.cache_clear()


def strap(*rows: Rival) -> glovecal.SignatureEffect:
    class Strap(glovecal.SignatureEffect):
        name = "strap"
        about = About("The strap is tight.", source="a test", relations=Relations(rivals=rows))

        def find(self, takes, sensor_of, errors=None):
            return ()

    return Strap()


def test_what_comes_with_glovecal_is_in_order() -> None:
    TABLE.check(catalogue())
    assert relations() == TABLE


def test_look_alikes_are_so_both_ways() -> None:
    for name in catalogue():
        for other in TABLE.alike_to(name):
            assert name in TABLE.alike_to(other)


def test_a_recording_holds_both_ways_unless_the_other_way_has_its_own() -> None:
    for one, other in ((row.effect, row.rival) for row in TABLE.rivals):
        assert TABLE.recording(one, other) is not None
        assert TABLE.recording(other, one) is not None
    first, second = (TABLE.recording(*pair) for pair in (("lag", "hysteresis"), ("hysteresis", "lag")))
    assert first is not None
    assert second is not None
    assert (first.name, second.name) == ("fast", "ramps")
    assert TABLE.recording("creep", "saturation") is None


def test_an_effect_of_ones_own_brings_its_rivals() -> None:
    effect = glovecal.register_effect(strap(Rival("strap", "contact_pressure", LOOSEN)))
    asked = next_take(("contact_pressure", "strap"), {**catalogue(), effect.name: effect})
    assert asked is not None
    assert asked.motion == "loosen"


def test_a_row_of_an_effect_that_nobody_knows_is_refused() -> None:
    with pytest.raises(BadInput, match="names 'temprature', which is no effect"):
        glovecal.register_effect(strap(Rival("strap", "temprature", LOOSEN)))
    assert "strap" not in catalogue()


@pytest.mark.parametrize(
    ("table", "why"),
    [
        (Relations(rivals=(Rival("lag", "lag", LOOSEN),)), "relates 'lag' to itself"),
        (Relations(rivals=(Rival("lag", "creep", LOOSEN),) * 2), "rivals of lag and creep twice"),
        (Relations(alike=(("lag", "creep"), ("creep", "humidity"))), "look-alikes of creep twice"),
        (Relations(wholes=(Whole("creep", ("lag",), 0.5, ""),) * 2), "parts of creep twice"),
        (Relations(unrecorded=(("gravity", "x"),)), "names 'gravity'"),
    ],
)
def test_rows_that_cannot_be_are_refused(table: Relations, why: str) -> None:
    with pytest.raises(BadInput, match=why):
        table.check(catalogue())
