"""Glovecal in Blender: hands from data gloves on any armature, live, recorded and baked."""

from __future__ import annotations

import bpy  # pyright: ignore[reportMissingImports]

from . import panel

CLASSES = panel.CLASSES


def register() -> None:
    for each in CLASSES:
        bpy.utils.register_class(each)
    bpy.types.Scene.glovecal = bpy.props.PointerProperty(type=panel.GlovecalSettings)


def unregister() -> None:
    panel.LIVE.disconnect()
    del bpy.types.Scene.glovecal
    for each in reversed(CLASSES):
        bpy.utils.unregister_class(each)
