"""Models and subjects: versions as a tree of descent, what they are made of; takes, hands and gloves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from nicegui import ui

from glovecal_service.studio.amounts import degrees, made_of
from glovecal_service.studio.file_button import FileButton
from glovecal_service.studio.hand.dimensions_form import DimensionsForm
from glovecal_service.studio.heading import heading
from glovecal_service.studio.pages.gloves_table import gloves_table
from glovecal_service.studio.pages.model_parts import ModelParts
from glovecal_service.studio.pages.takes_table import TakesTable
from glovecal_service.studio.service import Refusal
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 2.0


def add(studio: Studio) -> None:
    """``/studio/models``."""

    @page("/models")
    async def models() -> None:
        with shell(studio, "models", "Models and subjects"):
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await ModelsPage(studio).build()
            with ui.element("div").classes("trees"):
                await TakesTable(studio.service).build()
                await DimensionsForm(studio.service).build()
                await gloves_table(studio.service)


class ModelsPage:
    """One open page; models made elsewhere appear, deleted ones go."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._seen: object = None

    async def build(self) -> None:
        self._notice = ui.label("").classes("studio-notice").props('role="status"')
        self._trees = ui.element("div").classes("trees")
        FileButton(
            "Import a model", suffixes=".safetensors", largest=self._studio.largest_file,
            take=self._import, tell=self._notice.set_text,
        ).button.props("outline no-caps").classes("studio-target page-acts")  # fmt: skip
        await self._look()
        ui.timer(EVERY_S, self._look)

    async def _look(self) -> None:
        models = await self._studio.service.get("/models")
        seen = [(each["id"], each["active"], each["damage"]) for each in models]
        if seen == self._seen:
            return
        self._seen = seen
        self._notice.set_text("" if models else "No model yet: record takes and train one.")
        self._trees.clear()
        with self._trees:
            for worn in dict.fromkeys(_worn(each) for each in models):
                self._tree(*worn, [each for each in models if _worn(each) == worn])

    def _tree(self, subject: str, layout: str, hand: str | None, models: Sequence[Mapping[str, Any]]) -> None:
        of_hand = f", {hand} hand" if hand else ""
        with ui.element("section").classes("tree").props() as section:
            section.props["aria-label"] = f"Models of {subject}{of_hand}"
            with ui.row().classes("tree-head"):
                heading(2, f"{subject}, {layout}{of_hand}")
                ui.button(
                    "Return to the model before", on_click=lambda: self._roll_back(subject, layout, hand)
                ).props("outline no-caps").classes("studio-target")
            known = {each["id"] for each in models}
            for root in (each for each in models if each["parent"] not in known):
                self._branch(root, models)

    def _branch(self, model: Mapping[str, Any], models: Sequence[Mapping[str, Any]]) -> None:
        """A version and what descends from it, indented."""
        with ui.element("div").classes("branch"):
            self._version(model)
            for child in (each for each in models if each["parent"] == model["id"]):
                self._branch(child, models)

    def _version(self, model: Mapping[str, Any]) -> None:
        with ui.element("article").classes("version") as article:
            article.props["data-model"] = model["id"]
            with ui.row().classes("version-row"):
                ui.label(model["id"][:12]).classes("version-id")
                ui.label(made_of(model))
                ui.label(f"held-out error {degrees(model['held_out_rmse_deg'])}").classes("version-error")
                if model["rmse_unseen_wearing_deg"] is not None:
                    ui.label(f"in a wearing not seen {degrees(model['rmse_unseen_wearing_deg'])}")
                if model["active"]:
                    ui.label("active").classes("state-word").props('data-word="ok"')
            if model["damage"]:
                ui.label(model["damage"]).classes("studio-problem")
            with ui.row().classes("version-acts"):
                if not model["active"]:
                    ui.button("Activate", on_click=lambda: self._activate(model["id"])).props(
                        "outline no-caps"
                    ).classes("studio-target")
                ui.link("Diagnose", f"/diagnose?model={model['id']}").classes("studio-link")
                ui.link("Error fall", f"/fall?model={model['id']}").classes("studio-link")
                ui.link("Export", f"../v1/models/{model['id']}/export").classes("studio-link").props(
                    "download"
                )
            ModelParts(self._studio.service, model["id"])

    async def _activate(self, model: str) -> None:
        await self._do(f"/models/{model}/activate", {}, "Live poses come from this model now.")

    async def _import(self, _name: str, content: bytes) -> None:
        try:
            found = await self._studio.service.post_file(
                "/models/import", content, "application/octet-stream", create_subject=True
            )
        except Refusal as refusal:
            self._notice.set_text(str(refusal))
            return
        model = found["model"]
        here = "was imported" if found["is_new"] else "was here already"
        await self._look()
        self._notice.set_text(f"Model {model['id'][:12]} of {model['subject']} {here}; it is not active.")

    async def _roll_back(self, subject: str, layout: str, hand: str | None) -> None:
        body = {"subject": subject, "layout": layout, "hand": hand}
        await self._do("/models/rollback", body, "The model that was active before is active again.")

    async def _do(self, path: str, body: Mapping[str, Any], done: str) -> None:
        try:
            await self._studio.service.post(path, body)
        except Refusal as refusal:
            ui.notify(str(refusal), type="warning")
            return
        ui.notify(done, position="bottom-right")
        await self._look()


def _worn(model: Mapping[str, Any]) -> tuple[str, str, str | None]:
    """Whose glove it reads: subject, layout and hand."""
    return model["subject"], model["layout"], model["hand"]
