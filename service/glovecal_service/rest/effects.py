"""``effects``: the catalogue of physical causes that a calibration can know."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Path
from pydantic import BaseModel, Field

from glovecal_models.effects.catalogue import GROUP, catalogue
from glovecal_models.effects.columnless_effect import ColumnlessEffect
from glovecal_models.effects.effect import Effect
from glovecal_service.plain import plain
from glovecal_service.rest.answers import problems
from glovecal_service.rest.names import ONE_LINE
from glovecal_service.store.errors import NotFound

router = APIRouter(prefix="/effects", tags=["effects"])

OURS = "glovecal-models"
NO_EFFECT = "no_effect"
Kind = Literal["correction", "repair", "finding", "nothing"]
EffectInPath = Annotated[str, Path(max_length=64, pattern=ONE_LINE, description="As in the catalogue.")]


class ParameterView(BaseModel):
    name: str
    unit: str
    low: float | None
    high: float | None
    prior: str = Field(description="What is known before any measurement.")


class EffectView(BaseModel):
    name: str
    explanation: str
    kind: Kind = Field(
        description="correction: adds to the prediction; repair: mends the reference; finding: says where a "
        "recording lost something; nothing: the null hypothesis."
    )
    can_be_added: bool = Field(description="Whether `models/{id}/effects` takes it.")
    parameters: list[ParameterView] = Field(description="What is searched for beside weights.")
    context: list[str] = Field(description="Context columns (`c.NAME`) it needs.")
    has_memory: bool
    decoy: str = Field(description="The twin with the same freedom that cannot be right.")
    source: str
    own: bool = Field(description="Brought by a package of the user's own.")
    package: str


@router.get("", response_model=list[EffectView], summary="The catalogue of effects", responses=problems())
def list_effects() -> list[dict[str, Any]]:
    """Those of Glovecal by name, then the user's own. Effects declared in a text are with their models."""
    packages = effect_packages()
    rows = [_row(effect, packages.get(name, "")) for name, effect in sorted(catalogue().items())]
    return sorted(rows, key=lambda row: (row["own"], row["kind"] == "nothing"))


@router.get("/{name}", response_model=EffectView, summary="One effect", responses=problems())
def get_effect(name: EffectInPath) -> dict[str, Any]:
    known = catalogue()
    if name not in known:
        raise NotFound(f"there is no effect {name!r}; there are {', '.join(sorted(known))}")
    return _row(known[name], effect_packages().get(name, ""))


def kind_of(effect: Effect) -> Kind:
    """What an effect does to a calibration."""
    if effect.name == NO_EFFECT:
        return "nothing"
    if effect.side == "reference":
        return "repair"
    return "finding" if isinstance(effect, ColumnlessEffect) else "correction"


def can_be_added(effect: Effect) -> bool:
    """Corrections, and the one repair whose size a model has to keep."""
    return kind_of(effect) == "correction" or effect.name == "clock_offset"


def effect_packages() -> dict[str, str]:
    """For each effect the distribution that brings it."""
    return {point.name: point.dist.name if point.dist else "" for point in entry_points(group=GROUP)}


def _row(effect: Effect, package: str) -> dict[str, Any]:
    parameters = [
        {"name": item.name, "unit": item.unit, "low": item.low, "high": item.high, "prior": item.prior}
        for item in effect.parameters
    ]
    return plain(
        {
            "name": effect.name,
            "explanation": effect.explanation,
            "kind": kind_of(effect),
            "can_be_added": can_be_added(effect),
            "parameters": parameters,
            "context": effect.context,
            "has_memory": effect.has_memory,
            "decoy": effect.decoy,
            "source": effect.source,
            "own": package not in ("", OURS),
            "package": package,
        }
    )
