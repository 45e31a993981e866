"""What every page has around it: navigation, a heading, the drawer of jobs, notices of refusals."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from nicegui import ui

from glovecal_service.studio.heading import heading
from glovecal_service.studio.jobs_drawer import JobsDrawer
from glovecal_service.studio.studio import Studio

NAVIGATION = (
    ("live", "Live"),
    ("capture", "Capture"),
    ("cameras", "Cameras"),
    ("compare", "Compare"),
    ("diagnose", "Diagnose"),
    ("fall", "Error fall"),
    ("models", "Models"),
    ("effects", "Effects"),
)
"""Address below ``/studio`` and name of each page, in the order of the walk."""


PATIENCE_S = 60.0
"""A busy computer takes longer than the library's three seconds to ask for all that stands on a page."""
page = partial(ui.page, response_timeout=PATIENCE_S)
"""Registers the page of an address below ``/studio``."""


@contextmanager
def shell(studio: Studio, here: str, title: str) -> Iterator[None]:
    """A page: what stands in the ``with`` block is its main part."""
    ui.add_head_html('<link rel="stylesheet" href="/studio/static/studio.css">')
    ui.page_title(f"{title} – Glovecal")
    with ui.header(elevated=False).classes("studio-header"):
        ui.link("Skip to content", "#main").classes("studio-skip")
        ui.label("Glovecal").classes("studio-name")
        with ui.element("nav").props('aria-label="Pages"').classes("studio-nav"):
            for address, name in NAVIGATION:
                link = ui.link(name, f"/{address}").classes("studio-link")
                if address == here:
                    link.props('aria-current="page"')
        ui.space()
        drawer = JobsDrawer(studio)
    with ui.element("div").props('id="main" tabindex="-1"').classes("studio-main"):
        heading(1, title)
        yield
    drawer.start()
