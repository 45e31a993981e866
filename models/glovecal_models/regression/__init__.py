"""Regression from sensor readings to one rotation: linear, exact LMC-GPR and SPGP."""
