"""Test support: a simulated hand's poses through a real router, one given before the next is published."""

from __future__ import annotations

from collections.abc import Iterator

from stream.hand_stream import Hand, HandStream
from stream.simulated_hand import Script, SimulatedHand, free_endpoint

from glovecal_client import open_client, open_router


def hands_over_zenoh(script: Script, seconds: float, **settings) -> Iterator[Hand]:
    """Hands of the script up to ``seconds``, as fast as they go; settings are those of SimulatedHand."""
    endpoint = free_endpoint()
    with (
        open_router([endpoint]),
        open_client([endpoint]) as sender,
        open_client([endpoint]) as receiver,
        HandStream(receiver, "lab", "right") as hands,
    ):
        glove = SimulatedHand(sender, "lab", "right", script, **settings)
        heard = False
        while (at := glove.publish()) <= seconds:
            hand = hands.wait(60.0 if heard else 0.05)
            assert hand is not None or not heard, f"the pose of {at} s did not come"
            if hand is not None:
                heard = True
                yield hand
        glove.close()
