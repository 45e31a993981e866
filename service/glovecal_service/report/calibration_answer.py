"""A calibration on a few pages: what it rests on, how good it is, what it learned, what is left to do.

It gathers what is stored or known of a model elsewhere; every section says how its numbers are meant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import TYPE_CHECKING

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.ceiling.answer import LeftToGain
from glovecal_models.comparison.answer import doubted_floors
from glovecal_models.comparison.floor_estimate import NoiseFloor, interval_text
from glovecal_models.diagnosis.answer import MissingEffects
from glovecal_models.improvement.fall.answer import FloorBand
from glovecal_models.presentation.document import (
    AboutTakes,
    Chart,
    Column,
    Explanation,
    Fact,
    Lines,
    Note,
    Part,
    Presentation,
    Section,
    Table,
    answer,
    counted,
    first_of,
)
from glovecal_models.presentation.drawing import FLOOR, MEASURED, MODEL, legend_above
from glovecal_service.report.coverage import CoveredRange, coverage_parts

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHORT = 12
RESTS_ON = (
    "A take is one continuous recording with measured angles; a wearing lasts from putting the glove on to "
    "taking it off."
)
HOW_ERRORS = (
    "Each error is the root mean square of predicted minus measured angles, in degrees, on takes that were "
    "left out of the fit in turn, so the model never saw what it is judged on. Two scales stand beside it. "
    "The noise floor is how small the error can get on these measurements at all; linear and raw are simpler "
    "calibrations of the same takes, left out in the same way: a straight line, and readings that are only "
    "scaled to the joint's active range."
)
HOW_EFFECTS = (
    "An effect is a physical cause that was found in the errors. It was kept because the held-out error fell "
    "by more than with its control, which is as flexible and physically impossible; one that widens the "
    "claimed interval, because the claim became truer: its mean negative log predictive density (NLPD) fell."
)
HOW_CHECKED = (
    "In a quick check a few poses are held in a new wearing. As found: their error before the check. As "
    "left: after it, each pose predicted from the others."
)


@answer
class ReportedTake:
    """A take that the model was trained on."""

    name: str
    id: str
    wearing: str
    duration_s: float
    rotations: int
    """How many were measured."""
    made_at: datetime | None


@answer
class ReportedRotation:
    """Errors of one rotation, RMSE in degrees."""

    rotation: str
    sensors: Sequence[str]
    """What it is read from; empty: it follows from other rotations by rule."""
    held_out_rmse_deg: float | None
    linear_rmse_deg: float | None
    raw_rmse_deg: float | None
    floor: NoiseFloor | None
    """How small an error can get on these takes; null: too little was measured."""


@answer
class PastCheck:
    """A quick check of the subject's glove."""

    made_at: datetime
    wearing: str | None
    as_found_deg: float | None
    as_left_deg: float | None
    model: str
    """The version that came of it."""


@answer
class ToRecord:
    """A pose or motion that would teach the model most for its time."""

    name: str
    ask: str
    seconds: float
    error_fall_deg: float
    """By how much the expected error of a frame falls."""


@answer
class CalibrationReport(AboutTakes):
    """What one model rests on, how good it is, and what is left to do."""

    made_at: datetime
    how_held_out: str
    """Such as "whole takes left out"; "not estimated"."""
    errors_deg: Mapping[str, float | None]
    """RMSE over all rotations: of the model, `linear` and `raw`."""
    rotations: Sequence[ReportedRotation]
    wearing_sentences: Sequence[str]
    """On the error in a wearing not seen."""
    trained_on: Sequence[ReportedTake]
    takes_gone: int
    """Training takes that are no longer stored: floors, simpler calibrations and ranges do not know them."""
    sentences: Sequence[str]
    """What was said when it was made."""
    effects: Sequence[ModelEffect]
    covered_angles: Sequence[CoveredRange]
    covered_readings: Sequence[CoveredRange]
    diagnosis: MissingEffects | None
    """The newest; null: the model was not diagnosed yet."""
    ceiling: LeftToGain | None
    """Null: not asked for."""
    to_record: Sequence[ToRecord]
    advice: Sequence[str]
    """On what to record next."""
    checks: Sequence[PastCheck]
    """Oldest first."""
    check_sentences: Sequence[str]
    is_active: bool

    def presentation(self) -> Presentation:
        simulated = [Note("", ["At least one of these takes comes from a simulated glove."])] * self.simulated
        return Presentation(
            f"Calibration of {self.title}",
            self._summary(),
            simulated,
            [
                Section("What it rests on", self._rests_on()),
                Section("Held-out errors", self._errors()),
                Section("Effects and their evidence", self._effects()),
                Section("Coverage", coverage_parts(self.covered_angles, self.covered_readings)),
                Section("What remains", self._remains()),
                Section("Next time", self._next()),
                Section("Quick checks", self._checks()),
            ],
        )

    @property
    def next_command(self) -> str:
        model = (self.model or "")[:SHORT]
        return f"glovecal diagnose {model}" if self.diagnosis is None else self.diagnosis.next_command

    def _summary(self) -> list[Fact]:
        wearings = len({item.wearing for item in self.trained_on})
        minutes = sum(item.duration_s for item in self.trained_on) / 60
        rests = (
            f"{counted(len(self.trained_on), 'take')} in {counted(wearings, 'wearing')}, {minutes:.1f} min"
        )
        own = f"{self.model or ''} ({self.method}); made {self.made_at:%Y-%m-%d %H:%M} UTC"
        effects = list(dict.fromkeys(item.effect for item in self.effects))
        known = self.diagnosis
        diagnosed = "Not asked for yet." if known is None else known.presentation().summary[0].text
        return [
            Fact("Verdict", self._verdict()),
            *(Fact("Wearings" if not at else "", item) for at, item in enumerate(self.wearing_sentences)),
            Fact("Rests on", f"{rests}." if self.trained_on else "Takes that are not stored here."),
            Fact("Effects", first_of(effects) or "None was added."),
            Fact("Diagnosis", diagnosed),
            Fact("Model", f"{own}. {'It predicts live.' if self.is_active else 'It does not predict live.'}"),
            Fact("Next", self.next_command, is_command=True),
        ]

    def _verdict(self) -> str:
        error = self.errors_deg.get("model")
        if error is None:
            return "The error is unknown: the model was trained without leaving takes out."
        scale = [f"{name} {value:.2f}" for name in ("linear", "raw") if (value := self.errors_deg.get(name))]
        if self.floor is not None:
            scale.append(f"noise floor {self.floor.floor_deg:.2f}")
        brackets = f" ({', '.join(scale)})" if scale else ""
        return f"Held-out error {error:.2f} degrees over {counted(len(self._judged), 'rotation')}{brackets}."

    @property
    def floor(self) -> FloorBand | None:
        """Over all rotations; None when that of one is unknown."""
        floors = {item.rotation: item.floor for item in self._judged}
        known = {name: (one.floor_deg, one.low_deg, one.high_deg) for name, one in floors.items() if one}
        return FloorBand.of(known) if len(known) == len(floors) else None

    @property
    def _judged(self) -> list[ReportedRotation]:
        return [item for item in self.rotations if item.held_out_rmse_deg is not None]

    def _rests_on(self) -> list[Part]:
        columns = [
            Column("take", folds=True), Column("wearing"), Column("recorded"),
            Column("duration_s", "seconds", 1), Column("rotations", "rotations measured"),
        ]  # fmt: skip
        rows = [
            (
                item.name, item.wearing, None if item.made_at is None else f"{item.made_at:%Y-%m-%d %H:%M}",
                item.duration_s, item.rotations,
            )
            for item in self.trained_on
        ]  # fmt: skip
        gone = [f"{counted(self.takes_gone, 'take')} that it was trained on: no longer stored."]
        sentences = [*gone * bool(self.takes_gone), *self.sentences]
        return [
            Explanation(RESTS_ON),
            Table(columns, rows, "Times are UTC.", "None of its takes is stored here."),
            *([Lines(sentences)] if sentences else []),
        ]

    def _errors(self) -> list[Part]:
        if not self._judged:
            return ["No take was left out of this training, so its error is unknown. Train again with folds."]
        columns = [
            Column("rotation"), Column("held_out_rmse_deg", "error"), Column("floor", "noise floor"),
            Column("linear_rmse_deg", "linear"), Column("raw_rmse_deg", "raw"),
            Column("sensors", "read from", folds=True),
        ]  # fmt: skip
        rows = [
            (
                item.rotation, item.held_out_rmse_deg, interval_text(item.floor), item.linear_rmse_deg,
                item.raw_rmse_deg, ", ".join(item.sensors) or "other rotations",
            )
            for item in self.rotations
        ]  # fmt: skip
        overall = self.errors_deg
        band = None if self.floor is None else f"{self.floor.low_deg:.2f}-{self.floor.high_deg:.2f}"
        first = ("all", overall.get("model"), band, overall.get("linear"), overall.get("raw"), "")
        doubts = doubted_floors({item.rotation: item.floor for item in self.rotations})
        doubted = [f"Noise floor not reliable ({names}): {why}." for names, why in doubts]
        legend = (
            f"Degrees; {self.how_held_out}. Noise floor: 95 % interval (>: a lower bound; ?: not reliable)."
        )
        return [
            Explanation(HOW_ERRORS), self._errors_chart(), Table(columns, [first, *rows], legend),
            *([Lines(doubted)] if doubted else []),
        ]  # fmt: skip

    def _errors_chart(self) -> Chart:
        shown = sorted(self._judged, key=lambda item: -(item.held_out_rmse_deg or 0.0))
        worst = shown[0]

        def draw(axes: Axes) -> None:
            errors = [item.held_out_rmse_deg or 0.0 for item in shown]
            axes.barh(range(len(shown)), errors, color=MODEL, label="this model")
            marks = {"linestyle": "", "markersize": 6, "color": MEASURED, "fillstyle": "none"}
            for name, marker, values in (
                ("linear", "o", [item.linear_rmse_deg for item in shown]),
                ("raw", "s", [item.raw_rmse_deg for item in shown]),
            ):
                known = [(value, at) for at, value in enumerate(values) if value is not None]
                if known:
                    axes.plot(*zip(*known, strict=True), marker=marker, label=name, **marks)
            floors = [(item.floor, at) for at, item in enumerate(shown) if item.floor is not None]
            for number, (floor, at) in enumerate(floors):
                axes.plot([floor.low_deg, floor.high_deg], [at, at], color=FLOOR, linewidth=2)
                axes.plot(
                    floor.floor_deg, at, "|", color=FLOOR, markersize=11, markeredgewidth=2.5,
                    label="noise floor" if number == 0 else "",
                )  # fmt: skip
            axes.set_yticks(range(len(shown)), [item.rotation for item in shown])
            axes.set_ylim(len(shown) - 0.4, -0.6)
            axes.set(xlabel="held-out error, degrees", xlim=(0.0, None))
            legend_above(axes, 4)

        sentence = (
            f"The largest error is that of {worst.rotation}: {worst.held_out_rmse_deg:.2f} degrees. Orange: "
            "noise floor with its 95 % interval."
        )
        return Chart(draw, 7, 1.4 + 0.24 * len(shown), sentence)

    def _effects(self) -> list[Part]:
        from glovecal_models.effect_block import effect_block  # draws what is simulated

        if not self.effects:
            return ["No effect was added: the model is its base alone."]
        columns = [
            Column("effect"), Column("rotations", folds=True), Column("rmse_before_deg", "error without it"),
            Column("rmse_after_deg", "with it"), Column("rmse_control_deg", "with its control"),
            Column("nlpd_before", "NLPD without it"), Column("nlpd_after", "with it"),
        ]  # fmt: skip
        rows = [
            (
                item.effect,
                ", ".join(item.rotations) or "all",
                *(_number(item.evidence, column.name) for column in columns[2:]),
            )
            for item in self.effects
        ]
        if all(row[-1] is None for row in rows):
            columns, rows = columns[:-2], [row[:-2] for row in rows]
        legend = "Held-out RMSE of its rotations when it was added, in degrees; NLPD in nats; -: not told."
        blocks = [
            effect_block(item.effect, item.parameters, item.declaration, item.curves) for item in self.effects
        ]
        return [Explanation(HOW_EFFECTS), Table(columns, rows, legend), *blocks]

    def _remains(self) -> list[Part]:
        parts: list[Part] = []
        if self.diagnosis is None:
            model = (self.model or "")[:SHORT]
            parts.append(f"Not looked for yet. To find which effect is missing: glovecal diagnose {model}")
        else:
            parts += [f"{item.label}: {item.text}" for item in self.diagnosis.presentation().summary[:3]]
            parts += self.diagnosis.unexplained_parts
        return [*parts, *([] if self.ceiling is None else [self.ceiling.sentence])]

    def _next(self) -> list[Part]:
        asked = [] if self.diagnosis is None else self.diagnosis.of_the_recording
        following = None if self.diagnosis is None else self.diagnosis.next_take
        sentences = [*([] if following is None else [following.sentence]), *self.advice]
        columns = [
            Column("step"), Column("ask", "what to do", folds=True), Column("seconds", "seconds", 1),
            Column("error_fall_deg", "expected fall of the error", 3),
        ]  # fmt: skip
        rows = [(item.name, item.ask, item.seconds, item.error_fall_deg) for item in self.to_record]
        table = [Table(columns, rows, "What teaches most for its time first; degrees.")] if rows else []
        return [
            *asked,
            *([Lines(sentences)] if sentences else []),
            *table,
            f"On the command line: {self.next_command}",
        ]

    def _checks(self) -> list[Part]:
        columns = [
            Column("made"), Column("wearing", folds=True), Column("as_found_deg", "as found (°)"),
            Column("as_left_deg", "as left (°)"), Column("model"),
        ]  # fmt: skip
        rows = [
            (
                f"{item.made_at:%Y-%m-%d %H:%M}",
                item.wearing,
                item.as_found_deg,
                item.as_left_deg,
                item.model[:SHORT],
            )
            for item in self.checks
        ]
        empty = "No wearing was checked yet. Hold three to five poses each time the glove is put on."
        sentences = [Lines(self.check_sentences)] if self.check_sentences else []
        return [
            Explanation(HOW_CHECKED),
            Table(columns, rows, "Times are UTC." * bool(rows), empty),
            *sentences,
        ]


def _number(evidence: Mapping[str, object], name: str) -> float | None:
    value = evidence.get(name)
    return float(value) if isinstance(value, int | float) else None
