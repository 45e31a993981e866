"""A comparison as a page: a model against takes, where its error is, and what it depends on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import Comparison, summed_up
from glovecal_models.comparison.floor_estimate import ORDER, NoiseFloor
from glovecal_models.comparison.noise_floor import RotationNoise, rotation_noise
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.comparison.text import rotation_sentence, wearing_error_sentences
from glovecal_models.comparison.where_it_fails import RotationFindings, WhereItFails, where_it_fails
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.takes.take import Take
from glovecal_service.report.caption import ReportedModel
from glovecal_service.report.comparison_pictures import (
    errors_and_floors,
    floors_sentence,
    heat_map,
    heat_sentence,
    side_by_side,
)
from glovecal_service.report.effects import curves_of, effect_card, parameters_of
from glovecal_service.report.error_fall import lineage_fall
from glovecal_service.report.fingertips import fingertips_part
from glovecal_service.report.html import (
    Fact,
    Section,
    beside,
    counted,
    figure,
    listed,
    note,
    page,
    paragraph,
    table,
)
from glovecal_service.report.rotation_pictures import (
    error_against,
    error_by_wearing,
    measured_against_predicted,
    over_time,
    spectrum_of,
)

CLOSE_UPS = 3
"""Rotations with pictures of their own, those farthest above their floor."""
NAMED_TAKES = 12

ERRORS = (
    *("rotation", "RMSE", "noise floor", "mean |error|", "bias", "95 % below"),
    *("within 1 SD", "NLPD", "error when predicting the mean"),
)
SCALES = (
    "Degrees; noise floors with their 95 % intervals. Within 1 SD: expected 68 %. NLPD: mean negative log "
    "predictive density in nats; expected ln(RMSE) + 1.42 for a correct standard deviation of constant size."
)
FLOORS = (
    "Every estimate that these takes allow, in degrees with 95 % intervals; the first one of a row counts. "
    "Spectrum and frame to frame are lower bounds: they do not include autocorrelated noise."
)


def report_page(
    main: ReportedModel,
    takes: Sequence[Take],
    others: Sequence[ReportedModel] = (),
    *,
    ancestors: Sequence[CalibrationModel] = (),
    simpler: Mapping[str, CalibrationModel] | None = None,
    dimensions: HandDimensions | None = None,
    ceiling: Mapping[str, Any] | None = None,
) -> str:
    """HTML, ``main`` looked at closely. Raises LayoutMismatch, and BadInput when nothing was measured.

    ``ancestors``, oldest first, and ``simpler`` calibrations show how the error fell down to ``main``.
    ``dimensions`` of the subject's hand, for the errors of fingertips; ``ceiling`` of ``main``, where known.
    """
    found = residuals(main.model, takes)
    noise = rotation_noise(found)
    numbers, where = summed_up(found, noise, dimensions=dimensions), where_it_fails(found, noise=noise)
    sections = [
        Section("Models side by side", _side_by_side(main, numbers, takes, others)),
        Section("How the error falls", _fall(main, ancestors, simpler or {}, takes, numbers)),
        Section("Effects in the model", _effects(main.model)),
        Section(
            "Error and noise floor",
            [figure(errors_and_floors(where), floors_sentence(where)), *_table(numbers, where)],
        ),
        Section("Fingertips", fingertips_part(numbers.fingertips, dimensions)),
        Section("What the error depends on", [figure(heat_map(where), heat_sentence(where))]),
        *(_close_up(item, found, noise[item.rotation]) for item in where.rotations[:CLOSE_UPS]),
        Section("Worst stretches", [_stretches(where)]),
        Section("Noise floors", _floors(where)),
        Section("Details", [_details(main, others, takes)]),
    ]
    title = f"Errors of {main.title} ({counted(len(takes), 'take')})"
    summary = _summary(main, numbers, where)
    if ceiling is not None:
        summary.insert(-1, Fact("Ceiling", ceiling["sentence"]))
    return page(title, summary, sections, notes=_notes(main, others, takes))


def _summary(main: ReportedModel, numbers: Comparison, where: WhereItFails) -> list[Fact]:
    overall, worst = numbers.overall, where.rotations[0]
    done = sum(item.is_at_floor for item in where.rotations)
    floor = "" if overall.floor is None else f"; noise floor {_floor(overall.floor)}"
    is_done = done == len(where.rotations)
    verdict = (
        f"All of {counted(done, 'rotation')} are at their noise floor."
        if is_done
        else f"{len(where.rotations) - done} of {counted(len(where.rotations), 'rotation')} above their "
        "noise floor."
    )
    size = (
        f"RMSE {overall.rmse_deg:.2f} degrees over {counted(len(numbers.rotations), 'rotation')}{floor}; "
        f"error when predicting the mean: {overall.baseline_deg:.1f}"
    )
    claimed = f"{100 * overall.coverage:.0f} % of errors within one claimed SD (expected: 68 %)"
    verb = "model activate" if is_done else "diagnose"
    wearings = wearing_error_sentences(numbers)
    return [
        Fact("Verdict", verdict),
        *([Fact("Wearings", " ".join(wearings))] if wearings else []),
        Fact("Size", size),
        Fact("Claimed SD", claimed),
        Fact("Place", f"largest possible improvement: {rotation_sentence(worst)}"),
        Fact("Next", f"glovecal {verb} {main.id[:12]}", is_command=True),
    ]


def _notes(main: ReportedModel, others: Sequence[ReportedModel], takes: Sequence[Take]) -> list[Markup]:
    warnings = []
    if any(take.simulated for take in takes):
        warnings.append("At least one of these takes comes from a simulated glove.")
    seen = [one for one in (main, *others) if one.trained_on]
    if seen:
        named = "; ".join(f"{one.name} was trained on {len(one.trained_on)} of these takes" for one in seen)
        warnings.append(f"Not a held-out error: {named}.")
    return [note("", warnings)] if warnings else []


def _side_by_side(
    main: ReportedModel, numbers: Comparison, takes: Sequence[Take], others: Sequence[ReportedModel]
) -> list[Markup]:
    """Nothing for one model."""
    if not others:
        return []
    models = {main.name: numbers}
    models |= {other.name: summed_up(residuals(other.model, takes)) for other in others}
    return [figure(*side_by_side(models))]


def _fall(
    main: ReportedModel,
    ancestors: Sequence[CalibrationModel],
    simpler: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    numbers: Comparison,
) -> list[Markup]:
    """The versions before this one; nothing for a first version."""
    if not ancestors:
        return []
    return [figure(*lineage_fall([*ancestors, main.model], simpler, takes, numbers.overall))]


def _effects(model: CalibrationModel) -> list[Markup]:
    return [
        effect_card(added.name, parameters_of(added), added.settings.get("declaration"), curves_of(added))
        for added in model.effects
    ]


def _close_up(item: RotationFindings, found: Residuals, noise: RotationNoise) -> Section:
    """One rotation with its pictures."""
    figures = [measured_against_predicted(found, item.rotation)]
    if noise.spectrum is not None:
        figures.append(spectrum_of(noise.spectrum, item.rotation))
    figures += [error_against(item, one) for one in (item.structure or item.dependences)[:2]]
    if item.wearings is not None:
        figures.append(error_by_wearing(item.wearings))
    return Section(
        f"Rotation {item.rotation}",
        [
            paragraph(rotation_sentence(item)),
            figure(*over_time(found, item.rotation)),
            beside([figure(*one) for one in figures]),
        ],
    )


def _details(main: ReportedModel, others: Sequence[ReportedModel], takes: Sequence[Take]) -> Markup:
    frames = sum(len(take.time_s) for take in takes)
    names = ", ".join(take.name for take in takes[:NAMED_TAKES]) + (
        " ..." if len(takes) > NAMED_TAKES else ""
    )
    rows = [
        ("model", main.id),
        ("method", main.model.method),
        ("subject", main.model.subject),
        ("layout", main.model.layout.name),
        ("takes", f"{names}; {frames} frames"),
        *((other.name, other.id) for other in others),
    ]
    return table(("", ""), rows)


def _table(numbers: Comparison, where: WhereItFails) -> list[Markup]:
    named = [("all", numbers.overall)]
    named += [(item.rotation, numbers.rotations[item.rotation]) for item in where.rotations]
    rows = [
        (
            name, f"{one.rmse_deg:.2f}", _floor(one.floor), f"{one.mae_deg:.2f}", f"{one.bias_deg:+.2f}",
            f"{one.percentile_95_deg:.2f}", f"{100 * one.coverage:.0f} %",
            "-" if one.nlpd is None else f"{one.nlpd:.2f}", f"{one.baseline_deg:.1f}",
        )
        for name, one in named
    ]  # fmt: skip
    return [table(ERRORS, rows), paragraph(SCALES)]


def _floor(floor: NoiseFloor | None) -> str:
    if floor is None:
        return "unknown"
    least = "at least " if floor.is_lower_bound else ""
    return f"{least}{_with_interval(floor)}{'' if floor.is_reliable else ', not reliable'}"


def _with_interval(floor: NoiseFloor) -> str:
    return f"{floor.floor_deg:.2f} ({floor.low_deg:.2f}-{floor.high_deg:.2f})"


def _floors(where: WhereItFails) -> list[Markup]:
    rows = []
    for item in where.rotations:
        every = (item.floor, *item.other_floors) if item.floor is not None else ()
        cells = {one.how: _with_interval(one) for one in every}
        rows.append((item.rotation, *(cells.get(how, "-") for how in ORDER)))
    doubts: dict[str, list[str]] = {}
    for item in where.rotations:
        for reason in item.floor.reasons if item.floor is not None else ():
            doubts.setdefault(reason, []).append(item.rotation)
    told = [f"Not reliable ({', '.join(names)}): {reason}." for reason, names in doubts.items()]
    return [table(("rotation", *ORDER), rows), paragraph(FLOORS), *([listed(told)] if told else [])]


def _stretches(where: WhereItFails) -> Markup:
    heads = ("take", "when", "pose", "RMSE, degrees", "worst rotation", "its RMSE")
    rows = [
        (
            one.take, f"{one.start_s:.1f} to {one.end_s:.1f} s", one.pose or "-", f"{one.rmse_deg:.1f}",
            one.rotation, f"{one.rotation_rmse_deg:.1f}",
        )
        for one in where.stretches
    ]  # fmt: skip
    return table(heads, rows)
