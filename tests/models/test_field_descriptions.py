"""What is written below a field describes it in a schema, wherever the field was declared."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, create_model

from glovecal_models.presentation.document import answer
from glovecal_models.presentation.field_descriptions import describe_fields, description_of


@answer
class Found:
    rotation: str
    """Its name;
    in two lines."""
    gain: float
    plain = "no field"
    """So this describes none."""


@answer
class FoundLater(Found):
    gain: float
    """Nats."""
    samples: int = 0


class Asked(BaseModel):
    model_config = ConfigDict(json_schema_extra=describe_fields)

    seed: int = Field(0, description="Its own words.")
    """Not these."""
    found: Found | None = None
    """Null: nothing."""

    class Part(BaseModel):
        seed: int = 0
        """Of a part."""


def test_a_field_is_described_where_it_was_declared_last() -> None:
    assert [description_of(Found, name) for name in ("rotation", "gain", "plain", "missing")] == [
        "Its name;\nin two lines.", "", "", "",
    ]  # fmt: skip
    assert [description_of(FoundLater, name) for name in ("rotation", "gain", "samples")] == [
        "Its name;\nin two lines.", "Nats.", "",
    ]  # fmt: skip
    assert description_of(Asked.Part, "seed") == "Of a part."


def test_a_class_whose_source_is_not_here_has_none() -> None:
    made = create_model("Made", __base__=Asked, more=(int, 0))
    assert description_of(made, "more") == ""
    assert description_of(made, "found") == "Null: nothing."
    nowhere = type("Nowhere", (), {"__module__": "not_imported", "__annotations__": {"seed": int}})
    assert description_of(nowhere, "seed") == ""


def test_a_schema_shows_it_unless_the_field_has_words_of_its_own() -> None:
    def shown(schema: dict) -> dict:
        return {name: field.get("description") for name, field in schema["properties"].items()}

    schema = Asked.model_json_schema()
    assert shown(schema) == {"seed": "Its own words.", "found": "Null: nothing."}
    assert shown(schema["$defs"]["Found"]) == {"rotation": "Its name;\nin two lines.", "gain": None}
    later = TypeAdapter(FoundLater).json_schema()
    assert shown(later) == {"rotation": "Its name;\nin two lines.", "gain": "Nats.", "samples": None}
