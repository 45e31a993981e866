"""From the takes of a guided sampling to a calibration (Wang & Neff 2013, sections 5 and 6).

``guided_calibration.py`` is what a caller needs; the other files are its parts.
"""
