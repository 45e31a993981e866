"""The training methods by name."""

from __future__ import annotations

from typing import Literal, get_args

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
