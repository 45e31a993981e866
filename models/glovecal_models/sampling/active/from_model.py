"""Proposals for a model that is there: from its processes, its takes, and other readings of the glove."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.samples import require_layout
from glovecal_models.covariance.squared_exponential_ard import SquaredExponentialArd
from glovecal_models.regression.process_regressor import ProcessRegressor
from glovecal_models.sampling.active.candidates import candidate_steps
from glovecal_models.sampling.active.known_readings import known_from_takes
from glovecal_models.sampling.active.proposal import Proposal, propose
from glovecal_models.sampling.catalogue import Equipment
from glovecal_models.takes.take import Take


def propose_for_model(
    model: CalibrationModel,
    takes: Sequence[Take],
    more_free: Sequence[Take] = (),
    equipment: Equipment | None = None,
) -> Proposal:
    """``takes``: those it was trained on; ``more_free``: others, whose readings show where it is used.

    Raises LayoutMismatch, BadInput (no pose or widget is known for the layout, or hardly any frames).
    """
    for take in (*takes, *more_free):
        require_layout(take, model.layout)
    known = known_from_takes(takes, model.layout.sensors, more_free)
    trained = {
        item.rotation: item.regressor
        for item in model.rotations
        if isinstance(item.regressor, ProcessRegressor) and _is_usual(item.regressor)
    }
    found = propose(model.layout, known, candidate_steps(model.layout, equipment), trained=trained)
    return replace(found, sentences=tuple(_sentences(found, [*takes, *more_free])))


def _is_usual(regressor: ProcessRegressor) -> bool:
    """Whether the last term of its covariance is the one that bend and lengthscales are read from."""
    return regressor.covariance.parts()[-1].kind == SquaredExponentialArd.kind


def _sentences(found: Proposal, takes: Sequence[Take]) -> list[str]:
    told = []
    assumed = [name for name in found.sd_deg if name not in found.learned]
    if assumed:
        told.append(
            f"Assumed, not learned: how far {', '.join(assumed)} may be from straight "
            "(as in simulated CyberGloves, and wider)."
        )
    wearings = {take.wearing for take in takes}
    if len(wearings) > 1:
        told.append(
            f"These takes are of {len(wearings)} wearings, between which readings shift; "
            "the figures hold for one of them."
        )
    if not any(_has_free_motion(take) for take in takes):
        told.append("No free motion was recorded: the takes' own readings stand for those of everyday use.")
    return told


def _has_free_motion(take: Take) -> bool:
    return not take.rotations or bool(np.isnan(take.reference_at_frames(take.rotations)).all(axis=1).any())
