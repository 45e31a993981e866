"""The model of a subject that predicts live."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from glovecal_service.cli.terminal.refusal import Refusal

if TYPE_CHECKING:
    from glovecal_client.rest import RestClient


def active_model(service: RestClient, subject: str | None, layout: str | None) -> str:
    """Its id. Raises BadParameter without a subject, Refusal when there is none or one of each layout."""
    if subject is None:
        raise typer.BadParameter("name a model, or a subject with --subject")
    query = {"subject": subject} | ({"layout": layout} if layout else {})
    active = [row for row in service.get("/models", query) if row["active"]]
    if len(active) > 1:
        layouts = ", ".join(row["layout"] for row in active)
        raise Refusal(f"subject {subject} has active models of {layouts}; choose one with --layout")
    if not active:
        raise Refusal(f"subject {subject} has no active model; train one: glovecal train --subject {subject}")
    return active[0]["id"]
