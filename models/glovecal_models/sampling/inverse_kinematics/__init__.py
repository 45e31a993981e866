"""Rotations from where fingertips are: IK sampling of Wang & Neff 2013, section 5.2.

A touch tells where two fingertips are without any camera: in the same place.
"""
