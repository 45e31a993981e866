"""The name in a layout file, as TOML and JSON have it; whatever cannot be read is named after its file."""

from __future__ import annotations

from pathlib import Path

import pytest

from glovecal_client.rest import layout_name


@pytest.mark.parametrize(
    ("file", "content", "name"),
    [
        ("a.toml", 'name = "half" # of a hand\nsensors = ["A"]', "half"),
        ("a.toml", '"name" = "two#one"', "two#one"),
        ("a.toml", 'title = """\nname = "text"\n"""\nname = \'real\'', "real"),
        ("Mine.toml", 'sensors = ["A"]\n[rotations]\nname = ["A"]', "mine"),
        ("Mine.toml", "name = 3", "mine"),
        ("Mine.TOML", 'name = "broken"\nsensors = ["A"', "mine"),
        ("Mine.toml", "name = '\udcff'", "mine"),
        ("a.JSON", '{"name": "half", "sensors": ["A"]}', "half"),
        ("Mine.json", '["name"]', "mine"),
        ("Mine.json", "[" * 100_000, "mine"),
        ("Mine.toml", "a = " + "[" * 100_000, "mine"),
    ],
    ids=range(11),
)
def test_layout_name(file: str, content: str, name: str) -> None:
    assert layout_name(content.encode("utf-8", "surrogateescape"), Path(file)) == name
