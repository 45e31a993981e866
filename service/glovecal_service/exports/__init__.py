"""Hands in motion, written for other tools: a format is one file, registered in ``formats``.

``motion_files`` reads what others wrote, ``vendor_calibrations`` reads and writes their calibrations.
"""
