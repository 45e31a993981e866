"""Answers as a person reads them: described once, drawn by the terminal, pages, the studio and notebooks."""
