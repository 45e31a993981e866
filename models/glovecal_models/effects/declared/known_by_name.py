"""Effects that answer to their names only for a while.

A declared effect belongs to the models that hold it, not to the catalogue: two models may each have a
``strap`` of their own.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from glovecal_models.effects.base.effect import Effect
from glovecal_models.effects.catalogue import catalogue

_ONE_CALL = threading.RLock()


@contextmanager
def known_by_name(effects: Sequence[Effect]) -> Iterator[None]:
    """Within the block ``effects`` answer to their names; for one caller of this process at a time."""
    with _ONE_CALL:
        known = catalogue()
        before = {item.name: known.get(item.name) for item in effects}
        known.update({item.name: item for item in effects})
        try:
            yield
        finally:
            for name, earlier in before.items():
                if earlier is None:
                    del known[name]
                else:
                    known[name] = earlier
