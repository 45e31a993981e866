"""Takes: dropped files are shown before anything is kept; then imported, and a model is trained on them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import PurePosixPath

from nicegui import ui

from glovecal_models.takes.answer import TablePreview
from glovecal_service.rest.take.answer import CardTable, Take, UploadKind
from glovecal_service.studio.drop import Uploaded, files_of, imported_model
from glovecal_service.studio.pages.dropped_calibration import DroppedCalibration
from glovecal_service.studio.pages.dropped_reference import DroppedReference
from glovecal_service.studio.pages.dropped_tables import FilesOfOneShape, uploaded
from glovecal_service.studio.pages.takes_table import TakesTable
from glovecal_service.studio.pages.train_panel import TrainPanel
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.shell import Around, page, shell
from glovecal_service.studio.studio import Studio


def add(studio: Studio) -> None:
    """``/studio/takes``."""

    @page("/takes")
    async def takes(files: str = "") -> None:
        async with shell(studio, "takes", "Takes") as around:
            ui.add_head_html('<link rel="stylesheet" href="/studio/static/findings.css">')
            await TakesPage(studio, around).build(files_of(files))


class TakesPage:
    """One open page."""

    def __init__(self, studio: Studio, around: Around) -> None:
        self._studio = studio
        self._around = around

    async def build(self, files: Sequence[Uploaded]) -> None:
        with ui.element("section").classes("card drop-card").props('aria-label="Add takes"'):
            ui.label(
                "Drop files anywhere on this page: recordings of a glove, as tables of any program (CSV, "
                "text, Parquet) or from its memory card; angles that another system measured (a table, "
                "TRC, BVH); calibrations of other programs. What they are is shown before anything is kept. "
                "Models and a phone's videos are imported at once."
            )
            self._around.drop.button("Choose files")
        self._found = ui.element("div").classes("findings").props('aria-live="polite"')
        self._train = TrainPanel(self._studio)
        if files:  # what is to be trained are these, once they are imported
            self._around.drop.waiting = files
            await self._look(files)
        else:
            await self._train.build(await self._around.chosen.takes(self._studio.service))
            await TakesTable(self._studio.service).build()

    async def _look(self, files: Sequence[Uploaded]) -> None:
        shapes: dict[str, list[tuple[Uploaded, TablePreview]]] = {}
        references: list[DroppedReference] = []
        readings: list[FilesOfOneShape] = []
        about = self._around.chosen
        with self._found:
            for file in files:
                try:
                    match (await self._studio.service.read(UploadKind, f"/uploads/{file[0]}/kind")).kind:
                        case "calibration":
                            await DroppedCalibration(self._studio, file, self._imported_model).build(about)
                        case "model":
                            sentence = await imported_model(self._studio.service, file)
                            ui.label(sentence).classes("finding-sentence").props('role="status"')
                        case "motion":
                            references.append(DroppedReference(self._studio, file, self._attached))
                        case "card":
                            readings.append(await self._card(file))
                        case _:
                            seen = await self._studio.service.ask(
                                TablePreview, "/takes/preview", uploaded(file)
                            )
                            if seen.is_reference:
                                references.append(DroppedReference(self._studio, file, self._attached, seen))
                            else:
                                shapes.setdefault(seen.mapping.shape, []).append((file, seen))
                except Refusal as refusal:
                    _problem(file, str(refusal))
            readings += [FilesOfOneShape(self._studio, alike, self._imported) for alike in shapes.values()]
            for each in readings:
                await each.build(about)
            unmeasured = [each for each in readings if each.is_unmeasured]
            shown: list[DroppedReference] = []

            async def joined() -> None:
                for each in unmeasured:
                    await each.join([reference.body for reference in shown])

            for each in references:
                with refusals(partial(_problem, each.file)):
                    await each.build(about, joined=joined if unmeasured else None)
                    shown.append(each)
        if shown and unmeasured:
            await joined()

    async def _card(self, file: Uploaded) -> FilesOfOneShape:
        card = await self._studio.service.ask(CardTable, f"/uploads/{file[0]}/card")
        named = card.sha256, f"{PurePosixPath(file[1]).stem}.csv"
        seen = await self._studio.service.ask(TablePreview, "/takes/preview", uploaded(named))
        return FilesOfOneShape(
            self._studio, [(named, seen)], self._imported, note=card.sentence, layout=card.layout
        )

    async def _imported(
        self, subject: str, layout: str, takes: Sequence[str], files: Sequence[Uploaded]
    ) -> None:
        await self._no_longer_waiting(files, subject)
        await self._train.take_on(subject, layout, takes)

    async def _attached(self, take: Take, file: Uploaded) -> None:
        await self._no_longer_waiting([file], take.subject)
        await self._train.take_on(take.subject, take.layout, [take.id])

    async def _imported_model(self, subject: str, file: Uploaded) -> None:
        await self._no_longer_waiting([file], subject)

    async def _no_longer_waiting(self, files: Sequence[Uploaded], subject: str) -> None:
        drop = self._around.drop
        drop.waiting = [file for file in drop.waiting if file not in files]
        await self._around.is_now_about(subject)


def _problem(file: Uploaded, sentence: str) -> None:
    ui.label(_of_file(file, sentence)).classes("studio-problem").props('role="alert"')


def _of_file(file: Uploaded, sentence: str) -> str:
    return sentence if sentence.startswith(file[1]) else f"{file[1]}: {sentence}"
