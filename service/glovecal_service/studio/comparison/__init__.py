"""The parts of the Compare page: which models and takes, errors as heat, charts, an angle's terms.

Charts are ECharts: the page library has it already, so nothing is added to download or install; it draws some
thousand points on a canvas without delay, and one axis zooms several plots. What it lacks (series, cursors
and zoom by keyboard) stands around it as plain buttons.
"""
