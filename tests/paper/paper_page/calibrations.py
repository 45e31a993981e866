"""The four calibrations, as the page names and draws them."""

from __future__ import annotations

from glovecal_models.presentation.drawing import FLOOR, MODEL, QUIET

CALIBRATION_NAMES = {"raw": "raw", "linear": "linear", "lmc_gpr": "LMC-GPR", "spgp": "SPGP 100"}
COLOURS = {"raw": QUIET, "linear": FLOOR, "lmc_gpr": MODEL, "spgp": "#3f9c6b"}
