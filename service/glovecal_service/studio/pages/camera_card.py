"""One camera on the page Cameras: picture, state, what each stage buys, and each joint with its deviation."""

from __future__ import annotations

from functools import partial
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from glovecal_service.plain import read
from glovecal_service.rest.glove.answer import CameraHealthView, TrackedRotation
from glovecal_service.rest.glove.answer import CameraView as Camera
from glovecal_service.studio.camera.camera_view import CameraView
from glovecal_service.studio.heading import act, heading
from glovecal_service.studio.service import refusals
from glovecal_service.studio.studio import Studio
from glovecal_service.studio.table import cell, fact_list, row_head, table

STAGES = {
    "nearest": "the most similar picture of the database",
    "blend": "ten of them averaged",
    "ik": "joints moved until the patches' centroids fit",
    "dense": "refined on the labels of all pixels",
}
STAGE_HEADS = ("Stage", "Pixels wrong", "Joints accepted", "Computing", "What it does")
JOINT_HEADS = ("Rotation", "Angle", "SD", "Accepted", "Share accepted")
FACTS = {
    "Poses": "Poses a second",
    "Latency": "From a picture's stamp to its pose on the network, last 300 poses: median and 95th "
    "percentile. A camera's exposure and transfer come before the stamp",
    "Accepted": "Rotations that are sure enough to be a reference, last 300 poses",
    "Distance": "Of the wrist from the camera, with its standard deviation",
    "Pictures": "Read in this run",
    "Skipped": "Left out because newer pictures were there",
    "No hand": "Pictures without a glove in view",
    "Unusable": "Pictures that cannot be tracked, such as of another size",
    "Dropped": "By the camera, as the times of its pictures tell",
    "Stamped twice": "Not later than the one before; not tracked",
    "Reconnects": "How often the camera was lost and found",
    "Kept": "Pictures or label images on disk",
}
LEAST_POSES = 10
"""Before a stage's figures are shown."""


class CameraCard:
    """Built into the place where it is made."""

    def __init__(self, studio: Studio, glove: str) -> None:
        self._studio, self._glove = studio, glove
        self._stages: dict[str, tuple[str, str, str]] = {}
        """Pixels wrong, joints accepted and computing time of each stage that was tried."""
        self._stage = ""
        self._tracked_before = 0
        self._joints: dict[str, list[TextElement]] = {}
        self._section = ui.element("section").classes("glove")
        self._section.props["aria-label"] = f"Camera {glove}"
        with self._section:
            self._build()

    def delete(self) -> None:
        self._section.delete()

    def show(self, camera: Camera) -> None:
        health = camera.health
        word = state_word(camera)
        self._word.set_text(word + (", simulated" if camera.is_simulated else ""))
        if self._word.props.get("data-word") != word:
            self._word.props["data-word"] = word
            self._word.update()
        self._sentence.set_text(as_sentence(camera.sentence))
        self._source.set_text(camera.source)
        self._stop.set_visibility(camera.state != "stopped")
        looked_at = health is not None and health.tracked + health.without_hand > 0
        self._view.follow(looked_at and camera.state in ("streaming", "lost"))
        self._show_findings(health)
        if health is None:
            return
        for name, text in facts(health).items():
            self._facts[name].set_text(text)
        self._show_stage(health)
        self._show_joints(health.rotations)

    def _build(self) -> None:
        with ui.row().classes("glove-head"):
            heading(2, self._glove)
            self._word = ui.label("").classes("state-word").props('role="status"')
            self._source = ui.label("")
            ui.space()
            self._stop = act("Stop", self._end)
        self._sentence = ui.label("").classes("glove-sentence")
        self._findings = ui.element("ul").classes("camera-findings")
        self._facts = fact_list(FACTS)
        with ui.element("div").classes("camera-parts"):
            with ui.element("div").classes("camera-left"):
                self._view = CameraView(self._glove)
                act("Balance colours", self._balance).tooltip(
                    "For light in which the colours are told badly; hold the hand in view"
                )
                heading(3, "Stage")
                with (
                    ui.element("div")
                    .classes("glove-sides camera-stages")
                    .props('role="group" aria-label="Stage"')
                ):
                    self._buttons = {name: self._stage_button(name) for name in STAGES}
                self._table_of_stages()
            with ui.element("div").classes("camera-right"):
                heading(3, "Joints")
                self._joints_place = ui.element("div")

    def _stage_button(self, name: str) -> TextElement:
        button = TextElement(tag="button", text=name).classes("glove-act").props('type="button"')
        button.props["aria-pressed"] = "false"
        button.on("click", partial(self._choose, name))
        return button

    def _table_of_stages(self) -> None:
        self._stage_cells: dict[str, list[TextElement]] = {}
        with table(f"Stages of camera {self._glove}", STAGE_HEADS, "camera-stage-table"):
            for name, what in STAGES.items():
                with ui.element("tr"):
                    row_head(name)
                    self._stage_cells[name] = [cell("–") for _ in range(3)]
                    cell(what)

    async def _choose(self, stage: str) -> None:
        with refusals():
            path = f"/cameras/{quote(self._glove)}/stage"
            self.show(read(Camera, await self._studio.service.put(path, {"stage": stage})))

    async def _balance(self) -> None:
        with refusals():
            self.show(await self._studio.service.ask(Camera, f"/cameras/{quote(self._glove)}/balance"))

    async def _end(self) -> None:
        with refusals():
            self.show(await self._studio.service.ask(Camera, f"/cameras/{quote(self._glove)}/stop"))

    def _show_findings(self, health: CameraHealthView | None) -> None:
        """What is wrong with the view now, and what was, with the number of pictures."""
        counted = {} if health is None else health.findings_counted
        now = {} if health is None else health.findings
        told = [
            f"{as_sentence(kind)[:-1]}: {'now; ' if kind in now else ''}in {count} of the pictures checked."
            for kind, count in counted.items()
        ] + ([health.advice] if health is not None and health.advice else [])
        if told == getattr(self, "_told", []):
            return
        self._told = told
        self._findings.clear()
        with self._findings:
            for sentence in told:
                TextElement(tag="li", text=sentence)

    def _show_stage(self, health: CameraHealthView) -> None:
        stage = health.stage
        if stage != self._stage:
            self._stage, self._tracked_before = stage, health.tracked
            for name, button in self._buttons.items():
                button.props["aria-pressed"] = "true" if name == stage else "false"
                button.update()
        enough = health.tracked - self._tracked_before >= LEAST_POSES
        if not enough or health.computing_ms is None or health.accepted_share is None:
            return
        figures = (
            f"{100 * (health.disagreeing or 0):.0f} %",
            f"{100 * health.accepted_share:.0f} %",
            f"{health.computing_ms.p50:.0f} ms",
        )
        for text, place in zip(figures, self._stage_cells[stage], strict=True):
            place.set_text(text)

    def _show_joints(self, rotations: list[TrackedRotation]) -> None:
        if rotations and not self._joints:
            with self._joints_place, table(f"Joints of camera {self._glove}", JOINT_HEADS, "camera-joints"):
                for each in rotations:
                    with ui.element("tr"):
                        row_head(each.name)
                        self._joints[each.name] = [cell("") for _ in JOINT_HEADS[1:]]
        for each in rotations:
            texts = (
                f"{each.degrees:.1f}°",
                f"± {each.sd_deg:.1f}°",
                "accepted" if each.accepted else "uncertain",
                f"{100 * each.accepted_share:.0f} %",
            )
            cells = self._joints[each.name]
            for place, text in zip(cells, texts, strict=True):
                place.set_text(text)
            mark = "yes" if each.accepted else "no"
            if cells[2].props.get("data-accepted") != mark:
                cells[2].props["data-accepted"] = mark
                cells[2].update()


def state_word(camera: Camera) -> str:
    """``opening``, ``tracking``, ``no hand``, ``check``, ``lost`` or ``stopped``."""
    health = camera.health
    if camera.state != "streaming" or health is None:
        return "opening" if camera.state == "streaming" else camera.state
    if health.problem or (health.findings and health.sees == "hand"):
        return "check"
    return {"hand": "tracking", "no hand": "no hand"}.get(health.sees, "opening")


def facts(health: CameraHealthView) -> dict[str, str]:
    latency, position, spread = health.latency_ms, health.position_mm, health.position_sd_mm
    share = health.accepted_share
    return {
        "Poses": f"{health.pose_rate_hz:.1f} /s",
        "Latency": "–" if latency is None else f"{latency.p50:.0f} ms, 95 %: {latency.p95:.0f} ms",
        "Accepted": "–" if share is None else f"{100 * share:.0f} %",
        "Distance": "–" if position is None or spread is None else f"{position[2]:.0f} ± {spread[2]:.0f} mm",
        "Pictures": f"{health.pictures}",
        "Skipped": f"{health.skipped}",
        "No hand": f"{health.without_hand}",
        "Unusable": f"{health.unusable}",
        "Dropped": f"{health.dropped}",
        "Stamped twice": f"{health.stamped_twice}",
        "Reconnects": f"{health.reconnects}",
        "Kept": "nothing" if health.kept == "nothing" else f"{health.kept_pictures} {health.kept}",
    }


def as_sentence(text: str) -> str:
    text = text.strip()
    return f"{text[0].upper()}{text[1:]}{'' if text[-1] in '.!?' else '.'}" if text else ""
