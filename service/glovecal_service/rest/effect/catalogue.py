"""``effects``: the catalogue of physical causes that a calibration can know."""

from __future__ import annotations

from importlib.metadata import entry_points

from fastapi import APIRouter

from glovecal_models.effect_block import schematic
from glovecal_models.effects.base.effect import Effect, has_memory, kind_of
from glovecal_models.effects.catalogue import GROUP, catalogue, effect
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_service.plain import plain
from glovecal_service.questions.add_effect import CAN_BE_ADDED
from glovecal_service.rest.effect.answer import CatalogueEffect, ParameterView, SchematicView
from glovecal_service.rest.http.list_part import InParts
from glovecal_service.rest.http.problem import problems
from glovecal_service.rest.http.request_types import EffectInPath
from glovecal_service.store.errors import NotFound

router = APIRouter(prefix="/effects", tags=["effects"])

OURS = "glovecal-models"
MOST_MOMENTS = 400


@router.get(
    "", response_model=list[CatalogueEffect], summary="The catalogue of effects", responses=problems()
)
def list_effects(paging: InParts) -> list[CatalogueEffect]:
    """Those of Glovecal by name, then the user's own. Effects declared in a text are with their models."""
    packages = effect_packages()
    rows = [_row(item, packages.get(name, "")) for name, item in sorted(catalogue().items())]
    ordered = sorted(rows, key=lambda row: (row.own, row.kind == "nothing"))
    return paging.part_of(ordered, lambda row: row.name)


@router.get("/{name}", response_model=CatalogueEffect, summary="One effect", responses=problems())
def get_effect(name: EffectInPath) -> CatalogueEffect:
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


def effect_packages() -> dict[str, str]:
    """For each effect the distribution that brings it."""
    return {point.name: point.dist.name if point.dist else "" for point in entry_points(group=GROUP)}


def _row(item: Effect, package: str) -> CatalogueEffect:
    names = ("name", "unit", "low", "high", "prior")
    parameters = [{name: plain(getattr(one, name)) for name in names} for one in item.shape.parameters]
    return CatalogueEffect(
        name=item.name,
        explanation=item.about.explanation,
        kind=kind_of(item),
        can_be_added=kind_of(item) in CAN_BE_ADDED,
        parameters=[ParameterView(**one) for one in parameters],
        context=list(item.context),
        has_memory=has_memory(item),
        control="none" if item.comparison is None else item.comparison.control,
        source=item.about.source,
        own=package not in ("", OURS),
        package=package,
    )
