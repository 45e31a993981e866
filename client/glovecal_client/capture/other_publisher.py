"""Is somebody else already publishing this glove? Two publishers on one key would mix two streams."""

from __future__ import annotations

import time
from collections.abc import Callable

import zenoh

from glovecal_client.errors import NoAnswer
from glovecal_client.keys import GloveKeys
from glovecal_client.queries import ask_json

PATIENCE_S = 12.0
"""A publisher that died with its computer keeps its liveliness token until zenoh's lease of 10 s ends."""


def other_publisher(
    session: zenoh.Session,
    keys: GloveKeys,
    cancelled: Callable[[], bool],
    *,
    patience_s: float = PATIENCE_S,
) -> str | None:
    """A sentence naming the publisher that has the glove, None if it is free.

    A token whose owner answers is believed at once; a silent one must outlive the lease.
    """
    deadline = time.monotonic() + patience_s
    while _token_present(session, keys):
        try:
            meta = ask_json(session, keys.meta, timeout_s=1.0)
        except NoAnswer:
            if time.monotonic() >= deadline or cancelled():
                return (
                    f"glove {keys.glove!r} at site {keys.site!r} is held by a publisher that does not answer"
                )
            time.sleep(0.2)
        else:
            return describe_publisher(keys, meta)
    return None


def describe_publisher(keys: GloveKeys, meta: dict[str, object]) -> str:
    """The sentence for a publisher that sent this meta or status."""
    device = f" with device {meta['device']!r}" if "device" in meta else ""
    run = str(meta.get("run_id"))[:16]
    return (
        f"glove {keys.glove!r} at site {keys.site!r} is already published by run {run}{device};"
        " stop that capture or give this one another --glove name"
    )


def _token_present(session: zenoh.Session, keys: GloveKeys) -> bool:
    return any(reply.ok is not None for reply in session.liveliness().get(keys.alive, timeout=2.0))
