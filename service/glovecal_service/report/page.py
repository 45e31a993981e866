"""A comparison as one HTML page that needs nothing else: no script, no font, no picture from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from importlib.metadata import version

from glovecal_models.calibration.comparison import Comparison, summed_up
from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.comparison.residuals import residuals
from glovecal_models.comparison.where_it_fails import RotationFindings, WhereItFails, where_it_fails
from glovecal_models.takes.take import Take
from glovecal_service.report.pictures import error_against, errors_and_floors, heat_map, over_time
from glovecal_service.report.sentences import counted, floors_sentence, heat_sentence, in_one_sentence

LOOKED_AT_CLOSELY = 3
"""Rotations, those farthest above their floor."""

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1a1a1a; max-width: 60rem; margin: 2rem auto;
  padding: 0 1rem }
h1 { font-size: 1.5rem } h2 { font-size: 1.15rem; margin-top: 2.2rem }
svg { max-width: 100%; height: auto } figure { margin: 1rem 0 } figcaption { color: #444 }
table { border-collapse: collapse } .note { background: #fdf3e3; padding: .6rem 1rem }
th, td { text-align: right; padding: .15rem .7rem; border-bottom: 1px solid #ddd }
th:first-child, td:first-child { text-align: left }
.side { display: flex; flex-wrap: wrap; gap: 1rem } .side figure { flex: 1 1 24rem }
"""
ERRORS = (
    *("rotation", "RMSE", "mean |error|", "bias", "95 % below"),
    *("within 1 sd", "noise floor", "its own spread"),
)


def report_page(
    model_id: str, model: CalibrationModel, takes: Sequence[Take], trained_on: Sequence[str]
) -> str:
    """HTML. Raises LayoutMismatch, and BadInput when nothing was measured."""
    found = residuals(model, takes)
    numbers, where = summed_up(found), where_it_fails(found)
    parts = [
        f"<h1>Model {escape(model_id[:12])} against {counted(len(takes), 'take')}</h1>",
        _what(model, takes, trained_on),
        f"<p><strong>{escape(in_one_sentence(numbers, where))}</strong></p>",
        "<h2>How far off, and how far it could be</h2>",
        _figure(errors_and_floors(where), floors_sentence(where)),
        _table(numbers, where),
        "<h2>What the errors depend on</h2>",
        _figure(heat_map(where), heat_sentence(where)),
    ]
    for item in where.rotations[:LOOKED_AT_CLOSELY]:
        parts += [f"<h2>{escape(item.rotation)}</h2>", f"<p>{escape(item.sentence)}</p>"]
        parts.append(_figure(*over_time(found, item.rotation)))
        close = (item.structure or item.dependences)[:2]
        parts.append(
            '<div class="side">' + "".join(_figure(*error_against(item, one)) for one in close) + "</div>"
        )
        if item.wearings is not None:
            parts.append(f"<p>{escape(item.wearings.sentence)}</p>")
    parts += ["<h2>The worst seconds</h2>", _stretches(where)]
    title = f"Glovecal: model {escape(model_id[:12])}"
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body>{''.join(parts)}"
        f"<p>Glovecal {escape(version('glovecal-service'))}.</p></body></html>"
    )


def _figure(picture: str, sentence: str) -> str:
    return f"<figure>{picture}<figcaption>{escape(sentence)}</figcaption></figure>"


def _what(model: CalibrationModel, takes: Sequence[Take], trained_on: Sequence[str]) -> str:
    frames = sum(len(take.time_s) for take in takes)
    names = ", ".join(escape(take.name) for take in takes[:12]) + (" ..." if len(takes) > 12 else "")
    text = (
        f"<p>Method {escape(model.method)}, subject {escape(model.subject)}, "
        f"layout {escape(model.layout.name)}. Takes: {names}; {frames} frames.</p>"
    )
    if any(take.simulated for take in takes):
        text += '<p class="note">At least one of these takes comes from a <b>simulated</b> glove.</p>'
    if trained_on:
        text += (
            f'<p class="note">The model was trained on {len(trained_on)} of these takes: such errors are '
            "smaller than on takes it has not seen.</p>"
        )
    return text


def _table(numbers: Comparison, where: WhereItFails) -> str:
    rows = []
    for item in where.rotations:
        errors = numbers.rotations[item.rotation]
        rows.append((
            item.rotation, f"{errors.rmse_deg:.2f}", f"{errors.mae_deg:.2f}", f"{errors.bias_deg:+.2f}",
            f"{errors.percentile_95_deg:.2f}", f"{100 * errors.coverage:.0f} %", _floor(item),
            f"{errors.baseline_deg:.1f}",
        ))  # fmt: skip
    return f"{_rows(ERRORS, rows)}<p>Degrees.</p>"


def _floor(item: RotationFindings) -> str:
    if item.floor is None:
        return "unknown"
    return f"{'at least ' if item.floor.is_lower_bound else ''}{item.floor.floor_deg:.2f}"


def _stretches(where: WhereItFails) -> str:
    heads = ("take", "when", "pose", "RMSE, degrees", "worst rotation", "its RMSE")
    rows = [
        (
            one.take, f"{one.start_s:.1f} to {one.end_s:.1f} s", one.pose or "-", f"{one.rmse_deg:.1f}",
            one.rotation, f"{one.rotation_rmse_deg:.1f}",
        )
        for one in where.stretches
    ]  # fmt: skip
    return _rows(heads, rows)


def _rows(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"
