"""The newest picture of a camera, with labels and model drawn over as the user chooses."""

from __future__ import annotations

from urllib.parse import quote

from nicegui.element import Element

ROOT = "/v1"


class CameraView(Element, component="camera_view.js"):
    """Asks for one picture after another, about ten a second, while the page is seen."""

    def __init__(self, glove: str) -> None:
        super().__init__()
        address = f"{ROOT}/cameras/{quote(glove)}/picture"
        self._props.update(address=address, label=f"Picture of camera {glove}", live=False)

    def follow(self, live: bool) -> None:
        """Whether there are pictures to ask for."""
        if self._props["live"] != live:
            self._props.update(live=live)
            self.update()
