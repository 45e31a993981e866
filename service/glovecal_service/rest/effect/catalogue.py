"""``effects``: the catalogue of physical causes that a calibration can know."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Annotated, Any

from fastapi import APIRouter, Path
from pydantic import BaseModel, Field

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.base.facts import Kind
from glovecal_models.effects.catalogue import GROUP, catalogue, effect
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.plain import plain
from glovecal_service.report.effect_schematic import schematic
from glovecal_service.rest.http.answers import problems
from glovecal_service.rest.http.request_types import ONE_LINE
from glovecal_service.store.errors import NotFound

router = APIRouter(prefix="/effects", tags=["effects"])

OURS = "glovecal-models"
MOST_MOMENTS = 400
EffectInPath = Annotated[str, Path(max_length=64, pattern=ONE_LINE, description="As in the catalogue.")]


class ParameterView(BaseModel):
    name: str
    unit: str
    low: float | None
    high: float | None
    prior: str = Field(description="What is known before any measurement.")


class CatalogueEffect(BaseModel):
    name: str
    explanation: str
    kind: Kind = Field(
        description="correction: adds to the prediction; repair: mends the reference; interval: widens "
        "the claimed standard deviation; finding: says where a recording lost something; nothing: the null "
        "hypothesis."
    )
    can_be_added: bool = Field(description="Whether `models/{id}/effects` takes it.")
    parameters: list[ParameterView] = Field(description="What is searched for beside weights.")
    context: list[str] = Field(description="Context columns (`c.NAME`) it needs.")
    has_memory: bool
    control: str = Field(
        description="How its negative control is made: columns with the same freedom that cannot be right."
    )
    source: str
    own: bool = Field(description="Brought by a package of the user's own.")
    package: str


class SchematicView(BaseModel):
    """Sizes are for show; the shapes are the effect's own."""

    time_s: list[float]
    without: list[float | None] = Field(description="The reading, or the measured angle, without the effect.")
    with_effect: list[float | None]
    label: str = Field(description="reading, or measured angle.")
    time_label: str


@router.get(
    "", response_model=list[CatalogueEffect], summary="The catalogue of effects", responses=problems()
)
def list_effects() -> list[dict[str, Any]]:
    """Those of Glovecal by name, then the user's own. Effects declared in a text are with their models."""
    packages = effect_packages()
    rows = [_row(item, packages.get(name, "")) for name, item in sorted(catalogue().items())]
    return sorted(rows, key=lambda row: (row["own"], row["kind"] == "nothing"))


@router.get("/{name}", response_model=CatalogueEffect, summary="One effect", responses=problems())
def get_effect(name: EffectInPath) -> dict[str, Any]:
    return _row(_known(name), effect_packages().get(name, OURS))


@router.get(
    "/{name}/schematic",
    response_model=SchematicView,
    summary="What an effect does to a reading, schematically",
    responses=problems(),
)
def get_schematic(name: EffectInPath) -> SchematicView:
    """A reading without it and with it over a small motion. 404 also where nothing shows it."""
    shown = schematic(_known(name))
    if shown is None:
        raise NotFound(f"effect {name!r} has no picture: it changes no reading")
    step = max(1, -(-len(shown.time_s) // MOST_MOMENTS))
    return SchematicView(
        time_s=shown.time_s[::step].tolist(),
        without=shown.without[::step].tolist(),
        with_effect=shown.with_it[::step].tolist(),
        label=shown.label,
        time_label=shown.time_label,
    )


def _known(name: str) -> Effect:
    try:
        return effect(name)
    except BadInput as error:
        raise NotFound(f"there is no effect {name!r}; {did_you_mean(name, sorted(catalogue()))}") from error


def can_be_added(item: Effect) -> bool:
    """Corrections, and what is found in a recording as far as it can be repaired or claimed."""
    return item.kind in ("correction", "repair", "interval")


def effect_packages() -> dict[str, str]:
    """For each effect the distribution that brings it."""
    return {point.name: point.dist.name if point.dist else "" for point in entry_points(group=GROUP)}


def _row(item: Effect, package: str) -> dict[str, Any]:
    parameters = [
        {"name": one.name, "unit": one.unit, "low": one.low, "high": one.high, "prior": one.prior}
        for one in item.parameters
    ]
    return plain(
        {
            "name": item.name,
            "explanation": item.explanation,
            "kind": item.kind,
            "can_be_added": can_be_added(item),
            "parameters": parameters,
            "context": item.context,
            "has_memory": item.has_memory,
            "control": item.control,
            "source": item.source,
            "own": package not in ("", OURS),
            "package": package,
        }
    )
