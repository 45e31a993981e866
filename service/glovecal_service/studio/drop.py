"""Files dropped on any page: what they are is shown on the page Takes; models are imported at once."""

from __future__ import annotations

from collections.abc import Sequence
from urllib.parse import quote, unquote

from nicegui import events, ui

from glovecal_service.plain import read
from glovecal_service.rest.model.answer import ImportedModel
from glovecal_service.rest.take.answer import UploadedFile, UploadKind
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.studio import Studio

MOST_AT_ONCE = 200
KEPT_AS = "application/octet-stream"

Uploaded = tuple[str, str]
"""sha256, and the name on the computer that it came from."""


def address_of(files: list[Uploaded]) -> str:
    """Of the page that shows what these files are."""
    return "/takes?files=" + quote(",".join(f"{sha}:{quote(name, safe='')}" for sha, name in files))


def files_of(query: str) -> list[Uploaded]:
    """What ``address_of`` was given."""
    pairs = (item.partition(":") for item in query.split(",") if item)
    return [(sha, unquote(name)) for sha, _, name in pairs]


class DropZone:
    """The whole page takes files, from a drop or from ``button``. What they are is shown on the page Takes;
    what becomes of models, and refusals, are notices."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
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
        return ui.button(text).on("click", js_handler=pick)

    async def _received(self, event: events.MultiUploadEventArguments) -> None:
        self._field.reset()
        service = self._studio.service
        shown: list[Uploaded] = []
        for file in event.files:
            content = await file.read()
            try:
                kept = read(UploadedFile, await service.post_file("/uploads", content, KEPT_AS))
                if (await service.read(UploadKind, f"/uploads/{kept.sha256}/kind")).kind == "model":
                    await self._import_model(file.name, content)
                else:
                    shown.append((kept.sha256, file.name))
            except Refusal as refusal:
                ui.notify(f"{file.name}: {refusal}", type="warning", timeout=10_000)
        if shown:
            ui.navigate.to(address_of(list(dict.fromkeys([*self.waiting, *shown]))))

    async def _import_model(self, name: str, content: bytes) -> None:
        kept = await self._studio.service.post_file("/models/import", content, KEPT_AS, create_subject=True)
        found = read(ImportedModel, kept)
        here = "was imported" if found.is_new else "was here already"
        ui.notify(
            f"{name}: model {found.model.short} of {found.model.subject} {here}; it is not active.",
            timeout=0,
            close_button="Close",
        )


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
