"""Drawn photographs of the colour glove, whose truth is known. They are simulated, and say so."""
