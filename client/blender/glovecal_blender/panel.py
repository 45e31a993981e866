"""The tab *Glovecal* beside the 3D view: connect, choose an armature, see what comes, record."""

from __future__ import annotations

from typing import Any

import bpy  # pyright: ignore[reportMissingImports]
import zenoh

from glovecal_client import open_client
from glovecal_client.errors import BadName
from glovecal_models.errors import BadInput
from glovecal_models.hand.retargeting.retarget import Retargeting
from glovecal_models.hand.retargeting.touches import Touches

from .armatures import baked, make_hand, require_armature, rig_of, turn, write_action
from .live_hand import LiveHand

TICK_S = 1 / 60
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
OFFLINE = (
    "Blender's online access is off, and the service is on another computer: switch on Edit > Preferences > "
    "System > Allow Online Access"
)


class Live:
    """The connection and the hands that follow it. Only Blender's main thread comes here."""

    def __init__(self) -> None:
        self.hands: list[LiveHand] = []
        self.sentence = ""
        self._session: zenoh.Session | None = None
        self._entered: Any = None
        self._mapped: dict[str, tuple[Any, Any]] = {}

    @property
    def is_connected(self) -> bool:
        return self._session is not None

    def connect(self, endpoint: str, site: str, gloves: list[str]) -> None:
        """Raises BadInput and BadName; the router need not be there yet."""
        self.disconnect()
        if not gloves:
            raise BadInput("no glove is named; name one, or two separated by a comma: right, left")
        if not bpy.app.online_access and not any(name in endpoint for name in LOOPBACK):
            raise BadInput(OFFLINE)
        self._entered = open_client([endpoint])
        self._session = session = self._entered.__enter__()
        try:
            for glove in gloves:
                self.hands.append(LiveHand(session, site, glove))
        except BadName:
            self.disconnect()
            raise

    def disconnect(self) -> None:
        for hand in self.hands:
            hand.close()
        self.hands, self._mapped = [], {}
        if self._entered is not None:
            self._entered.__exit__(None, None, None)
        self._entered = self._session = None

    def tick(self, armature: Any) -> None:
        """Turn the armature's bones as the newest poses say. What they mean is worked out elsewhere."""
        for hand in self.hands:
            wanted = (hand.skeleton, None if armature is None else armature.data)
            if self._mapped.get(hand.glove) != wanted:
                self._mapped[hand.glove] = wanted
                self._map(hand, armature)
            latest = hand.latest
            if armature is not None and latest is not None and len(latest.quaternions) == len(hand.names):
                turn(armature, hand.names, latest)

    def _map(self, hand: LiveHand, armature: Any) -> None:
        if hand.skeleton is None or armature is None:
            hand.follow(None)
            return
        try:
            hand.follow(Touches(Retargeting.of(hand.skeleton, rig_of(armature))))
            self.sentence = ""
        except BadInput as error:
            hand.follow(None)
            self.sentence = str(error)

    def record(self) -> None:
        for hand in self.hands:
            hand.record()

    @property
    def is_recording(self) -> bool:
        return any(hand.recording is not None for hand in self.hands)

    def write(self, armature: Any, *, whole_frames: bool) -> Any:
        """What was recorded as a new action of the armature. Raises BadInput where nothing was."""
        scene = bpy.context.scene
        parts = [(hand.names, hand.recorded()) for hand in self.hands]
        parts = [(names, recorded) for names, recorded in parts if recorded]
        if not parts:
            raise BadInput("no pose came while recording; look at the state of the hands")
        action = bpy.data.actions.new("Glovecal take")
        armature.animation_data_create()
        armature.animation_data.action = action
        first = min(recorded[0].time_ns for _, recorded in parts)
        rate = scene.render.fps / scene.render.fps_base
        for names, recorded in parts:
            begin = scene.frame_start + (recorded[0].time_ns - first) * 1e-9 * rate
            turns = baked(recorded, rate) if whole_frames else recorded
            write_action(armature, names, turns, round(begin) if whole_frames else begin, action)
        return action


LIVE = Live()


def tick() -> float | None:
    """Blender's timer."""
    if not LIVE.is_connected:
        return None
    settings = bpy.context.scene.glovecal
    LIVE.tick(settings.armature)
    for area in bpy.context.screen.areas if bpy.context.screen else ():
        if area.type == "VIEW_3D":
            area.tag_redraw()
    return TICK_S


class GlovecalSettings(bpy.types.PropertyGroup):
    endpoint: bpy.props.StringProperty(name="Service", default="tcp/127.0.0.1:7447")  # pyright: ignore
    site: bpy.props.StringProperty(name="Site", default="lab")  # pyright: ignore
    gloves: bpy.props.StringProperty(  # pyright: ignore
        name="Gloves", default="right, left", description="Names of gloves, separated by commas"
    )
    armature: bpy.props.PointerProperty(  # pyright: ignore
        name="Armature", type=bpy.types.Object, poll=lambda _, each: each.type == "ARMATURE",
        description="Whose hand bones follow the gloves; they are found by their names",
    )  # fmt: skip
    whole_frames: bpy.props.BoolProperty(  # pyright: ignore
        name="Bake to whole frames", default=False,
        description="Key frames on the scene's frames; else at the poses' own times",
    )  # fmt: skip


class GlovecalOperator(bpy.types.Operator):
    """Tells a refusal as Blender tells it."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  # as Blender wants it

    def execute(self, context: Any) -> set[str]:
        try:
            self.do(context, context.scene.glovecal)
        except (BadInput, BadName) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def do(self, context: Any, settings: Any) -> None:
        raise NotImplementedError


class GLOVECAL_OT_connect(GlovecalOperator):  # noqa: N801  # Blender's names
    bl_idname = "glovecal.connect"
    bl_label = "Connect"
    bl_description = "Listen to the gloves' poses"

    def do(self, context: Any, settings: Any) -> None:
        gloves = [name.strip() for name in settings.gloves.split(",") if name.strip()]
        LIVE.connect(settings.endpoint, settings.site, gloves)
        if not bpy.app.timers.is_registered(tick):
            bpy.app.timers.register(tick, first_interval=0.0)


class GLOVECAL_OT_disconnect(GlovecalOperator):  # noqa: N801
    bl_idname = "glovecal.disconnect"
    bl_label = "Disconnect"
    bl_description = "Listen no more; the armature stays as it is"

    def do(self, context: Any, settings: Any) -> None:
        LIVE.disconnect()


class GLOVECAL_OT_make(GlovecalOperator):  # noqa: N801
    bl_idname = "glovecal.make_armature"
    bl_label = "Make a hand"
    bl_description = "An armature of the subject's own hand, for the first glove that has none"

    def do(self, context: Any, settings: Any) -> None:
        skeletons = [hand.skeleton for hand in LIVE.hands if hand.skeleton is not None]
        if not skeletons:
            raise BadInput("whose hand it is, is not known yet; connect, and wait for a calibrated pose")
        settings.armature = make_hand(context, skeletons[0])


class GLOVECAL_OT_record(GlovecalOperator):  # noqa: N801
    bl_idname = "glovecal.record"
    bl_label = "Record"
    bl_description = "Keep every pose from now on"

    def do(self, context: Any, settings: Any) -> None:
        require_armature(settings.armature)
        LIVE.record()


class GLOVECAL_OT_stop(GlovecalOperator):  # noqa: N801
    bl_idname = "glovecal.stop"
    bl_label = "Stop, and write the action"
    bl_description = "What was recorded becomes a new action of the armature"

    def do(self, context: Any, settings: Any) -> None:
        armature = require_armature(settings.armature)
        action = LIVE.write(armature, whole_frames=settings.whole_frames)
        self.report(
            {"INFO"}, f"{action.name}: frames {action.frame_range[0]:.0f} to {action.frame_range[1]:.0f}"
        )


class GLOVECAL_PT_panel(bpy.types.Panel):  # noqa: N801
    bl_label = "Glovecal"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Glovecal"

    def draw(self, context: Any) -> None:
        settings, layout = context.scene.glovecal, self.layout
        for name in ("endpoint", "site", "gloves"):
            row = layout.row()
            row.enabled = not LIVE.is_connected
            row.prop(settings, name)
        layout.operator("glovecal.disconnect" if LIVE.is_connected else "glovecal.connect")
        layout.prop(settings, "armature")
        layout.operator("glovecal.make_armature")
        for hand in LIVE.hands:
            box = layout.box()
            box.label(text=f"{hand.glove}: {hand.sentence}")
            box.label(text=f"{len(hand.names)} bones follow; {hand.counts()}")
        if LIVE.sentence:
            layout.label(text=LIVE.sentence, icon="ERROR")
        layout.prop(settings, "whole_frames")
        layout.operator("glovecal.stop" if LIVE.is_recording else "glovecal.record")


CLASSES = (
    GlovecalSettings, GLOVECAL_OT_connect, GLOVECAL_OT_disconnect, GLOVECAL_OT_make, GLOVECAL_OT_record,
    GLOVECAL_OT_stop, GLOVECAL_PT_panel,
)  # fmt: skip
