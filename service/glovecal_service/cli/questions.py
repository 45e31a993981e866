"""The verbs of all questions that have one."""

from __future__ import annotations

import typer

from glovecal_service.cli.asking import verb, verb_at_once
from glovecal_service.questions.catalogue import AT_ONCE, QUESTIONS


def add_questions(app: typer.Typer, panel: str) -> None:
    """To the command, below a heading of its help."""
    for question in QUESTIONS.values():
        if question.verb is not None:
            app.command(question.verb, rich_help_panel=panel)(verb(question))
    for at_once in AT_ONCE.values():
        if at_once.verb is not None:
            app.command(at_once.verb, rich_help_panel=panel)(verb_at_once(at_once))
