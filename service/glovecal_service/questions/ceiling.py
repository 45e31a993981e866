"""Is anything left to gain from what was recorded?"""

from __future__ import annotations

from glovecal_models.ceiling.answer import CeilingOfModel, LeftToGain
from glovecal_models.ceiling.ceiling import RECIPE
from glovecal_models.ceiling.text import left_to_gain
from glovecal_models.parts import Part, Undivided
from glovecal_models.progress import Cancel, Report
from glovecal_service.plain import read
from glovecal_service.questions.question import Question, WorkOnTakes
from glovecal_service.request_types import Seed, StrictBody
from glovecal_service.store import Store
from glovecal_service.store.records import ModelRecord


class CeilingRequest(StrictBody):
    seed: Seed = 0
    """Of trees and controls."""


def _work(on: WorkOnTakes, request: CeilingRequest) -> Undivided[CeilingOfModel]:
    """A black box on the model's errors on left-out quarters of the takes."""

    def worked(cancelled: Cancel | None, report: Report | None) -> CeilingOfModel:
        """Raises BadInput, NotTrainable, Cancelled."""
        from glovecal_models.ceiling.black_box_ceiling import black_box_ceiling  # heavy

        found = black_box_ceiling(
            on.loaded, on.takes, on.settings, seed=request.seed, cancelled=cancelled, report=report
        )
        return CeilingOfModel(**vars(left_to_gain(found)))

    return Undivided(Part("the ceiling", CeilingOfModel, {"seed": request.seed, "recipe": RECIPE}), worked)


CEILING = Question(
    kind="ceiling",
    verb="ceiling",
    of=("model",),
    summary="Find whether anything is left to gain from what was recorded",
    help=(
        "Find whether a model leaves anything to gain, or the recorded sensors do not know more.\n\n"
        "The model is trained again without each quarter of the takes, and a black box predicts its error "
        "from all readings and their history, context, wearing and time. compare, where and diagnose show "
        "the answer then."
    ),
    request=CeilingRequest,
    answer=CeilingOfModel,
    work=_work,
)


def known_ceiling(store: Store, record: ModelRecord) -> LeftToGain | None:
    """What was last found for this model, by ``improve`` or by a job; None when nobody asked."""
    found = record.facts.get("ceiling")
    for job in store.jobs.list(subject=record.subject):
        if job.kind == CEILING.kind and job.payload.get("model") == record.id and job.result:
            found = job.result
            break
    return None if found is None else read(LeftToGain, found)
