"""The charts of the pages: error over time, against a column, over what shows an effect, step by step.

They are ECharts: the page library has it already, so nothing is added to download or install; it draws some
thousand points on a canvas without delay, and one axis zooms several plots. What it lacks (legends, cursors
and zoom by keyboard) stands around it as plain elements of the page.
"""
