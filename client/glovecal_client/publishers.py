"""Which gloves have a publisher: the liveliness tokens of capture daemons and cameras, as they come and go.

What somebody says in the name of a glove that has none is not believed.
"""

from __future__ import annotations

import zenoh

from glovecal_client.clock import clock_ns
from glovecal_client.errors import BadName
from glovecal_client.keys import parse_glove_key

GONE_FOR_NS = 2_000_000_000
"""The last words of a publisher may be read so long after its token went."""
MOST_NAMES = 1024


class Publishers:
    """Follows the tokens that match ``key_expression``, such as ``GloveKeys.alive``. For any thread."""

    def __init__(self, session: zenoh.Session, key_expression: str) -> None:
        self._gone_ns: dict[str, int | None] = {}
        """When a glove's token went; None while it is there."""
        hear = zenoh.handlers.Callback(self._hear, indirect=False)
        self._subscriber = session.liveliness().declare_subscriber(key_expression, hear, history=True)

    def has(self, glove: str) -> bool:
        """Whether the glove has a publisher, or had one less than 2 s ago."""
        gone_ns = self._gone_ns.get(glove, -GONE_FOR_NS)
        return gone_ns is None or clock_ns() - gone_ns < GONE_FOR_NS

    def close(self) -> None:
        """Follow no more."""
        self._subscriber.undeclare()

    def _hear(self, sample: zenoh.Sample) -> None:
        try:
            glove = parse_glove_key(str(sample.key_expr))[0].glove
        except BadName:
            return
        if sample.kind == zenoh.SampleKind.DELETE:
            if glove in self._gone_ns:
                self._gone_ns[glove] = clock_ns()
        elif glove in self._gone_ns or len(self._gone_ns) < MOST_NAMES or self._forget_one():
            self._gone_ns[glove] = None

    def _forget_one(self) -> bool:
        """Of a glove whose publisher is gone; False where none is."""
        gone = [glove for glove, gone_ns in self._gone_ns.items() if gone_ns is not None]
        for glove in gone:
            self._gone_ns.pop(glove, None)
        return bool(gone)
