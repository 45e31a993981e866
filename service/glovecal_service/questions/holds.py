"""How do readings drift while a pose is held?"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from glovecal_models.diagnosis.hold_answer import DriftInHolds
from glovecal_models.errors import BadInput
from glovecal_service.questions.at_once import AskedAtOnce, AtOnce
from glovecal_service.request_types import Id, StrictBody

MOST_TAKES = 500


class HoldsRequest(StrictBody):
    takes: Annotated[list[Id], Field(min_length=1, max_length=MOST_TAKES)]


def run(asked: AskedAtOnce[HoldsRequest]) -> DriftInHolds:
    from glovecal_models.diagnosis.hold_drift import hold_drift
    from glovecal_models.diagnosis.hold_text import drift_in_holds
    from glovecal_models.diagnosis.next_take import hold_next_take
    from glovecal_models.diagnosis.posed_holds import degrees_of_spans

    request, store = asked.request, asked.store
    wanted = list(dict.fromkeys(request.takes))
    first, *others = takes = [store.takes.load(id) for id in wanted]
    for take in others:
        if set(take.sensors) != set(first.sensors):
            raise BadInput(
                f"take {take.name!r} has other sensors than {first.name!r}; look at takes of one glove"
            )
    layout = store.layouts.get(store.takes.get(wanted[0]).layout)
    drift = hold_drift(takes, layout.sensors, deg_of_span=degrees_of_spans(takes, layout))
    return drift_in_holds(drift, hold_next_take(drift))


QUESTION = AtOnce(
    kind="holds",
    of="takes",
    summary="How readings drift in held poses",
    help="Poses by their names, else by a reference of 0 and 1, else by still stretches with like readings.",
    request=HoldsRequest,
    answer=DriftInHolds,
    run=run,
)
