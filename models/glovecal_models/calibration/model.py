"""The calibration model of one subject and layout: a regressor for each rotation, and where it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from glovecal_models.calibration.added_effect import AddedEffect
from glovecal_models.calibration.effect_correction import EffectCorrection, SignalScale
from glovecal_models.calibration.unseen_wearing import UnseenWearing
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_models.hand.rotations import PALM
from glovecal_models.hand.skeleton import Palm
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.names import did_you_mean
from glovecal_models.regression.linear_regressor import LinearRegressor
from glovecal_models.regression.regressor import ProcessRegressor, Regressor, RuleRegressor

_KINDS: dict[str, type[Regressor]] = {
    "linear": LinearRegressor,
    "lmc_gpr": ProcessRegressor,
    "gpr": ProcessRegressor,
    "polynomial_gpr": ProcessRegressor,
    "general_gpr": ProcessRegressor,
    "spgp": ProcessRegressor,
    "rule": RuleRegressor,
}


def restore_regressor(arrays: Mapping[str, np.ndarray], settings: Mapping[str, Any]) -> Regressor:
    """The regressor whose ``arrays`` and ``settings`` these are. Raises DamagedArtifact."""
    method = settings.get("method")
    if method not in _KINDS:
        raise DamagedArtifact(f"unknown method {method!r}; {did_you_mean(str(method), _KINDS)}")
    return _KINDS[method].restore(arrays, settings)


@dataclass(frozen=True)
class RotationModel:
    """How one rotation is predicted, and how far that can be trusted."""

    correspondence: Correspondence
    regressor: Regressor
    input_low: np.ndarray
    """Smallest training input, shape (D,), raw counts; empty for a rule."""
    input_high: np.ndarray
    """Largest training input, shape (D,), raw counts; empty for a rule."""
    uncertain_above_deg: float
    """A standard deviation of the rotation above this is flagged "too uncertain to use"."""
    held_out_rmse_deg: float | None
    """Error on takes (or, with one take, on stretches of time) left out of training."""
    samples: int

    @property
    def rotation(self) -> str:
        return self.correspondence.rotation

    @property
    def trained_ranges(self) -> tuple[tuple[str, float, float], ...]:
        """Name, smallest and largest training value of each input; none for a rule, which was not trained."""
        if not len(self.input_low):
            return ()
        return tuple(zip(self.correspondence.inputs, self.input_low, self.input_high, strict=True))


@dataclass(frozen=True)
class CalibrationModel:
    """Immutable. Two models trained from the same takes with the same settings are the same bytes."""

    layout: Layout
    subject: str
    method: str
    """How it was trained; single rotations may be ``rule``, and under ``auto`` each has its own."""
    rotations: tuple[RotationModel, ...]
    takes: tuple[str, ...]
    """sha256 of each training take's artifact (or the file's, when trained from files)."""
    parent: str | None = None
    """Model id this one was derived from."""
    error_estimate: Mapping[str, Any] = field(default_factory=dict)
    """How the held-out error was estimated, and its value over all rotations."""
    simulated: bool = False
    """True when any training take came from a simulated glove."""
    effects: tuple[AddedEffect, ...] = ()
    """Named physical causes on top of the regressors, in the order in which they were added."""
    sensor_centre: np.ndarray | None = None
    """Mean reading of each sensor in training, (S,) raw counts; only where effects need it."""
    sensor_scale: np.ndarray | None = None
    """Standard deviation of each sensor's readings in training, (S,) raw counts."""
    unseen_wearing: UnseenWearing | None = None
    """Wearings of training, and the error in another; None: a model of before this was estimated."""

    def __post_init__(self) -> None:
        names = [item.rotation for item in self.rotations]
        for added in self.effects:
            unknown = set(added.rotations) - set(names)
            if unknown:
                raise BadInput(f"effect {added.name!r} is on {sorted(unknown)[0]}, which is not in the model")
        if len(set(names)) != len(names):
            raise BadInput(f"a calibration model must not hold a rotation twice: {names}")
        for item in self.rotations:
            rule = item.regressor
            if isinstance(rule, RuleRegressor):
                missing = set(rule.rotations) - set(names)
                if missing:
                    raise BadInput(
                        f"rule for {item.rotation} needs {sorted(missing)[0]}, which is not in the model"
                    )

    def correction(self) -> EffectCorrection:
        """What the effects add to the base's prediction; with a state of its own for a stream."""
        sensors = self.layout.sensors
        nothing = np.zeros(len(sensors))
        centre = nothing if self.sensor_centre is None else self.sensor_centre
        spread = nothing + 1 if self.sensor_scale is None else self.sensor_scale
        noise = np.array([item.regressor.noise_variance for item in self.rotations])
        return EffectCorrection(
            self.effects,
            self.rotation_names,
            SignalScale(sensors, centre, spread),
            noise,
            self.unseen_wearing,
        )

    def with_sensor_order(self, sensors: Sequence[str]) -> CalibrationModel:
        """The same model for readings whose columns are in the order of ``sensors``, the same names.

        Raises BadInput for other names.
        """
        order = self.layout.sensors
        if sorted(sensors) != sorted(order):
            raise BadInput(f"readings of {', '.join(sensors)} cannot be put in the order {', '.join(order)}")
        columns = [order.index(name) for name in sensors]
        return replace(
            self,
            layout=replace(self.layout, sensors=tuple(sensors)),
            sensor_centre=None if self.sensor_centre is None else self.sensor_centre[columns],
            sensor_scale=None if self.sensor_scale is None else self.sensor_scale[columns],
        )

    def has_seen(self, wearing: str) -> bool | None:
        """Whether the wearing was in training, or in a quick check; None: the model does not say."""
        if any(item.of_wearings and item.of_wearings.knows(wearing) for item in self.effects):
            return True
        return None if self.unseen_wearing is None else self.unseen_wearing.is_seen(wearing)

    @property
    def palm(self) -> Palm:
        """Of the hand that shows this model's angles: a template that measures the palm arches it."""
        return "arching" if self.method == "template" and PALM in self.rotation_names else "rigid"

    @property
    def rotation_names(self) -> tuple[str, ...]:
        return tuple(item.rotation for item in self.rotations)
