"""The ``glovecal`` command, all of it speaking REST: a folder per noun, a file per verb."""

import gc

SELDOM = (20_000, 20, 20)
"""Thresholds of the garbage collector: with Python's own it goes through all that a verb imports again and
again, for a sixth of the time that the verb takes to start."""
gc.set_threshold(*SELDOM)
