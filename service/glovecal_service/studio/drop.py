"""Files dropped on any page: what they are is shown on the page Takes; models and videos are imported at
once."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from urllib.parse import quote, unquote

from nicegui import events, ui

from glovecal_service.plain import read, video_name
from glovecal_service.rest.glove.answer import CameraVideo
from glovecal_service.rest.model.answer import ImportedModel
from glovecal_service.rest.take.answer import UploadedFile, UploadKind
from glovecal_service.studio.chosen import Chosen
from glovecal_service.studio.service import Service, refusals
from glovecal_service.studio.studio import Studio

MOST_AT_ONCE = 200
KEPT_AS = "application/octet-stream"

Uploaded = tuple[str, str]
"""sha256, and the name on the computer that it came from."""


def written(files: Sequence[Uploaded]) -> str:
    """As they stand in the address of the page that shows what they are."""
    return ",".join(f"{sha}:{quote(name, safe='')}" for sha, name in files)


def files_of(query: str) -> list[Uploaded]:
    """What ``written`` was given."""
    pairs = (item.partition(":") for item in query.split(",") if item)
    return [(sha, unquote(name)) for sha, _, name in pairs]


class DropZone:
    """The whole page takes files, from a drop or from ``button``. What they are is shown on the page Takes;
    what becomes of models, and refusals, are notices."""

    def __init__(self, studio: Studio, about: Chosen) -> None:
        self._studio = studio
        self._about = about
        self.waiting: Sequence[Uploaded] = ()
        """Files that the page shows and that nobody imported yet: what comes next is shown with them."""
        # The library's own field has no name for those who hear the page; a button or a drop fills it.
        with ui.element("div").classes("capture-upload"):
            self._field = ui.upload(
                multiple=True,
                auto_upload=True,
                on_multi_upload=self._received,
                max_file_size=studio.largest_file,
                max_files=MOST_AT_ONCE,
                on_rejected=lambda: ui.notify(
                    f"At most {MOST_AT_ONCE} files of {studio.largest_file / 1e6:g} MB at once. Nothing was "
                    "sent.",
                    type="warning",
                ),
            )
        ui.element("div").classes("drop-here").props('aria-hidden="true"')
        ui.add_body_html(f"<script>{_LISTEN.replace('FIELD', str(self._field.id))}</script>")

    def button(self, text: str) -> ui.button:
        pick = f"() => runMethod({self._field.id}, 'pickFiles', [])"
        button = ui.button(text).props("outline no-caps").classes("studio-target")
        return button.on("click", js_handler=pick)

    async def _received(self, event: events.MultiUploadEventArguments) -> None:
        self._field.reset()
        service = self._studio.service
        sent: list[Uploaded] = []
        videos: list[Uploaded] = []
        kinds: list[str] = []
        for file in event.files:
            with refusals(partial(_warn_of, file.name)):
                answer = await service.post_file("/uploads", await file.read(), KEPT_AS)
                kept = read(UploadedFile, answer)
                kind = (await service.read(UploadKind, f"/uploads/{kept.sha256}/kind")).kind
                if kind == "video":
                    videos.append((kept.sha256, file.name))
                else:
                    kinds.append(kind)
                    sent.append((kept.sha256, file.name))
        if set(kinds) == {"model"}:
            for file in sent:
                with refusals(partial(_warn_of, file[1])):
                    sentence = await imported_model(service, file)
                    ui.notify(sentence, timeout=0, close_button="Close")
        elif sent:
            files = list(dict.fromkeys([*self.waiting, *sent]))
            ui.navigate.to(self._about.address("takes", files=written(files)))
        await self._import_videos(videos, then_shown=not sent)

    async def _import_videos(self, files: Sequence[Uploaded], *, then_shown: bool) -> None:
        """The page Cameras plays them; it opens for a single one."""
        for sha, filename in files:
            with refusals(partial(_warn_of, filename)):
                name = video_name(filename)
                body = {"upload": sha, "filename": filename}
                kept = read(CameraVideo, await self._studio.service.put(f"/camera-files/videos/{name}", body))
                ui.notify(
                    f"Video {kept.name}: {kept.pictures} pictures in {kept.seconds:.1f} s; {kept.times}.",
                    timeout=10_000,
                )
                if len(files) == 1 and then_shown:
                    ui.navigate.to(self._about.address("cameras", video=kept.name))


def _warn_of(name: str, refusal: str) -> None:
    ui.notify(f"{name}: {refusal}", type="warning", timeout=10_000)


async def imported_model(service: Service, file: Uploaded) -> str:
    """What became of a dropped model. Raises Refusal."""
    imported = read(ImportedModel, await service.post(f"/models/import/{file[0]}", create_subject=True))
    here = "was imported" if imported.is_new else "was here already"
    return f"{file[1]}: model {imported.model.short} of {imported.model.subject} {here}; it is not active."


_LISTEN = """{
const holds = event => [...(event.dataTransfer?.types ?? [])].includes("Files");
const mark = on => document.body.classList.toggle("drop-over", on);
document.addEventListener("dragover", event => { if (holds(event)) { event.preventDefault(); mark(true); } });
document.addEventListener("dragleave", event => { if (!event.relatedTarget) mark(false); });
document.addEventListener("drop", event => {
  if (!holds(event)) return;
  event.preventDefault(); mark(false);
  runMethod(FIELD, "addFiles", [event.dataTransfer.files]);
});
}"""
