"""Models and subjects: versions as a tree of descent, what they are made of; takes, hands and gloves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from nicegui import ui

from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.rest.model.answer import ImportedModel, Model
from glovecal_service.studio.amounts import degrees, made_of
from glovecal_service.studio.file_button import FileButton
from glovecal_service.studio.hand.dimensions_form import DimensionsForm
from glovecal_service.studio.heading import act, heading, quiet_act
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.next_steps import next_steps
from glovecal_service.studio.paged_list import PagedList
from glovecal_service.studio.pages.gloves_table import gloves_table
from glovecal_service.studio.pages.model_parts import ModelParts
from glovecal_service.studio.pages.personal_data import PersonalData
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import refusals
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio

EVERY_S = 2.0
AT_ONCE = 30


def add(studio: Studio) -> None:
    """``/studio/models``."""

    @page("/models")
    async def models() -> None:
        async with shell(studio, "models", "Models and subjects") as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await ModelsPage(studio).build()
            with ui.element("div").classes("trees"):
                await DimensionsForm(studio.service).build()
                await PersonalData(studio.service).build(around.chosen.person)
                await gloves_table(studio.service)


class ModelsPage:
    """One open page; models made elsewhere appear, deleted ones go."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._list = PagedList(
            studio.service, Model, "/models", self._show, what="models", at_once=AT_ONCE,
            key=lambda model: (model.id, model.active, model.damage),
        )  # fmt: skip

    async def build(self) -> None:
        self._notice = ui.label("").classes("studio-notice").props('role="status"')
        self._news = ui.row().classes("choices").props('aria-live="polite"')
        self._watch = JobWatch(self._studio, self._reported)
        await self._list.build()
        FileButton(
            "Import a model", suffixes=".safetensors", largest=self._studio.largest_file,
            take=self._import, tell=self._notice.set_text,
        ).button.props("outline no-caps").classes("studio-target page-acts")  # fmt: skip
        again(EVERY_S, self._list.look)

    async def _show(self, models: list[Model]) -> None:
        self._notice.set_text("" if models else "No model here.")
        with ui.element("div").classes("trees"):
            if not models:
                await next_steps(self._studio.service)
            for worn in dict.fromkeys(_worn(each) for each in models):
                self._tree(*worn, [each for each in reversed(models) if _worn(each) == worn])

    def _tree(self, subject: str, layout: str, hand: str | None, models: Sequence[Model]) -> None:
        of_hand = f", {hand} hand" if hand else ""
        with ui.element("section").classes("tree").props() as section:
            section.props["aria-label"] = f"Models of {subject}, {layout}{of_hand}"
            with ui.row().classes("tree-head"):
                heading(2, f"{subject}, {layout}{of_hand}")
                act("Return to the model before", lambda: self._roll_back(subject, layout, hand))
            known = {each.id for each in models}
            for root in (each for each in models if each.parent not in known):
                self._branch(root, models)

    def _branch(self, model: Model, models: Sequence[Model]) -> None:
        """A version and what descends from it, indented."""
        with ui.element("div").classes("branch"):
            self._version(model)
            for child in (each for each in models if each.parent == model.id):
                self._branch(child, models)

    def _version(self, model: Model) -> None:
        with ui.element("article").classes("version") as article:
            article.props["data-model"] = model.id
            with ui.row().classes("version-row"):
                ui.label(model.short).classes("version-id")
                name = ui.input("Name", value=model.name).props("dense")
                note = ui.input("Note", value=model.note).props("dense")
                for field in (name, note):
                    field.on("blur", partial(self._describe, model, name, note), args=[])
                ui.label(made_of(model))
                ui.label(f"held-out error {degrees(model.held_out_rmse_deg)}").classes("version-error")
                if model.rmse_unseen_wearing_deg is not None:
                    ui.label(f"in a wearing not seen {degrees(model.rmse_unseen_wearing_deg)}")
                if model.active:
                    ui.label("active").classes("state-word").props('data-word="ok"')
            if model.damage:
                ui.label(model.damage).classes("studio-problem")
            with ui.row().classes("version-acts"):
                if not model.active:
                    act("Activate", lambda: self._activate(model.id))
                    quiet_act("Remove", lambda: self._remove(model))
                act("Report", partial(self._report, model))
                ui.link("Diagnose", f"/diagnose?model={model.id}").classes("studio-link")
                ui.link("Error fall", f"/fall?model={model.id}").classes("studio-link")
                ui.link("Export", f"../v1/models/{model.id}/export").classes("studio-link").props("download")
            ModelParts(self._studio.service, model.id)

    async def _activate(self, model: str) -> None:
        await self._do(f"/models/{model}/activate", {}, "Live poses come from this model now.")

    async def _describe(self, model: Model, name: ui.input, note: ui.input) -> None:
        with refusals():
            body = {"name": (name.value or "").strip(), "note": (note.value or "").strip()}
            await self._studio.service.put(f"/models/{model.id}/name", body)

    async def _report(self, model: Model) -> None:
        with refusals():
            job = await self._studio.service.ask(JobFacts, f"/models/{model.id}/calibration-report")
            self._watch.follow(job.id)

    async def _reported(self, job: Job) -> None:
        if job.state != "done":
            return
        report = f"../v1/jobs/{job.id}/report"
        self._news.clear()
        with self._news:
            ui.label(f"The report on model {job.payload['model'][:12]} is ready.")
            ui.link("Open the report", report, new_tab=True).classes("studio-link")
            ui.link("As PDF", f"{report}?format=pdf", new_tab=True).classes("studio-link")

    async def _remove(self, model: Model) -> None:
        with refusals():
            await self._studio.service.delete(f"/models/{model.id}")
            await self._list.look()
            with self._news:
                self._news.clear()
                ui.label(f"Model {model.short} was removed.")
                quiet_act("Undo", lambda: self._restore(model))

    async def _restore(self, model: Model) -> None:
        self._news.clear()
        await self._do(f"/models/{model.id}/restore", {}, f"Model {model.short} is back.")

    async def _import(self, _name: str, content: bytes) -> None:
        with refusals(self._notice.set_text):
            document = await self._studio.service.post_file(
                "/models/import", content, "application/octet-stream", create_subject=True
            )
            found = read(ImportedModel, document)
            here = "was imported" if found.is_new else "was here already"
            await self._list.look()
            self._notice.set_text(
                f"Model {found.model.short} of {found.model.subject} {here}; it is not active."
            )

    async def _roll_back(self, subject: str, layout: str, hand: str | None) -> None:
        body = {"subject": subject, "layout": layout, "hand": hand}
        await self._do("/models/rollback", body, "The model that was active before is active again.")

    async def _do(self, path: str, body: Mapping[str, Any], done: str) -> None:
        with refusals():
            await self._studio.service.post(path, body)
            ui.notify(done, position="bottom-right")
            await self._list.look()


def _worn(model: Model) -> tuple[str, str, str | None]:
    """Whose glove it reads: subject, layout and hand."""
    return model.subject, model.layout, model.hand
