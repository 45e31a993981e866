"""Files dropped on a page, as from a file manager."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path

from playwright.sync_api import Page


def drop(page: Page, files: Sequence[Path]) -> None:
    """As from a file manager onto the middle of the page."""
    page.locator(".q-uploader").wait_for(state="attached")
    dropped = [{"name": file.name, "data": base64.b64encode(file.read_bytes()).decode()} for file in files]
    page.evaluate(
        """files => {
            const dropped = new DataTransfer();
            const bytes = file => Uint8Array.from(atob(file.data), c => c.charCodeAt(0));
            for (const file of files)
                dropped.items.add(new File([bytes(file)], file.name));
            document.querySelector("#main").dispatchEvent(
                new DragEvent("drop", {dataTransfer: dropped, bubbles: true, cancelable: true}));
        }""",
        dropped,
    )
