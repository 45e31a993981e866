"""Guided sampling: ``glovecal sample``, and what to record next."""
