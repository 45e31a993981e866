"""Emulated gloves, byte by byte as their protocols say, moved by the simulated hand.

Written from the project's fact sheet and without a line of the drivers that they are tried with
(``tests/architecture``): two readings of one text, so that a misreading shows.
"""
