"""Finger spelling: the letters as angles, the nearest letter, text from a stream, and the confusion table."""
