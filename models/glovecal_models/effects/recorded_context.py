"""Recorded causes: temperature, humidity, supply voltage and contact pressure, each a context column."""

from __future__ import annotations

import numpy as np

from glovecal_models.effects.base.column_steps import step_columns, step_names, step_prior_sd
from glovecal_models.effects.base.comparison import EffectComparison
from glovecal_models.effects.base.context_effect import ContextEffect, SlowContextEffect
from glovecal_models.effects.base.facts import About, Parameter, Shape, Weights
from glovecal_models.effects.base.relations import AIR, CROSSED, ONE_FINGER
from glovecal_models.effects.base.signals import Settings, Signals, in_joint_units

OWN_PRIOR_DEG = 1.0
"""How far a joint may depart from the common scaling, for the whole fall of the voltage."""


class Temperature(SlowContextEffect):
    name = "temperature"
    about = About(
        "The reading changes with the temperature of glove and hand.",
        source="linear temperature coefficients of offset and gain, deg/K; cloth follows within minutes",
        shown_over="context",
        shown_by=AIR,
    )
    context = ("temperature_c",)
    comparison = EffectComparison(
        "context of other takes"
    )  # poses show how the reading goes, if not how late


class Humidity(SlowContextEffect):
    name = "humidity"
    about = About(
        "The reading changes with the humidity inside the glove.",
        source="linear coefficients of offset and gain, deg/%; follows within minutes",
        shown_over="context",
        shown_by=AIR,
    )
    context = ("humidity_pct",)


class ContactPressure(ContextEffect):
    name = "contact_pressure"
    about = About(
        "Pressing against an object changes the reading although the joint does not move.",
        source="offset and gain per newton",
        shown_over="context",
        shown_by=ONE_FINGER,
    )
    context = ("contact_n",)
    comparison = EffectComparison("circularly shifted")


class SupplySag(ContextEffect):
    """Columns: the common scaling about a reading of zero, then each joint's own departure from it in offset
    and gain. Two more where it acts in steps."""

    name = "supply_sag"
    about = About(
        "All readings shrink together as the supply voltage falls.",
        source="reading x (V / V0)^n, n about 1; small departures for each joint",
        shown_over="context",
        shown_by=CROSSED,
    )
    context = ("supply_v",)
    shape = Shape((Parameter("exponent", "1", 0.3, 3.0, "about 1", tried=(1.0, 2.0)),))
    has_any_form = True
    may_act_in_steps = True

    def columns(self, take: Signals, settings: Settings, shape: np.ndarray) -> np.ndarray:
        volts = self.clipped(take, settings)
        loss = (volts[:, None] / max(settings["usual"], 1e-6)) ** -shape[None, :, 0] - 1.0
        zero = np.resize(0.0 if take.zero_deg is None else take.zero_deg, take.own.shape[1])
        common = (take.own - zero) * loss
        own = (volts / max(settings["high"] - settings["low"], 1e-9))[:, None] * np.ones_like(take.own)
        own = own - settings["usual"] / max(settings["high"] - settings["low"], 1e-9)
        joint = in_joint_units(take.own, settings)
        smooth = np.stack([common, own, own * joint, own * joint**2], axis=2)
        return np.concatenate([smooth, step_columns(volts, take.own, settings)], axis=2)

    def weights(self, settings: Settings) -> Weights:
        own = ("own_offset_deg", "own_gain_deg_per_sd", "own_bend_deg_per_sd2")
        return Weights(
            ("common_scaling_deg_per_deg", *own, *step_names(settings, self.column)),
            np.append([1.0, OWN_PRIOR_DEG, OWN_PRIOR_DEG, OWN_PRIOR_DEG], step_prior_sd(settings)),
        )
