"""Effects that users declared as expressions: known by name only while a job of theirs runs.

A declared effect belongs to the models that hold it, not to the catalogue: two models may each have a
``strap`` of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue, effect_of_declaration

_ONE_JOB = threading.RLock()


def declared_in(model: CalibrationModel) -> list[Effect]:
    """The declared effects that a model holds."""
    found = {item.name: item.effect for item in model.effects if "declaration" in item.settings}
    return list(found.values())


def declaration_of(model: CalibrationModel, name: str) -> Mapping[str, Any] | None:
    """The document that declares a model's effect, None for one of the catalogue."""
    for item in model.effects:
        if item.name == name and "declaration" in item.settings:
            return item.settings["declaration"]
    return None


def declared(document: Mapping[str, Any] | None) -> list[Effect]:
    """The effect of a declaration as a list of one, or of none."""
    return [] if document is None else [effect_of_declaration(document)]


@contextmanager
def known_by_name(effects: Sequence[Effect]) -> Iterator[None]:
    """Within the block ``effects`` answer to their names; for one job of this process at a time."""
    with _ONE_JOB:
        known = catalogue()
        before = {item.name: known.get(item.name) for item in effects}
        known.update({item.name: item for item in effects})
        try:
            yield
        finally:
            for name, earlier in before.items():
                if earlier is None:
                    del known[name]
                else:
                    known[name] = earlier
