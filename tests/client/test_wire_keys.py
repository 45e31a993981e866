"""Keys and names: what may stand in them, and that building and taking apart agree."""

from __future__ import annotations

import re

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st

import glovecal_client.keys
import glovecal_models.names
from glovecal_client import BadName, GloveKeys, all_gloves, all_services, parse_glove_key, service_alive_key
from glovecal_client.keys import PLANES
from glovecal_models.errors import BadInput

identifiers = st.from_regex(r"[a-z0-9][a-z0-9_-]{0,63}\Z", fullmatch=True)


def test_client_and_models_have_the_same_rule_for_names() -> None:
    assert glovecal_client.keys.IDENTIFIER.pattern == glovecal_models.names.IDENTIFIER.pattern
    assert glovecal_client.keys.CHANNEL.pattern == glovecal_models.names.CHANNEL.pattern
    assert glovecal_client.keys.DEVICES == glovecal_models.names.DEVICES
    for names in (glovecal_client.keys, glovecal_models.names):
        with pytest.raises((BadName, BadInput), match="glove: 'com3' is not allowed: Windows keeps it"):
            names.check_identifier("com3", "glove")
        assert names.check_identifier("com3-right", "glove") == "com3-right"
        assert names.subject_name("Anna-2") == "anna-2"
        for name in ("Änna", "\u212aai", "_A", ""):  # the Kelvin sign has an ASCII lower case
            with pytest.raises((BadName, BadInput), match="use a-z"):
                names.subject_name(name)


@given(identifiers, identifiers.filter(lambda name: name != "service"))
def test_built_keys_are_taken_apart_again(site: str, glove: str) -> None:
    keys = GloveKeys(site, glove)
    for plane in PLANES:
        key = getattr(keys, plane.replace("/", "_"))
        assert parse_glove_key(key) == (keys, plane)
        assert zenoh.KeyExpr(all_gloves(site, plane)).intersects(zenoh.KeyExpr(key))


@given(st.text(max_size=20))
def test_other_names_are_refused(name: str) -> None:
    if re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,63}", name):
        return
    with pytest.raises(BadName, match="not allowed"):
        GloveKeys("lab", name)


@pytest.mark.parametrize("name", ["..", "a/b", "a\0", "%2e%2e", "*", "a*", "@adv", "", "a" * 65, "service"])
def test_dangerous_names_are_refused(name: str) -> None:
    with pytest.raises(BadName):
        GloveKeys("lab", name)


@pytest.mark.parametrize(
    "key",
    ["", "glovecal", "glovecal/lab/g1", "glovecal/lab/g1/other", "x/lab/g1/raw", "glovecal/lab/G1/raw"],
)
def test_foreign_keys_are_refused(key: str) -> None:
    with pytest.raises(BadName):
        parse_glove_key(key)


def test_service_tokens_do_not_look_like_gloves() -> None:
    token = zenoh.KeyExpr(service_alive_key("lab", "main"))
    assert zenoh.KeyExpr(all_services("lab")).includes(token)
    assert not zenoh.KeyExpr(all_gloves("lab", "alive")).intersects(token)
    with pytest.raises(BadName):
        all_gloves("lab", "nothing")
