"""An effect of the user's own as a line of text, with what it would save while it is being written."""

from __future__ import annotations

from nicegui import ui

from glovecal_models.diagnosis.trial.answer import Candidate, TriedEffect
from glovecal_models.improvement.answer import EffectAdded
from glovecal_service.plain import read
from glovecal_service.rest.job.answer import Job, JobFacts
from glovecal_service.rest.model.answer import ModelInFull
from glovecal_service.rest.take.answer import Take
from glovecal_service.studio.findings.candidate_table import bar_key, candidate_table
from glovecal_service.studio.findings.effect_view import EffectView
from glovecal_service.studio.heading import main_act
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.repeating import soon
from glovecal_service.studio.service import Refusal, refusals
from glovecal_service.studio.studio import Studio

WAIT_MS = 700
"""After the last key, before it is tried."""
FIRST = "name = mine; unit = deg; columns = lowpass(own_deg, 0.2) - own_deg"
MAY_BE_WRITTEN = (
    "own_deg, own: the joint's angle in degrees, or in its standard deviations; t: seconds in the take; "
    "numbers, + - * / ^ ( ), exp log sqrt abs tanh sin cos, min(a, b), max(a, b), clip(x, low, high), "
    "lowpass(x, seconds), previous(x); parameter tau s 0.1 5 = 1 declares a number to be searched for."
)


class OwnExpression:
    """One section of a page. Nothing is stored before the effect is added."""

    def __init__(self, studio: Studio, model: str) -> None:
        self._studio = studio
        self._service = studio.service
        self._model = model
        self._tried = ""
        self._busy = False

    async def build(self) -> None:
        self._text = (
            ui.input("Expression", value=FIRST)
            .props(f"debounce={WAIT_MS} autocomplete=off spellcheck=false maxlength=2000")
            .classes("expression")
        )
        self._text.on_value_change(self._try)
        self._names = ui.label("").classes("fall-how")
        ui.label(MAY_BE_WRITTEN).classes("fall-how")
        self._problem = ui.label("").classes("expression-problem").props('role="alert"')
        self._verdict = ui.label("").classes("effect-sentence").props('role="status"')
        self._result = ui.element("div")
        self._watch = JobWatch(self._studio, self._finished)
        soon(self._begin)

    async def _begin(self) -> None:
        await self._show_names()
        await self._try()

    async def _show_names(self) -> None:
        """Sensors and context columns of the model's takes."""
        model = await self._service.read(ModelInFull, f"/models/{self._model}")
        takes = await self._service.every(Take, "/takes", subject=model.subject, layout=model.layout)
        context = {f"c.{name}" for take in takes for name in take.context}
        sensors = dict.fromkeys(sensor for each in model.rotations for sensor in each.sensors)
        self._names.set_text(f"Recorded here: {', '.join([*sensors, *sorted(context)])}.")

    async def _try(self) -> None:
        """The newest text, one at a time."""
        if self._busy:
            return
        self._busy = True
        try:
            while self._tried != str(self._text.value):
                self._tried = text = str(self._text.value)
                await self._show(text)
        finally:
            self._busy = False

    async def _show(self, text: str) -> None:
        if not text.strip():
            self._say("Write an expression.", "")
            return
        self._say("", "Trying it on left-out takes …")
        body = {"effect": {"declaration": text}}
        try:
            found = await self._service.ask(TriedEffect, f"/models/{self._model}/try-effect", body)
        except Refusal as refusal:
            self._say(str(refusal), "")
            return
        judged = found.judged
        if judged is None:
            self._say(f"These takes cannot show it: {found.not_identifiable}.", "")
            return
        self._say("", _verdict(judged))
        with self._result:
            candidate_table([judged])
            bar_key()
            view = EffectView(
                self._service, {"declaration": text}, found.takes, before=self._model, after=None
            )
            where = list(judged.where)
            if where:
                main_act(f"Add {found.effect}", lambda: self._add(text, where))
        await view.show(judged.clearest_rotation)

    def _say(self, problem: str, verdict: str) -> None:
        self._problem.set_text(problem)
        self._verdict.set_text(verdict)
        self._result.clear()

    async def _add(self, text: str, where: list[str]) -> None:
        body = {"effect": {"declaration": text}, "rotations": where, "activate": False}
        with refusals(self._problem.set_text):
            job = await self._service.ask(JobFacts, f"/models/{self._model}/effects", body)
            self._watch.follow(job.id)

    async def _finished(self, job: Job) -> None:
        if job.state == "done":
            found = read(EffectAdded, job.result)
            self._verdict.set_text(found.sentence)
            if found.model:
                with self._result:
                    ui.link("See the error fall", f"/fall?model={found.model}").classes("studio-link")


def _verdict(judged: Candidate) -> str:
    before, after, control = judged.rmse_before_deg, judged.rmse_after_deg, judged.rmse_control_deg
    beside = "" if control is None else f" (control: {control:.2f})"
    change = f"On left-out takes the error goes from {before:.2f} to {after:.2f} degrees{beside}"
    if judged.passes:
        return f"{change}: significant on {', '.join(judged.where)}."
    return f"{change}: not significant on any rotation."
