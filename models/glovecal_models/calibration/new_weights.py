"""New weights of effects whose shapes and forms are known, on a base that has moved since."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect, form_values
from glovecal_models.calibration.fitted_effects import with_curves
from glovecal_models.calibration.joint_rows import base_rows, joint_weights, signals_of_lanes
from glovecal_models.calibration.own_signal import OwnSignal
from glovecal_models.calibration.prepared_takes import PreparedTakes
from glovecal_models.layout import Correspondence


def with_new_weights(
    effects: Sequence[AddedEffect],
    takes: PreparedTakes,
    columns: Mapping[str, Correspondence],
    own: Mapping[str, OwnSignal],
    *,
    is_linear: bool,
) -> tuple[AddedEffect, ...]:
    """``effects`` on the rotations of ``own``, all weights of a joint fitted together.

    ``columns``: for each rotation what it is read from. ``is_linear``: the base is a straight line.
    """
    rows = {name: takes.rows(name) for name in own}
    signals = [signals_of_lanes(takes, each.effect, each.rotations, columns, own) for each in effects]
    extra: dict[str, list[list[np.ndarray]]] = {name: [] for name in own}
    priors: dict[str, list[np.ndarray]] = {name: [] for name in own}
    every = [added.columns_of_takes(part) for added, part in zip(effects, signals, strict=True)]
    for added, found in zip(effects, every, strict=True):
        prior = added.effect.prior_sd(added.settings)
        prior = np.concatenate([prior, np.ones(added.weights.shape[1] - len(prior))])
        for lane, name in enumerate(added.rotations):
            extra[name].append([part[index, lane] for part, index in zip(found, rows[name], strict=True)])
            priors[name].append(prior)
    bases = {name: base_rows(takes, columns[name], rows[name], is_linear) for name in own}
    weights = {name: iter(joint_weights(bases[name], extra[name], priors[name])) for name in own}
    result = []
    for added, of_takes, found in zip(effects, signals, every, strict=True):
        mine = {name: next(weights[name]) for name in added.rotations}
        degrees = {name: [part @ item.mean for part in extra[name].pop(0)] for name, item in mine.items()}
        settings = added.settings
        if added.form is not None:
            values = [
                form_values(added.effect, take, part[:, :, : added.own_count], settings)
                for take, part in zip(of_takes, found, strict=True)
            ]
            settings = with_curves(settings, added.effect.form_unit, values, rows, degrees)
        result.append(
            replace(
                added,
                settings=settings,
                weights=np.array([item.mean for item in mine.values()]),
                zero_deg=np.array([own[name].zero_deg for name in added.rotations]),
                covariance=None
                if added.covariance is None
                else np.array([item.covariance for item in mine.values()]),
            )
        )
    return tuple(result)
