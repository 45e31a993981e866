"""How did a new wearing shift, by a few held poses?"""

from __future__ import annotations

from dataclasses import replace

from glovecal_models.quick_check.answer import CheckedWearing
from glovecal_models.takes.take import Take
from glovecal_service.plain import document_of, plain
from glovecal_service.questions.at_once import AskedAtOnce, AtOnce
from glovecal_service.questions.chosen_takes import TakesNamed, takes_for
from glovecal_service.questions.model_work import named_takes, stored_takes
from glovecal_service.request_types import StrictBody
from glovecal_service.store.records import TakeRecord
from glovecal_service.store.store import Store


class Check(StrictBody):
    takes: TakesNamed
    """Ids or names of short takes of one new wearing, with three to five poses held. Angles are measured
    (`r.` columns), or known by the pose's name (column `pose`, or the take's name)."""
    activate: bool = False
    """Predict live with the child."""


def run(asked: AskedAtOnce[Check]) -> CheckedWearing:
    from glovecal_models.calibration.artifact import dump
    from glovecal_models.calibration.samples import sensor_sensitivity
    from glovecal_models.quick_check.held_poses import own_poses, usual_poses
    from glovecal_models.quick_check.quick_check import quick_check

    request, store, record = asked.request, asked.store, asked.model
    model, _ = asked.predictors.get(record.id)
    rows = takes_for(store, record, request.takes, measured=False)
    takes = [store.takes.load(row.id) for row in rows]
    trained = stored_takes(store, named_takes(record))
    known = usual_poses()
    if any(take.poses is not None or not take.rotations for take in takes):
        sensitivity = sensor_sensitivity(model)
        ranges = dict(zip(sensitivity.sensors, sensitivity.range.tolist(), strict=True))
        known = own_poses(_loaded(store, trained), ranges)
    wearings = [row.wearing for row in trained]
    made = quick_check(model, takes, known=known, trained_wearings=wearings, parent_id=record.id)
    found = made.report
    check = {
        **{name: getattr(found, name) for name in ("wearing", "as_found_deg", "as_left_deg")},
        "is_full_calibration_due": found.is_full_calibration_due,
        "takes": [row.id for row in rows],
        "expected": document_of(found.expected),
        "sentences": found.sentences,
    }
    child = store.models.add(
        dump(made.model),
        subject=record.subject,
        layout=record.layout,
        method=record.method,
        parent=record.id,
        facts=plain({**record.facts, "simulated": made.model.simulated, "quick_check": check}),
    )
    if request.activate:
        store.models.activate(child.id)
    return replace(found, model=child.id, parent=record.id, active=request.activate)


def _loaded(store: Store, rows: list[TakeRecord]) -> list[Take]:
    return [store.takes.load(row.id) for row in rows if row.has_reference]


QUESTION = AtOnce(
    kind="quick-check",
    of="model",
    summary="Check a new wearing with a few poses",
    help=(
        "Stores a child model with the wearing's shift; this one stays as it is, and rolling back undoes it."
        "\n\n422 when no pose was held, when no angle is known, and when the poses contradict the model or "
        "each other."
    ),
    request=Check,
    answer=CheckedWearing,
    run=run,
)
