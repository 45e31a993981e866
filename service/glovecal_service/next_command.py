"""The one command after a diagnosis, on the command line and on its page."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from glovecal_models.effects.base.motions import TAPS
from glovecal_service.views.next_take import FREE_MOTION

SHORT = 12
LONG_ENOUGH_S = 60
"""Of movement, to tell an unexplained residual from noise."""


def next_command(model: str, found: Mapping[str, Any], subject: str = "", hand: str | None = None) -> str:
    """For a diagnosis document of that model of ``subject``, and of ``hand`` where that is known."""
    short = model[:SHORT]
    if found.get("odd_takes"):
        without = "".join(f" --leave-out {take['id']}" for take in found["odd_takes"])
        return _train(subject, hand, found.get("method") or "lmc_gpr") + without
    if found.get("reference_problems"):
        return f"glovecal take check {_take_of(found)}"
    named, following = found.get("named"), found.get("next_take")
    if named and named.get("kind") == "finding":
        return f"glovecal record GLOVE after-mending --seconds {LONG_ENOUGH_S}"
    if named and named.get("verdict") == "named":
        if named.get("method"):
            return _train(subject, hand, named["method"])
        where = "".join(f" --rotation {name}" for name in named.get("where") or ())
        return f"glovecal add-effect {short} {named['effect']}" + where * _is_on_rotations(found)
    if following:
        return recording_command(following)
    if named:
        return f"glovecal add-effect {short} {named['effect']}"
    for action in found.get("actions") or ():
        command = action_command(model, action, subject, hand)
        if command is not None:
            return command
    residual = found.get("unexplained_residual") or {}
    if residual.get("is_significant"):
        return f"glovecal where {short} --report where-{short}.html"
    if residual.get("not_identifiable"):
        return f"glovecal record GLOVE {FREE_MOTION} --seconds {LONG_ENOUGH_S}"
    return f"glovecal model activate {short}"


def recording_command(following: Mapping[str, Any]) -> str:
    """Of the recording that decides; documents of an earlier service name none."""
    if following.get("motion") == TAPS.name:
        return "glovecal take latency GLOVE"
    name = following.get("take_name", "deciding")
    return f"glovecal record GLOVE {name} --seconds {following['seconds']}"


def action_command(
    model: str, action: Mapping[str, Any], subject: str = "", hand: str | None = None
) -> str | None:
    """Of one action of a diagnosis; None where nothing is known that would help."""
    if action.get("method"):
        return _train(subject, hand, action["method"])
    if not action.get("saves"):
        return None
    return f"glovecal add-effect {model[:SHORT]} {action['effect']} --rotation {action['rotation']}"


def _train(subject: str, hand: str | None, method: str) -> str:
    of_hand = f" --hand {hand}" if hand else ""
    return f"glovecal train --subject {subject or 'SUBJECT'}{of_hand} --method {method}"


def _take_of(found: Mapping[str, Any]) -> str:
    """The id of the take that the first problem speaks of, else of the first: names need not be unique."""
    takes, problem = found.get("takes") or (), found["reference_problems"][0]
    spoken_of = [take for take in takes if f"take {take['name']}:" in problem]
    return next((take["id"] for take in (*spoken_of, *takes)), "TAKE")


def _is_on_rotations(found: Mapping[str, Any]) -> bool:
    """Whether the named effect is a correction; a fault is named by its sensors or takes."""
    return found["named"].get("kind") == "correction"
