"""The choice of a model at the head of a page."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import ui
from nicegui.events import ValueChangeEventArguments

from glovecal_service.studio.amounts import version_name
from glovecal_service.studio.service import Service


async def model_select(service: Service, wanted: str, chosen: Callable[[str], Awaitable[None]]) -> str | None:
    """The id to begin with: ``wanted``, also its first digits, else the newest active one; None without any.

    ``chosen`` is called with each other one.
    """
    models = await service.get("/models")
    if not models:
        ui.label("No model yet: record takes and train one.").classes("studio-notice")
        return None
    names = {each["id"]: f"{each['subject']}: {version_name(each)}" for each in reversed(models)}
    active = next((each["id"] for each in reversed(models) if each["active"]), models[-1]["id"])
    own = [name for name in names if wanted and name.startswith(wanted)]
    first = own[0] if len(own) == 1 else active
    if len(own) > 1:
        ui.label(f"Several models begin with {wanted[:12]}.").classes("studio-notice").props('role="status"')
    elif wanted and not own:
        ui.label(f"There is no model {wanted[:12]}.").classes("studio-notice").props('role="status"')

    async def change(event: ValueChangeEventArguments) -> None:
        await chosen(str(event.value))

    ui.select(names, value=first, label="Model", on_change=change).classes("choice")
    return first
