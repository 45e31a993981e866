"""A comparison as one HTML page that needs nothing else: no script, no font, no picture from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.compare import Comparison, summed_up
from glovecal_models.comparison.floor_estimate import ORDER, NoiseFloor
from glovecal_models.comparison.residuals import Residuals, residuals
from glovecal_models.comparison.rotation_noise import RotationNoise, rotation_noise
from glovecal_models.comparison.where_it_fails import RotationFindings, WhereItFails, where_it_fails
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.takes.take import Take
from glovecal_service.report.closer_pictures import (
    error_by_wearing,
    measured_against_predicted,
    spectrum_of,
)
from glovecal_service.report.fingertips import fingertips_part
from glovecal_service.report.html import figure, table, whole_page
from glovecal_service.report.lineage_fall import lineage_fall
from glovecal_service.report.pictures import error_against, errors_and_floors, heat_map, over_time
from glovecal_service.report.reported_model import ReportedModel
from glovecal_service.report.sentences import counted, floors_sentence, heat_sentence, in_one_sentence
from glovecal_service.report.side_by_side import side_by_side

LOOKED_AT_CLOSELY = 3
"""Rotations, those farthest above their floor."""

ERRORS = (
    *("rotation", "RMSE", "noise floor", "mean |error|", "bias", "95 % below"),
    *("within 1 sd", "NLPD", "its own spread"),
)
SCALES = (
    "Degrees; noise floors with their 95 % intervals. Within 1 sd: 68 % is truthful. NLPD: mean negative log "
    "predictive density in nats; a truthful standard deviation of constant size has ln(RMSE) + 1.42. Its own "
    "spread: the error of always answering the mean angle."
)
FLOORS = (
    "Every estimate that these takes allow, in degrees with 95 % intervals; the first one of a row counts. "
    "Spectrum and frame to frame are lower bounds: noise with a memory is not in them."
)


def report_page(
    main: ReportedModel,
    takes: Sequence[Take],
    beside: Sequence[ReportedModel] = (),
    *,
    ancestors: Sequence[CalibrationModel] = (),
    simpler: Mapping[str, CalibrationModel] | None = None,
    dimensions: HandDimensions | None = None,
) -> str:
    """HTML, ``main`` looked at closely. Raises LayoutMismatch, and BadInput when nothing was measured.

    ``ancestors``, oldest first, and ``simpler`` calibrations show how the error fell down to ``main``.
    ``dimensions`` of the subject's hand, for the errors of fingertips.
    """
    found = residuals(main.model, takes)
    noise = rotation_noise(found)
    numbers, where = summed_up(found, noise, dimensions=dimensions), where_it_fails(found, noise=noise)
    parts = [
        f"<h1>Model {escape(main.id[:12])} against {counted(len(takes), 'take')}</h1>",
        _what(main, takes),
        f"<p><strong>{escape(in_one_sentence(numbers, where))}</strong></p>",
        *_beside(main, numbers, takes, beside),
        *_fall(main, ancestors, simpler or {}, takes, numbers),
        "<h2>How far off, and how far it could be</h2>",
        figure(errors_and_floors(where), floors_sentence(where)),
        _table(numbers, where),
        *fingertips_part(numbers.fingertips, dimensions),
        "<h2>What the errors depend on</h2>",
        figure(heat_map(where), heat_sentence(where)),
    ]
    for item in where.rotations[:LOOKED_AT_CLOSELY]:
        parts += _closely(item, found, noise[item.rotation])
    parts += ["<h2>The worst seconds</h2>", _stretches(where), "<h2>Noise floors</h2>", _floors(where)]
    return whole_page(f"model {main.id[:12]}", parts)


def _beside(
    main: ReportedModel, numbers: Comparison, takes: Sequence[Take], beside: Sequence[ReportedModel]
) -> list[str]:
    """The part with several models, nothing for one."""
    if not beside:
        return []
    models = {main.name: numbers}
    models |= {other.name: summed_up(residuals(other.model, takes)) for other in beside}
    notes = [_trained_on(other) for other in beside]
    return ["<h2>Side by side</h2>", *notes, figure(*side_by_side(models))]


def _fall(
    main: ReportedModel,
    ancestors: Sequence[CalibrationModel],
    simpler: Mapping[str, CalibrationModel],
    takes: Sequence[Take],
    numbers: Comparison,
) -> list[str]:
    """The part with the versions before this one, nothing for a first version."""
    if not ancestors:
        return []
    picture = lineage_fall([*ancestors, main.model], simpler, takes, numbers.over_all)
    return ["<h2>How the error fell</h2>", figure(*picture)]


def _closely(item: RotationFindings, found: Residuals, noise: RotationNoise) -> list[str]:
    """One rotation with its pictures."""
    figures = [measured_against_predicted(found, item.rotation)]
    if noise.spectrum is not None:
        figures.append(spectrum_of(noise.spectrum, item.rotation))
    figures += [error_against(item, one) for one in (item.structure or item.dependences)[:2]]
    if item.wearings is not None:
        figures.append(error_by_wearing(item.wearings))
    return [
        f"<h2>{escape(item.rotation)}</h2><p>{escape(item.sentence)}</p>",
        figure(*over_time(found, item.rotation)),
        '<div class="side">' + "".join(figure(*one) for one in figures) + "</div>",
    ]


def _what(main: ReportedModel, takes: Sequence[Take]) -> str:
    model = main.model
    frames = sum(len(take.time_s) for take in takes)
    names = ", ".join(escape(take.name) for take in takes[:12]) + (" ..." if len(takes) > 12 else "")
    text = (
        f"<p>Method {escape(model.method)}, subject {escape(model.subject)}, "
        f"layout {escape(model.layout.name)}. Takes: {names}; {frames} frames.</p>"
    )
    if any(take.simulated for take in takes):
        text += '<p class="note">At least one of these takes comes from a <b>simulated</b> glove.</p>'
    return text + _trained_on(main)


def _trained_on(one: ReportedModel) -> str:
    if not one.trained_on:
        return ""
    return (
        f'<p class="note">Model {escape(one.name)} was trained on {len(one.trained_on)} of these takes: such '
        "errors are smaller than on takes it has not seen.</p>"
    )


def _table(numbers: Comparison, where: WhereItFails) -> str:
    named = [("all", numbers.over_all)]
    named += [(item.rotation, numbers.rotations[item.rotation]) for item in where.rotations]
    rows = [
        (
            name, f"{one.rmse_deg:.2f}", _floor(one.floor), f"{one.mae_deg:.2f}", f"{one.bias_deg:+.2f}",
            f"{one.percentile_95_deg:.2f}", f"{100 * one.coverage:.0f} %",
            "-" if one.nlpd is None else f"{one.nlpd:.2f}", f"{one.baseline_deg:.1f}",
        )
        for name, one in named
    ]  # fmt: skip
    return f"{table(ERRORS, rows)}<p>{escape(SCALES)}</p>"


def _floor(floor: NoiseFloor | None) -> str:
    if floor is None:
        return "unknown"
    least = "at least " if floor.is_lower_bound else ""
    return f"{least}{_with_interval(floor)}"


def _with_interval(floor: NoiseFloor) -> str:
    return f"{floor.floor_deg:.2f} ({floor.low_deg:.2f}-{floor.high_deg:.2f})"


def _floors(where: WhereItFails) -> str:
    rows = []
    for item in where.rotations:
        every = (item.floor, *item.other_floors) if item.floor is not None else ()
        cells = {one.how: _with_interval(one) for one in every}
        rows.append((item.rotation, *(cells.get(how, "-") for how in ORDER)))
    return f"{table(('rotation', *ORDER), rows)}<p>{escape(FLOORS)}</p>"


def _stretches(where: WhereItFails) -> str:
    heads = ("take", "when", "pose", "RMSE, degrees", "worst rotation", "its RMSE")
    rows = [
        (
            one.take, f"{one.start_s:.1f} to {one.end_s:.1f} s", one.pose or "-", f"{one.rmse_deg:.1f}",
            one.rotation, f"{one.rotation_rmse_deg:.1f}",
        )
        for one in where.stretches
    ]  # fmt: skip
    return table(heads, rows)
