"""What does a calibration rest on, how good is it, and what is left to do?"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.text import model_effect, wearing_sentences
from glovecal_models.calibration.training_settings import (
    trained_rotations,
)
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.comparison.noise_floor import takes_noise
from glovecal_models.errors import BadInput, NotTrainable, reason_of
from glovecal_models.hand.rotations import is_of_hand
from glovecal_models.improvement.fall.lineage import SIMPLER, simpler_calibrations
from glovecal_models.parts import Part, Undivided
from glovecal_models.progress import Cancel, Report
from glovecal_models.takes.take import Take
from glovecal_service.plain import document_of, plain, read
from glovecal_service.questions.ceiling import known_ceiling
from glovecal_service.questions.diagnose import newest_diagnosis
from glovecal_service.questions.model_work import leave_out_folds, named_takes
from glovecal_service.questions.question import Asked, Question, WorkOnTakes
from glovecal_service.report.calibration_answer import (
    CalibrationReport,
    PastCheck,
    ReportedRotation,
    ReportedTake,
    ToRecord,
)
from glovecal_service.report.coverage import covered_angles, covered_readings
from glovecal_service.request_types import StrictBody
from glovecal_service.store import Store
from glovecal_service.store.records import ModelRecord, TakeRecord

MOST_STEPS = 5


class CalibrationReportRequest(StrictBody):
    pass


def _work(on: WorkOnTakes, _: CalibrationReportRequest) -> Undivided[CalibrationReport]:
    def worked(cancelled: Cancel | None, report: Report | None) -> CalibrationReport:
        """Raises Cancelled."""
        model = on.loaded
        measured = [take for take in on.takes if take.rotations]
        simpler: dict[str, CalibrationModel] = {}
        folds = leave_out_folds(on.settings)
        with suppress(BadInput, NotTrainable):  # they stand beside it only
            simpler = simpler_calibrations(
                measured, model.layout, model.subject, SIMPLER, folds, cancelled, report
            )
        floors = takes_noise(measured, trained_rotations(model)) if measured else {}
        return CalibrationReport(
            made_at=datetime.now(UTC),
            how_held_out=str(model.error_estimate.get("how", "not estimated")),
            errors_deg={
                name: one.error_estimate.get("rmse_deg") for name, one in {"model": model, **simpler}.items()
            },
            rotations=[
                ReportedRotation(
                    rotation=item.rotation,
                    sensors=item.correspondence.sensors,
                    held_out_rmse_deg=item.held_out_rmse_deg,
                    linear_rmse_deg=_error_of(simpler.get("linear"), item.rotation),
                    raw_rmse_deg=_error_of(simpler.get("raw"), item.rotation),
                    floor=_floor_of(floors.get(item.rotation), item.held_out_rmse_deg),
                )
                for item in model.rotations
            ],
            wearing_sentences=wearing_sentences(model, model.error_estimate.get("rmse_deg")),
            trained_on=(),
            takes_gone=0,
            sentences=(),
            effects=[read(ModelEffect, document_of(model_effect(item))) for item in model.effects],
            covered_angles=covered_angles(measured, [item.rotation for item in model.rotations]),
            covered_readings=covered_readings(on.takes),
            diagnosis=None,
            ceiling=None,
            **_to_record(model, measured),
            checks=(),
            check_sentences=(),
            is_active=False,
        )

    return Undivided(Part("the report", CalibrationReport), worked)


def _floor_of(floor: NoiseFloor | None, rmse_deg: float | None) -> NoiseFloor | None:
    """Never above the error that stands beside it."""
    return floor if floor is None or rmse_deg is None else floor.beside(rmse_deg)


def _error_of(model: CalibrationModel | None, rotation: str) -> float | None:
    own = [] if model is None else [item for item in model.rotations if item.rotation == rotation]
    return own[0].held_out_rmse_deg if own else None


def _to_record(model: CalibrationModel, takes: Sequence[Take]) -> dict[str, Any]:
    """What teaches most for its time, and what is to be known of that."""
    from glovecal_models.sampling.active.next_step import propose_for_model  # few commands need it

    try:
        proposal = propose_for_model(model, takes).to_document(MOST_STEPS)
    except BadInput as error:
        return {"to_record": (), "advice": [f"No pose is proposed: {reason_of(error)}."]}
    steps = [ToRecord(**{name: step[name] for name in STEP}) for step in proposal["steps"]]
    return {"to_record": () if proposal["enough"] else steps, "advice": proposal["sentences"]}


STEP = ("name", "ask", "seconds", "error_fall_deg")


def _finish(
    store: Store, asked: Asked[CalibrationReportRequest], computed: CalibrationReport
) -> CalibrationReport:
    """With what only the store knows: its takes, what was found of it, and quick checks."""
    record = asked.model
    assert record is not None
    checked = _checked(store, record)
    return replace(
        computed,
        made_at=record.created_at,
        trained_on=[_taken(take) for take in asked.takes],
        takes_gone=len(named_takes(record)) - len(asked.takes),
        sentences=record.facts.get("sentences", ()),
        diagnosis=newest_diagnosis(store, record),
        ceiling=known_ceiling(store, record),
        checks=[
            PastCheck(
                made_at=model.created_at,
                **{name: plain(check.get(name)) for name in ("wearing", "as_found_deg", "as_left_deg")},
                model=model.id,
            )
            for model, check in checked
        ],
        check_sentences=checked[-1][1].get("sentences", ()) if checked else (),
        is_active=store.models.is_active(record),
        simulated=bool(record.facts.get("simulated")),
    )


def _taken(take: TakeRecord) -> ReportedTake:
    return ReportedTake(
        take.name, take.id, take.wearing, take.duration_s, len(take.rotations), take.created_at
    )


def _checked(store: Store, record: ModelRecord) -> list[tuple[ModelRecord, Mapping[str, Any]]]:
    """Models that quick checks of the same glove made, oldest first, and what was found."""
    every = store.models.list(subject=record.subject, layout=record.layout)
    return [
        (model, check)
        for model in every
        if is_of_hand(model.hand, record.hand) and (check := model.facts.get("quick_check"))
    ]


CALIBRATION_REPORT = Question(
    kind="calibration-report",
    verb=None,
    of=("model",),
    summary="Report on a calibration",
    help=(
        "Gather what a calibration rests on: its takes, held-out errors beside noise floors and simpler "
        "calibrations, effects with their evidence, what was covered, what remains, what to record next, and "
        "quick checks."
    ),
    request=CalibrationReportRequest,
    answer=CalibrationReport,
    work=_work,
    finish=_finish,
    of_training=True,
    is_short=True,
)
