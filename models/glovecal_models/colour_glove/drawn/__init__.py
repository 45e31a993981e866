"""Hands in the colour glove, their motion and photographs, drawn: simulated, so that their truth is known."""
