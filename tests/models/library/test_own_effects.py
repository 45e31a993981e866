"""Effects of one's own: a line of text, and a class that is registered."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import glovecal
from glovecal_models.effects import catalogue as catalogue_module

OWN = "name = stiffness; columns = lowpass(own, 0.5)"


@pytest.fixture(autouse=True)
def forgotten_afterwards() -> Iterator[None]:
    yield
    catalogue_module.registered_effects.cache_clear()


class Bend(glovecal.InstantEffect):
    """A square of the joint's angle."""

    name = "bend"
    about = glovecal.About("The sensor bends.", source="a test")

    def fit_constants(self, takes):
        return glovecal.fit_joint_units(takes)

    def columns(self, take, settings, shape):
        return glovecal.in_joint_units(take.own, settings)[:, :, None] ** 2

    def weights(self, settings):
        return glovecal.Weights(("deg_per_square_sd",))


def test_a_line_of_text_is_tried_and_added(model, takes):
    found = glovecal.diagnose(model, takes, also=[OWN])
    assert "stiffness" in [item.effect for item in found.answer.candidates]
    addition = glovecal.add_effect(model, takes, OWN, rotations=["I_PIP"], samples=300)
    assert addition.effect == "stiffness"
    assert "stiffness" not in glovecal.effects(), "it belongs to the model, not to the catalogue"
    if addition.added:
        assert glovecal.predict(addition.model, takes[0]).mean_deg.shape == (1200, 2)
        assert glovecal.remove_effect(addition.model, takes, "stiffness", samples=300).effects == ()


def test_a_registered_class_is_an_effect_like_the_others(model, takes):
    assert "bend" not in glovecal.effects()
    assert glovecal.register_effect(Bend) is Bend
    assert isinstance(glovecal.effects()["bend"], Bend)
    assert "bend" in [item.effect for item in glovecal.diagnose(model, takes).answer.candidates]
    glovecal.register_effect(Bend())  # a cell that runs again


def test_a_taken_name_and_what_is_no_effect_are_refused():
    class Lag(Bend):
        name = "lag"

    with pytest.raises(glovecal.BadInput, match="there is an effect 'lag' already"):
        glovecal.register_effect(Lag)
    with pytest.raises(glovecal.BadInput, match="is no Effect"):
        glovecal.register_effect(3)  # pyright: ignore[reportCallIssue, reportArgumentType]
