"""Steps in which fingertips are held together, or apart by a rod: IK sampling.

Wang & Neff 2013, section 5.2.1, and for the rod the second limit in its section 9. The tips stay together
through the whole recording while the hand changes its shape, so that every frame is a sample; which angles
they are is worked out afterwards, by inverse kinematics on the subject's own hand.
"""

from __future__ import annotations

from glovecal_models.sampling.step import Step

TOUCH_S = 4.0
_FINGER = {"I": "index", "M": "middle", "R": "ring", "P": "little"}


def touch_steps() -> list[Step]:
    """Thumb to index, middle, ring and little finger."""
    return [
        Step(
            name=f"touch-{finger}",
            kind="ik",
            motion="move",
            ask=f"Thumb and {word} fingertip together; keep them together while you move both.",
            seconds=TOUCH_S,
            part="touch",
            pose=f"touch-{finger}",
            moves=(f"{finger}_MCP",),
            touches=("T", finger),
        )
        for finger, word in _FINGER.items()
    ]


def rod_step(length_mm: float, finger: str = "I") -> Step:
    """The ends of a rod of known length between thumb and one fingertip."""
    rod = f"the rod of {length_mm:g} mm"
    return Step(
        name=f"rod-{finger}-{length_mm:g}",
        kind="ik",
        motion="move",
        ask=f"Hold {rod} between the tips of thumb and {_FINGER[finger]} finger, and move both.",
        seconds=TOUCH_S,
        part="rod",
        pose=f"rod-{finger}-{length_mm:g}",
        moves=(f"{finger}_MCP",),
        needs=rod,
        touches=("T", finger),
        rod_mm=length_mm,
    )
