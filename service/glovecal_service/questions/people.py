"""The people of a layout as a prior for somebody new: means and variances of what their takes say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from glovecal_models.hand.rotations import Handedness
from glovecal_models.takes.take import Take
from glovecal_service.store import Store

if TYPE_CHECKING:
    from glovecal_models.calibration.people_prior import PeoplePrior

MOST_TAKES = 100
"""The newest: somebody waits meanwhile, some seconds with so many (500 took 21 s and 470 MB)."""


def prior_of_people(
    store: Store, layout: str, hand: Handedness | None = None, *, besides: str | None = None
) -> PeoplePrior:
    """Of everybody with takes that have a reference, but ``besides``; of ``hand``, and of takes of which
    nobody said it. Raises NotFound, NotTrainable."""
    from glovecal_models.calibration.people_prior import people_prior  # slow to load, and seldom asked for

    parsed = store.layouts.get(layout)
    records = [
        take
        for take in store.takes.list(layout=layout)
        if take.has_reference and take.subject != besides and take.is_of(hand)
    ]
    people: dict[str, list[Take]] = {}
    for record in records[-MOST_TAKES:]:
        people.setdefault(record.subject, []).append(store.takes.load(record.id))
    return people_prior(people, parsed)
