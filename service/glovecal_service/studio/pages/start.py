"""Start, with nothing yet: a simulated glove, a hidden effect to find, a glove to connect, an import."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from nicegui import ui

from glovecal_service.rest.first_run.answer import HiddenEffectView, SimulatedGloveView
from glovecal_service.rest.glove.answer import GloveDevice, SerialPort
from glovecal_service.rest.job.answer import Job
from glovecal_service.studio.heading import act, heading, main_act
from glovecal_service.studio.hidden_walk import walk_section
from glovecal_service.studio.job_watch import JobWatch
from glovecal_service.studio.live_test import LiveTest
from glovecal_service.studio.next_steps import command_to_copy
from glovecal_service.studio.repeating import again
from glovecal_service.studio.service import refusals, warn_long
from glovecal_service.studio.shell import page, shell
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import table, text_row

EVERY_S = 1.0
MOST_WALKS = 5
GLOVE, WEARER = "right", "me"


def add(studio: Studio) -> None:
    """``/studio/start``."""

    @page("/start")
    async def start() -> None:
        async with shell(studio, "start", "Start"):
            for sheet in ("findings", "compare"):
                ui.add_head_html(f'<link rel="stylesheet" href="/studio/static/{sheet}.css">')
            await StartPage(studio).build()


class StartPage:
    """One open page."""

    def __init__(self, studio: Studio) -> None:
        self._studio = studio
        self._ports: Sequence[SerialPort] = ()

    async def build(self) -> None:
        with ui.element("div").classes("findings"):
            with _section("simulated", "Try a simulated glove"):
                self._build_simulated()
            with _section("hidden", "Find a hidden effect"):
                await self._build_hidden()
            with _section("connect", "Connect a glove"):
                await self._build_connect()
            with _section("test", "Which sensor answers which finger?"):
                LiveTest(self._studio).build()
            with _section("import", "Import a recording"):
                ui.label(
                    "Drop a table of any program on any page: what it is is shown before anything is kept."
                )
                ui.link("Takes", "/takes").classes("studio-link")
            with _section("access", "Let others in"):
                ui.label(
                    "Others who reach this service need a key or a password; who changed what is written "
                    "down."
                )
                ui.link("Keys, people and changes", "/access").classes("studio-link")
        await self._look()
        again(EVERY_S, self._look)

    # A simulated glove

    def _build_simulated(self) -> None:
        ui.label(
            "A simulated hand moves in a simulated CyberGlove and streams into this service, marked as "
            "simulated, for half an hour at most. The model of its hand is trained once, in some seconds."
        )
        with ui.element("div").classes("page-acts"):
            self._try = main_act("Try a simulated glove", partial(self._stream, True))
            self._stop = act("Stop it", partial(self._stream, False))
            ui.link("See its hand move", "/live").classes("studio-link")
        self._state = ui.label("").props('role="status"')

    async def _stream(self, is_on: bool) -> None:
        with refusals(warn_long):
            await self._studio.service.put("/simulated-glove", {"is_on": is_on})
        await self._look()

    async def _look(self) -> None:
        with refusals(self._state.set_text):
            glove = await self._studio.service.read(SimulatedGloveView, "/simulated-glove")
            self._try.set_visibility(not glove.is_on)
            self._stop.set_visibility(glove.is_on)
            self._state.set_text(_sentence(glove))

    # A hidden effect

    async def _build_hidden(self) -> None:
        ui.label(
            "One of ten physical effects, drawn by chance, is hidden in another simulated glove. Its takes "
            "and a model that does not know of it are made. Compare shows where that fails, Diagnose names "
            "what is missing; once you have added it, you are told whether it was right."
        )
        main_act("Hide an effect", self._hide)
        self._watch = JobWatch(self._studio, self._made)
        self._walks = ui.element("div").classes("findings")
        await self._show_walks()

    async def _hide(self) -> None:
        with refusals(warn_long):
            walk = await self._studio.service.ask(HiddenEffectView, "/hidden-effects")
            await self._show_walks()
            if walk.job is not None:
                self._watch.follow(walk.job)

    async def _made(self, job: Job) -> None:
        await self._show_walks()

    async def _show_walks(self) -> None:
        walks = await self._studio.service.read(list[HiddenEffectView], "/hidden-effects")
        self._walks.clear()
        with self._walks:
            for walk in walks[:MOST_WALKS]:
                walk_section(self._studio.service, walk)
        if walks and walks[0].job is not None:
            self._watch.follow(walks[0].job)

    # A glove

    async def _build_connect(self) -> None:
        ui.label(
            "Plug the glove in, and see which serial ports of the service's computer answer. Capture is a "
            "program of its own, on the computer that the glove is plugged into: copy its command to a "
            "terminal there. Frames that arrive are shown on Live, and tested below."
        )
        act("Look for ports", self._look_for_ports)
        self._found = ui.element("div").props('role="status"')
        devices = await self._studio.service.read(list[GloveDevice], "/glove-devices")
        self._devices = {device.name: device for device in devices}
        names = {name: f"{name}: {device.sentence}" for name, device in self._devices.items()}
        self._device = ui.select(
            names, value=next(iter(names)), label="Your glove", on_change=self._show_command
        )
        self._device.classes("choice")
        with ui.element("div").classes("capture-fields"):
            self._glove = ui.input("Name of the glove", value=GLOVE, on_change=self._show_command)
            self._wearer = ui.input("Who wears it", value=WEARER, on_change=self._show_command)
            for field in (self._glove, self._wearer):
                field.classes("choice")
        self._command = ui.element("div")
        self._show_command()

    async def _look_for_ports(self) -> None:
        with refusals(warn_long):
            self._ports = await self._studio.service.ask(list[SerialPort], "/serial-ports")
            self._found.clear()
            with self._found:
                if not self._ports:
                    ui.label("No serial port was found on the service's computer. Is the cable plugged in?")
                    return
                with table("Serial ports", ("Port", "What answered")):
                    for port in self._ports:
                        text_row(f"{port.path} {port.description}".strip(), port.sentence)
            answering = next((port.device for port in self._ports if port.device is not None), None)
            if answering is not None:
                self._device.set_value(answering.partition(":")[0])
            self._show_command()

    def _show_command(self) -> None:
        """With what is known: names, and the port where one alone can be meant."""
        device = self._devices[str(self._device.value)]
        own = [port.path for port in self._ports if port.device == f"{device.name}:{port.path}"]
        usable = own or [port.path for port in self._ports if port.device is None]
        words = {
            "GLOVE": str(self._glove.value).strip() or GLOVE,
            "SUBJECT": str(self._wearer.value).strip() or WEARER,
            "PORT": usable[0] if len(usable) == 1 else "PORT",
        }
        command = device.command
        for word, value in words.items():
            command = command.replace(word, value)
        self._command.clear()
        with self._command:
            command_to_copy(command)


def _section(anchor: str, title: str) -> ui.element:
    section = ui.element("section").classes("card capture-form").props(f'id="{anchor}"')
    section.props["aria-label"] = title
    with section:
        heading(2, title)
    return section


def _sentence(glove: SimulatedGloveView) -> str:
    if not glove.is_on:
        return "" if not glove.sentence else f"It has ended: {glove.sentence}."
    left = f"for {glove.left_s / 60:.0f} more minutes" if glove.left_s > 90 else "for a minute"
    if glove.model is None:
        return (
            f"Streams, simulated, {left}. The model of its hand is being trained; its readings move already."
        )
    return f"Streams, simulated, {left}. Its hand moves on Live."
