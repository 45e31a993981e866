"""Cameras: what a camera sees of the colour glove, what is made of it, and how sure that is."""

from __future__ import annotations

from nicegui import ui

from glovecal_service.rest.glove.answer import CameraVideo, CameraView
from glovecal_service.studio.drop import DropZone
from glovecal_service.studio.heading import heading, main_act
from glovecal_service.studio.pages.camera_card import STAGES, CameraCard
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 0.5
SOURCES = {
    "camera:0": "Camera 0 of the service's computer",
    "camera:1": "Camera 1",
    "rendered": "A drawn glove (simulated)",
}
KEPT = {
    "labels": "Labels of the pictures tracked (0.5 GB an hour, no face)",
    "pictures": "Every picture as it came (tens of GB an hour)",
    "nothing": "Nothing",
}


def add(studio: Studio) -> None:
    """``/studio/cameras``."""

    @page("/cameras")
    async def cameras(video: str = "") -> None:
        async with shell(studio, "cameras", "Cameras") as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/compare.css">')
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/camera.css">')
            await CamerasPage(studio, around.drop, video).build()


class CamerasPage:
    """One open page; cameras come and go."""

    def __init__(self, studio: Studio, drop: DropZone, video: str) -> None:
        """``video``: an imported one that is chosen at first; "" for none."""
        self._studio, self._drop, self._video = studio, drop, video
        self._cards: dict[str, CameraCard] = {}

    async def build(self) -> None:
        self._notice = ui.label("").classes("studio-notice").props('role="status"')
        self._cameras = ui.element("div").classes("cameras")
        self._form(await self._studio.service.read(list[CameraVideo], "/camera-files/videos"))
        await self._look()
        again(EVERY_S, self._look)

    def _form(self, videos: list[CameraVideo]) -> None:
        sources = SOURCES | {
            f"video:{each.name}": f"Video {each.name}: {each.seconds:.0f} s; {each.times}" for each in videos
        }
        chosen = f"video:{self._video}"
        with ui.element("section").classes("card capture-form").props('aria-label="New camera"'):
            heading(2, "Start a camera")
            ui.label(
                "A cloth glove with the printed pattern, and one camera: poses go out like any glove's. "
                "The first start builds the pose database, in about a minute; glovecal camera prepare does "
                "that beforehand."
            )
            with ui.row().classes("items-center"):
                ui.label("A phone's video: drop it on the page, or")
                self._drop.button("Import a video")
            with ui.element("div").classes("capture-fields"):
                self._source = ui.select(
                    sources, value=chosen if chosen in sources else "camera:0", label="Pictures of"
                ).classes("choice")
                self._glove = ui.input("Name of the glove", value="colour-glove").classes("choice")
                self._stage = ui.select(list(STAGES), value="dense", label="Stage").classes("choice")
                self._keep = ui.select(KEPT, value="labels", label="Keep").classes("choice")
            self._mirrored = ui.checkbox("The pictures are mirrored").tooltip(
                "As those of a selfie camera or a preview often are: then left and right are put back"
            )
            main_act("Start", self._start)

    async def _start(self) -> None:
        body = {
            "source": self._source.value, "glove": str(self._glove.value).strip(),
            "stage": self._stage.value, "keep": self._keep.value, "mirrored": self._mirrored.value,
        }  # fmt: skip
        with refusals(warn_long):
            await self._studio.service.post("/cameras", body)
            await self._look()

    async def _look(self) -> None:
        with refusals(self._notice.set_text):
            found = await self._studio.service.read(list[CameraView], "/cameras")
            self._notice.set_text("" if found else "No camera is on.")
            here = {each.glove: each for each in found}
            for gone in self._cards.keys() - here.keys():
                self._cards.pop(gone).delete()
            for glove, camera in here.items():
                if glove not in self._cards:
                    with self._cameras:
                        self._cards[glove] = CameraCard(self._studio, glove)
                self._cards[glove].show(camera)
