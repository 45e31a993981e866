"""How to train: the choices a caller may make, with defaults that work."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, get_args

from glovecal_models.calibration.samples import DEFAULT_SAMPLES
from glovecal_models.errors import BadInput
from glovecal_models.regression.lmc_search import LmcOptimum

Method = Literal[
    "raw", "linear", "lmc_gpr", "spgp", "auto", "polynomial_gpr", "general_gpr", "two_shapes", "template"
]
METHODS: tuple[Method, ...] = get_args(Method)
"""``raw`` is no calibration at all, the scale that the others are read against; ``auto`` takes for each
rotation what fits it (``kernel_choice``), ``polynomial_gpr`` and ``general_gpr`` insist on a kind of kernel;
``two_shapes`` and ``template`` are calibrations by scale and offset (``template``).
"""
OF_SHAPES: tuple[Method, ...] = ("two_shapes", "template")
"""Methods that learn from hand shapes of which only the name is known."""
LINEAR_METHODS: tuple[Method, ...] = ("raw", "linear", "two_shapes", "template")
"""Those whose regressors are planes."""
"""Called with a sentence and the fraction done, 0 to 1."""


class PriorPlane(NamedTuple):
    """What a linear calibration says of one rotation, by the names of its sensors."""

    rotation: str
    sensors: tuple[str, ...]
    gains: tuple[float, ...]
    """Degrees a count."""
    offset_deg: float
    """At readings of 0."""


@dataclass(frozen=True)
class TrainingSettings:
    """How to train. The defaults suit a CyberGlove; all of them enter each task's key."""

    method: Method = "lmc_gpr"
    samples: int = DEFAULT_SAMPLES
    """Largest representative set for one rotation."""
    folds: int = 3
    """Held-out folds for the error estimate; 0 trains without one."""
    pseudo_inputs: int = 100
    iterations: int = 200
    seed: int = 0
    keep_dead: bool = False
    """Whether sensors that are dead or clipped in the takes are kept, so that one that never changes is
    refused; else they are left out (``usable_sensors``)."""
    kernels: tuple[tuple[str, str], ...] = ()
    """(rotation, candidate kernel) already chosen: when a model is trained again, with an effect for example,
    its kernels stay, so that a change of the error is the effect's."""

    optima: tuple[tuple[str, LmcOptimum], ...] = ()
    """(rotation, optimum) already found with more takes: a fold of the same training keeps its sample weight
    and begins its search there."""

    prior: tuple[PriorPlane, ...] = ()
    """Planes that are the mean of LMC-GPR (``prior_mean``); no other method has one."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "kernels", tuple((str(name), str(kernel)) for name, kernel in self.kernels))
        if self.folds < 0 or self.folds == 1:
            raise BadInput(
                f"folds is {self.folds}: one fold would hold out everything; 0 trains without an error "
                "estimate, 2 or more with one"
            )
        if self.prior and self.method != "lmc_gpr":
            raise BadInput(f"a prior mean is for method lmc_gpr, not for {self.method}")


LEFT_OUT_SAMPLES = 500
"""For one rotation: what wearings differ by is far above what more samples would save."""


def left_out_settings(settings: TrainingSettings) -> TrainingSettings:
    """How the fits without a wearing are trained."""
    return replace(settings, samples=min(settings.samples, LEFT_OUT_SAMPLES))
