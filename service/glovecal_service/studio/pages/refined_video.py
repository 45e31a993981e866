"""The take's video beside the sliders: do picture and calibrated hand agree? (Krnoul et al. 2016, 3.3.4)."""

from __future__ import annotations

from urllib.parse import quote

from nicegui import ui

from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.take.answer import HandBeside, Video
from glovecal_service.studio.hand.hand_view import HandView, VideoBeside
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio

NONE = "glovecal record --video camera:0 films a take, and it can be looked at here."


class RefinedVideo:
    """Of takes of the served model's subject; hidden until one of them has a video."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._model: Model | None = None
        self._videos: dict[str, Video] = {}
        self._view: HandView | None = None
        self._none = ui.label(NONE)
        self._choice = ui.select({}, label="Beside the video of take", clearable=True, on_change=self._chosen)
        self._choice.classes("choice").set_visibility(False)
        self._pair = ui.element("div").classes("video-pair")
        self._said = ui.label("").props('role="status"')

    async def follow(self, model: Model) -> None:
        """``model``: the one that is served now, as REST answers; the moment of the video stays."""
        self._model = model
        with refusals(self._said.set_text):
            found = await self._studio.service.read(list[Video], "/videos", subject=model.subject)
            videos = {each.take: each for each in found}
            if videos != self._videos:
                self._videos = videos
                kept = self._choice.value if self._choice.value in videos else None
                self._choice.set_options({id: each.name for id, each in videos.items()}, value=kept)
                self._choice.set_visibility(bool(videos))
                self._none.set_visibility(not videos)
            await self._chosen()

    async def _chosen(self) -> None:
        video = self._videos.get(self._choice.value or "")
        model = self._model
        if video is None or model is None:
            self._pair.clear()
            self._view = None
            self._said.set_text("")
            return
        with refusals(self._said.set_text):
            path = f"/videos/{video.take}/hand"
            hands = await self._studio.service.read(HandBeside, path, model=model.id)
            if self._view is None:
                await self._build(model.subject)
            self._shown.show(video, hands)
            self._said.set_text(f"{video.name}: {video.sentence}")

    async def _build(self, subject: str) -> None:
        skeleton = await self._studio.service.get(f"/subjects/{quote(subject)}/skeleton")
        with self._pair:
            self._view = HandView(
                skeleton, label="Calibrated hand at the moment of the picture", empty="No glove frame here",
                seen_from="palm",
            ).classes("compare-hand")  # fmt: skip
            self._shown = VideoBeside(self._view)
