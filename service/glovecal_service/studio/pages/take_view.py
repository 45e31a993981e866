"""What was recorded in one take, wherever it is looked at: quality, curves, its hand replayed, and stretches
of it that are left out."""

from __future__ import annotations

from functools import partial
from urllib.parse import quote

from nicegui import ui

from glovecal_models.presentation.document import counted
from glovecal_models.takes.answer import TakeSeries
from glovecal_service.plain import read
from glovecal_service.rest.model.answer import Model
from glovecal_service.rest.take.answer import CheckView, Take
from glovecal_service.studio.charts.chart import TakeChart
from glovecal_service.studio.hand.hand_view import HandView, TakeReplay, side_buttons
from glovecal_service.studio.hand.raw_hand import RawHand
from glovecal_service.studio.heading import act, heading, main_act
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio

POINTS = 4000
VIEWS = {"time": "Over time", "spectra": "Spectra of the readings"}
KEYS = (
    "Readings are in counts, the reference in degrees, time in seconds since the first frame. A click goes "
    "there, a mouse drawn over the curves marks a stretch. Drag below the curves to zoom, or turn the wheel "
    "with Ctrl. Grey: recorded before the take was asked for; stronger: left out. Amber: frames are missing. "
    "Over an angle: the reference jumps while the sensors do not."
)
STYLES = ("findings", "compare")


def add_take_styles() -> None:
    """To a page, while it is made."""
    for name in STYLES:
        ui.add_head_html(f'<link rel="stylesheet" href="/studio/static/{name}.css">')


class TakeView:
    """Of one take. Build it with ``await view.build()``."""

    def __init__(self, studio: Studio, own: Take, model: Model | None = None) -> None:
        """``model``: whose poses the hand takes where nothing was measured, if it is one for this take; else
        the active one's."""
        self._studio = studio
        self._own = own
        self._model = model
        self._over = ""
        self.posed_by: str | None = None
        """The id of the model that gives the hand its poses, known once it is built."""

    async def build(self, over: str = "") -> None:
        """``over``: the id of another take that is drawn over it."""
        own, self._over = self._own, over
        model, service = await self._posing(), self._studio.service
        self.posed_by = model
        hand = f"/subjects/{quote(own.subject)}/skeleton"
        skeleton = await service.get(hand, hand=own.known_hand)
        raw = await RawHand.of(service, own.layout)
        note = ui.input("Note", value=own.note).classes("take-note").props("dense maxlength=2000")
        note.on("blur", partial(self._keep_note, note), args=[])
        note.on("keydown.enter", partial(self._keep_note, note), args=[])
        self._told = ui.element("div").props('aria-live="polite"')
        with ui.element("div").classes("take-parts"):
            with ui.element("div").classes("take-hand-part"):
                hand_view = HandView(
                    skeleton, label=f"Hand of take {own.name}", empty="No angle is known here"
                )
                hand_view.classes("take-hand")
                raw.show(hand_view, not own.rotations and model is None)
                side_buttons(hand_view)
                place = ui.element("div")
                self._leave_out()
            with ui.element("div").classes("take-chart-part"):
                self._view = ui.toggle(VIEWS, value="time", on_change=self._draw).props(
                    "no-caps unelevated toggle-color=indigo-8"
                )
                self._chart = TakeChart(label=f"Readings and reference of take {own.name}")
                ui.label(KEYS)
        with place:
            self._replay = TakeReplay(hand_view, self._chart, own, model)
        self._replay.on_edge(lambda edge, at_s: self._ends[edge].set_value(round(at_s, 2)))
        self._chart.on_moment(self._replay.seek)
        self._chart.on_stretch(self._drawn)
        await self._look()

    async def _keep_note(self, note: ui.input) -> None:
        text = str(note.value or "")
        if text != self._own.note:
            with refusals():
                answer = await self._studio.service.put(f"/takes/{self._own.id}/note", {"note": text})
                self._own = read(Take, answer)

    async def show_over(self, over: str) -> None:
        """Another take over it; "" for none."""
        self._over = over
        await self._draw()

    async def _posing(self) -> str | None:
        own = self._own
        if self._fits(self._model):
            return self._model and self._model.id
        query = {"subject": own.subject, "layout": own.layout, "hand": own.known_hand}
        models = await self._studio.service.every(Model, "/models", **query)
        return next((each.id for each in models if each.active), None)

    def _fits(self, model: Model | None) -> bool:
        own = self._own
        return model is not None and (
            (model.subject, model.layout) == (own.subject, own.layout)
            and (None in (model.hand, own.known_hand) or model.hand == own.known_hand)
        )

    def _leave_out(self) -> None:
        with ui.element("section").classes("take-left-out").props('aria-label="Leave out"'):
            heading(3, "Leave a stretch out")
            with ui.element("div").classes("take-ends"):
                self._ends = {
                    edge: ui.number(name, min=0, max=self._own.duration_s, step=0.1, on_change=self._mark)
                    for edge, name in (("from", "From, s"), ("to", "To, s"))
                }
                main_act("Leave out", self._mark_left_out)
            ui.label("No training, comparison or diagnosis sees it. The recording itself stays as it is.")
            self._marks = ui.element("div").props('aria-live="polite"')

    def _drawn(self, from_s: float, to_s: float) -> None:
        self._ends["from"].set_value(round(from_s, 2))
        self._ends["to"].set_value(round(to_s, 2))

    def _mark(self) -> None:
        self._chart.choose(self._ends["from"].value, self._ends["to"].value)

    async def _mark_left_out(self) -> None:
        from_s, to_s = (end.value for end in self._ends.values())
        if from_s is None or to_s is None:
            ui.notify("Say from when to when, in seconds, or mark it over the curves.", type="warning")
            return
        with refusals():
            body = {"from_s": float(from_s), "to_s": float(to_s)}
            self._own = await self._studio.service.ask(Take, f"/takes/{self._own.id}/left-out", body)
            for end in self._ends.values():
                end.set_value(None)
            await self._look()

    async def _use_again(self, from_s: float, to_s: float) -> None:
        body = {"stretch": {"from_s": from_s, "to_s": to_s}}
        with refusals():
            self._own = await self._studio.service.ask(Take, f"/takes/{self._own.id}/left-out/undo", body)
            await self._look()

    async def _look(self) -> None:
        self._marks.clear()
        with self._marks:
            for low, high in self._own.left_out:
                with ui.element("div").classes("take-mark"):
                    ui.label(f"Left out: {low:.2f} to {high:.2f} s")
                    undo = act("Undo", partial(self._use_again, low, high))
                    undo.props["aria-label"] = f"Undo: use {low:.2f} to {high:.2f} s again"
        await self._check()
        await self._draw()

    async def _check(self) -> None:
        own = self._own
        rate_hz, gaps, sentences = None, 0, []
        with refusals(sentences.append):
            check = await self._studio.service.read(CheckView, f"/takes/{own.id}/check")
            rate_hz, gaps, sentences = check.rate_hz, check.gaps, check.sentences
        rate = "" if rate_hz is None else f" at {rate_hz:.1f} Hz"
        measured = counted(len(own.rotations), "rotation") if own.rotations else "nothing"
        self._told.clear()
        with self._told:
            ui.label(
                f"{own.frames} frames{rate}, {counted(gaps, 'gap')}; {measured} measured"
                + (", simulated." if own.simulated else ".")
            ).classes("finding-sentence")
            for sentence in sentences:
                ui.label(sentence).classes("take-warning")
            if not sentences:
                ui.label("Nothing looks wrong.")

    async def _draw(self) -> None:
        service = self._studio.service
        ids = [self._own.id, *filter(None, [self._over])]
        with refusals():
            shown = [await service.read(TakeSeries, f"/takes/{each}/series", points=POINTS) for each in ids]
            self._chart.show(shown, spectra=self._view.value == "spectra")
