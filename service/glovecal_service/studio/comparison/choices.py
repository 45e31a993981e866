"""Which models and takes are compared: those of a link, else the newest model on takes it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from glovecal_service.studio.amounts import made_of, version_name

MOST_MODELS = 4
MOST_TAKES_AT_FIRST = 6
"""Chosen without being asked for, the newest ones."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Choice:
    models: tuple[Row, ...]
    """As ``GET /v1/models`` has them; of one subject and layout."""
    takes: tuple[str, ...]
    """Their ids, in the order they were recorded."""
    notices: tuple[str, ...] = ()
    """What of a link could not be followed."""


def measured_takes(model: Row, takes: Sequence[Row]) -> list[Row]:
    """Those that the model can be held against."""
    return [
        take
        for take in takes
        if take["subject"] == model["subject"] and take["layout"] == model["layout"] and take["rotations"]
    ]


def is_held_out(take: str, models: Sequence[Row]) -> bool:
    """Whether none of the models was trained on it."""
    return all(take not in _trained_on(model) for model in models)


def usual_takes(models: Sequence[Row], takes: Sequence[Row]) -> tuple[str, ...]:
    """The newest takes that were held out of training, else the newest there are."""
    own = [take["id"] for take in measured_takes(models[0], takes)]
    held_out = [take for take in own if is_held_out(take, models)]
    return tuple((held_out or own)[-MOST_TAKES_AT_FIRST:])


def first_choice(models: Sequence[Row], takes: Sequence[Row], wanted: str, on: str) -> Choice | None:
    """``wanted`` and ``on``: ids (of models also beginnings), of takes also names, with commas between.

    None where no model has takes with measured angles. Whether a take fits is for the service to say.
    """
    notices: list[str] = []
    chosen: list[Row] = []
    for name in filter(None, wanted.split(",")):
        model = next((each for each in models if each["id"].startswith(name)), None)
        if model is None:
            notices.append(f"There is no model {name}.")
        elif chosen and not are_comparable(chosen[0], model):
            notices.append(not_comparable(chosen[0], model))
        elif model not in chosen:
            chosen.append(model)
    if len(chosen) > MOST_MODELS:
        notices.append(f"{MOST_MODELS} models at most are compared at once.")
    if not chosen:
        chosen = [each for each in reversed(models) if measured_takes(each, takes)][:1]
    if not chosen:
        return None
    chosen = chosen[:MOST_MODELS]
    found = []
    for name in filter(None, on.split(",")):
        take = next((each for each in takes if each["id"] == name), None) or next(
            (each for each in takes if each["name"] == name and each["subject"] == chosen[0]["subject"]), None
        )
        if take is None:
            notices.append(f"There is no take {name}.")
        else:
            found.append(take["id"])
    return Choice(tuple(chosen), tuple(dict.fromkeys(found)) or usual_takes(chosen, takes), tuple(notices))


def are_comparable(model: Row, other: Row) -> bool:
    return (model["subject"], model["layout"]) == (other["subject"], other["layout"])


def not_comparable(model: Row, other: Row) -> str:
    return (
        f"Model {other['id'][:12]} is of {other['subject']} with layout {other['layout']}, not of "
        f"{model['subject']} with {model['layout']}: models are compared on the same takes."
    )


def short_names(models: Sequence[Row]) -> list[str]:
    """Method and effects, with the id's first digits: short enough for a legend."""
    return [f"{made_of(each)} {each['id'][:6]}" for each in models]


def model_options(models: Sequence[Row]) -> dict[str, str]:
    """Newest first."""
    return {each["id"]: f"{each['subject']}: {version_name(each)}" for each in reversed(models)}


def take_options(models: Sequence[Row], takes: Sequence[Row]) -> dict[str, str]:
    """Every take of the subject; a take that does not fit says so, and is refused when it is chosen."""
    return {
        take["id"]: f"{take['name']}, {take['wearing']}, {take['duration_s']:.0f} s, {_mark(take, models)}"
        for take in takes
        if take["subject"] == models[0]["subject"]
    }


def _mark(take: Row, models: Sequence[Row]) -> str:
    if take["layout"] != models[0]["layout"]:
        return f"layout {take['layout']}"
    if not take["rotations"]:
        return "no measured angles"
    return "held out" if is_held_out(take["id"], models) else "trained on"


def _trained_on(model: Row) -> set[str]:
    """Models of early versions keep ids, later ones also names."""
    return {take["id"] if isinstance(take, Mapping) else take for take in model["facts"].get("takes", ())}
