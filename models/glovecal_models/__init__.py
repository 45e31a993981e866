"""The mathematics of Glovecal: from takes to calibration models, their errors and the causes of those."""
