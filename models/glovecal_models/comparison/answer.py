"""A model against measurements: errors beside noise floors, in degrees and, of fingertips, in mm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import TYPE_CHECKING, Any

import numpy as np

from glovecal_models.ceiling.answer import LeftToGain
from glovecal_models.comparison.delay_answer import DelayedError, draw_delay_curves
from glovecal_models.comparison.fingertip_answer import ALL, Bar, FingertipErrors, draw_errors
from glovecal_models.comparison.floor_estimate import NoiseFloor, interval_text
from glovecal_models.presentation.document import (
    AboutTakes,
    Answer,
    Cell,
    Chart,
    Column,
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
from glovecal_models.presentation.drawing import FLOOR, QUIET, SEVERAL, legend_above
from glovecal_models.takes.camera_estimates import CoveredRange

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FLOOR_MEANS = (
    "95 % interval of the noise floor, how small the RMSE can get on these takes (>: a lower bound; ?: not "
    "reliable)"
)
SCALES = (
    f"Degrees. floor: {FLOOR_MEANS}; mean: of |error|; 95 %: of frames are below; in sd: share of errors "
    "within the claimed standard deviation, expected: 0.68; NLPD: mean negative log predictive density in "
    "nats, expected: ln(RMSE) + 1.42 for a correct standard deviation of constant size; spread: error when "
    "predicting the mean."
)
SIDE_BY_SIDE = f"floor: {FLOOR_MEANS}, the smallest of these models; spread: error when predicting the mean."
EACH_POSE = "Each pose"
MARKERS = "osD^vP*X"


@answer
class RotationErrors:
    """Errors (predicted minus measured) of one rotation, or of all together, in degrees."""

    count: int
    rmse_deg: float
    mae_deg: float
    bias_deg: float
    percentile_95_deg: float
    """95 % of the absolute errors are at or below this."""
    coverage: float
    """Share of errors within one claimed standard deviation; expected: 0.68."""
    nlpd: float | None
    """Mean negative log predictive density, nats: the mean of ln(sd sqrt(2 pi)) + 1/2 (error / sd)^2.

    Smaller is better. A constant standard deviation that is as large as the RMSE has ln(RMSE) + 1.42;
    predicting the mean has ln(baseline) + 1.42. Null where a claimed standard deviation is 0 or missing.
    """
    baseline_deg: float
    """Error when predicting the mean of the measurements."""
    floor: NoiseFloor | None
    """How small the RMSE can get; null: too little was measured."""


@answer
class PoseErrors:
    """Mean and standard deviation of the absolute error over all rotations in one pose (paper, Table 3)."""

    pose: str
    count: int
    mean_deg: float
    sd_deg: float


@answer
class OnSeenTakes(AboutTakes):
    """About a model on takes, of which it may have been trained on some."""

    _: KW_ONLY
    trained_on: Sequence[str] = ()
    """Takes among those given that the model was trained on."""
    ceiling: LeftToGain | None = None
    """On the takes it was asked for; null: not asked for yet."""

    @property
    def name(self) -> str:
        """Short enough for a legend: "lmc_gpr 1f3a5c"."""
        return f"{self.method or 'model'} {(self.model or '')[:6]}".strip()

    @property
    def seen(self) -> list[str]:
        """A warning where this is no held-out error."""
        names = [take.name for take in self.takes if take.id in self.trained_on]
        return [f"{self.name} was trained on {len(names)} of these takes ({first_of(names)})"] * bool(names)

    @property
    def known_ceiling(self) -> list[Fact]:
        return [] if self.ceiling is None else [Fact("Ceiling", self.ceiling.sentence)]

    @property
    def takes_named(self) -> Fact:
        return Fact("Takes", first_of([item.name for item in self.takes]))


def seen_note(found: Sequence[OnSeenTakes]) -> list[Note]:
    """Which of the models have seen takes before."""
    seen = [sentence for one in found for sentence in one.seen]
    return [Note("", [f"Careful, not a held-out error: {'; '.join(seen)}."])] if seen else []


@answer
class Comparison(OnSeenTakes):
    """Errors of a model, predicted minus measured, beside the noise floor of the measurements."""

    overall: RotationErrors
    rotations: Mapping[str, RotationErrors]
    poses: Sequence[PoseErrors]
    not_measured: Sequence[str]
    """Rotations of the model that no take measured."""
    not_predicted: Sequence[str]
    """Rotations the takes measured that the model does not predict."""
    fingertips: FingertipErrors | None
    """Null where no finger's chain was predicted and measured."""
    unseen_wearing: RotationErrors | None = None
    """Overall, in wearings that the model has not seen; null: there are none, or the model does not say."""
    seen_wearing: RotationErrors | None = None
    """Overall, in wearings that it knows."""
    unseen_wearings: Sequence[str] = ()
    seen_wearings: Sequence[str] = ()
    excluded: Mapping[str, int] = field(default_factory=dict)
    """Measured frames, by rotation, that are not compared: faulty sensors, repeated frames."""
    camera_ranges: Sequence[CoveredRange] = ()
    """Of rotations that a camera measured: angles outside of these ranges were not compared."""
    live: RotationErrors | None = None
    """Overall of live angles, where all else is of angles estimated offline; null: all is of live ones."""
    delayed: Sequence[DelayedError] = ()
    """Overall, of angles that wait for the frames after them, beside offline ones."""
    rmse_unseen_wearing_deg: float | None = None
    """Of the takes whose wearing the model has not seen; null: there are none, or unknown."""
    sentences: Sequence[str] = ()
    """Errors in wearings not seen and seen; what a camera accounts for."""

    def __post_init__(self) -> None:
        unseen = self.unseen_wearing
        object.__setattr__(self, "rmse_unseen_wearing_deg", None if unseen is None else unseen.rmse_deg)
        object.__setattr__(
            self, "sentences", [*self._of_offline(), *self._of_wearings(), *self._of_a_camera()]
        )

    def _of_offline(self) -> list[str]:
        """What both directions of time save."""
        if self.live is None:
            return []
        return [
            f"Estimated offline, with both directions of time: {self.overall.rmse_deg:.2f} degrees, "
            f"live {self.live.rmse_deg:.2f}{self._with_delays()}."
        ]

    def _with_delays(self) -> str:
        """Empty for an answer from before they were told."""
        each = ", ".join(f"{item.delay_ms} ms {item.rmse_deg:.2f}" for item in self.delayed)
        return f"; with a delay of {each}" if each else ""

    def _of_wearings(self) -> list[str]:
        """The error in wearings not seen in training, then in those seen."""
        parts = (
            ("In wearings not seen", self.unseen_wearing, self.unseen_wearings),
            ("In the wearings seen", self.seen_wearing, self.seen_wearings),
        )
        return [
            f"{where}: {errors.rmse_deg:.2f} degrees ({counted(len(names), 'wearing')}; "
            f"{100 * errors.coverage:.0f} % of errors within one claimed SD, expected: 68 %)."
            for where, errors, names in parts
            if errors is not None
        ]

    def _of_a_camera(self) -> list[str]:
        """How much of the error a reference accounts for that states deviations, and which angles it saw."""
        errors = {"all rotations together": self.overall, **self.rotations}
        accounted = [
            f"{name}: the camera accounts for {min(floor.reference_deg, item.rmse_deg):.1f} of these "
            f"{item.rmse_deg:.1f} degrees (its stated deviation, RMS)."
            for name, item in errors.items()
            if (floor := item.floor) is not None and floor.reference_deg is not None
        ]
        return [*accounted, *(item.sentence for item in self.camera_ranges)]

    @property
    def rmse_deg(self) -> float:
        """Over all rotations and frames, degrees."""
        return self.overall.rmse_deg

    @property
    def noise_floor_deg(self) -> float | None:
        """How small the error can get on these measurements, degrees; None where it is unknown."""
        return None if self.overall.floor is None else self.overall.floor.floor_deg

    @property
    def per_rotation_deg(self) -> dict[str, float]:
        """RMSE of each measured rotation, degrees."""
        return {name: errors.rmse_deg for name, errors in self.rotations.items()}

    @property
    def coverage(self) -> float:
        """Share of measurements within one claimed standard deviation; 0.68 is expected."""
        return self.overall.coverage

    @property
    def fingertip_rmse_mm(self) -> float | None:
        """How far the fingertips are off, mm; None where no finger was predicted and measured as a whole."""
        return None if self.fingertips is None else self.fingertips.overall.rmse_mm

    def to_frame(self) -> Any:
        """A row for each rotation and one for all of them, as a pandas DataFrame, numbers unrounded. Raises
        ImportError without pandas."""
        columns = (
            "rotation", "frames", "rmse_deg", "noise_floor_deg", "noise_floor_low_deg",
            "noise_floor_high_deg", "bias_deg", "mae_deg", "percentile_95_deg", "coverage_1_sd",
            "predicting_the_mean_deg",
        )  # fmt: skip
        rows: list[Sequence[Cell]] = []
        for name, one in (*self.rotations.items(), ("all rotations", self.overall)):
            floor = one.floor
            floors = (None,) * 3 if floor is None else (floor.floor_deg, floor.low_deg, floor.high_deg)
            errors = one.bias_deg, one.mae_deg, one.percentile_95_deg, one.coverage, one.baseline_deg
            rows.append((name, one.count, one.rmse_deg, *floors, *errors))
        return Table([Column(name) for name in columns], rows).frame()

    def errors_of(self, rotation: str) -> RotationErrors | None:
        return self.overall if rotation == ALL else self.rotations.get(rotation)

    @property
    def facts(self) -> list[Fact]:
        """Size, claims and wearings."""
        overall, wearings = self.overall, self._of_wearings()
        floor = "" if overall.floor is None else f"; noise floor {overall.floor.long_text}"
        size = (
            f"RMSE {overall.rmse_deg:.2f} degrees over {counted(len(self.rotations), 'rotation')}{floor}; "
            f"error when predicting the mean: {overall.baseline_deg:.1f}."
        )
        claimed = f"{100 * overall.coverage:.0f} % of errors within one claimed SD (expected: 68 %)"
        return [
            Fact("Size", size),
            *(Fact("Offline", sentence) for sentence in self._of_offline()),
            Fact("Wearings", " ".join(wearings)) if wearings else Fact("Claimed SD", claimed),
        ]

    def presentation(self) -> Presentation:
        model = [] if self.model is None else [Fact("Next", f"glovecal where {self.model[:12]}", True)]
        return Presentation(
            f"Errors on {self.about}",
            [*self.facts, *self.known_ceiling, self.takes_named, *model],
            seen_note([self]),
            self.sections,
        )

    @property
    def sections(self) -> list[Section]:
        camera, tips = self._of_a_camera(), self.fingertips
        floors = {name: one.floor for name, one in self.rotations.items()}
        doubts = [f"Noise floor not reliable ({names}): {why}." for names, why in doubted_floors(floors)]
        of_tips: list[Part] = []
        if tips is not None:
            own = f"glovecal subject measure {self.subject} --hand-length-mm LENGTH"
            own_hand = [f"For {self.subject}'s own hand: {own}"] * (tips.is_assumed and bool(self.subject))
            of_tips = [tips.sentence, *own_hand, tips.chart(), tips.table()]
        below = [*doubts, *self.excluded_sentences]
        return [
            Section("Error and noise floor", [*_lines(camera), self._chart(), self._table(), *_lines(below)]),
            Section("What a delay would buy", self._delay_chart()),
            Section("Fingertips", of_tips),
            Section(EACH_POSE, [pose_table(self.poses)] if self.poses else [], is_detail=True),
        ]

    def _delay_chart(self) -> list[Part]:
        """From live poses over those of a glove that is served with a delay to offline."""
        if self.live is None or not self.delayed:
            return []
        errors = [self.live.rmse_deg, *(item.rmse_deg for item in self.delayed), self.overall.rmse_deg]
        sentence = (
            f"{self.live.rmse_deg:.2f} degrees live, {self.overall.rmse_deg:.2f} when all frames are known. "
            "To serve a glove with a delay: glovecal glove delay GLOVE 100"
        )
        return [
            Chart(
                lambda axes: draw_delay_curves(axes, {"": errors}, "error (RMSE), degrees"), 7, 2.8, sentence
            )
        ]

    @property
    def excluded_sentences(self) -> list[str]:
        """What was not compared, and why."""
        frames = ", ".join(f"{count} frames of {rotation}" for rotation, count in self.excluded.items())
        said = [f"Not compared, because the sensor failed or frames were repeated: {frames}."] * bool(frames)
        if self.not_measured:
            said.append(f"Not measured in these takes: {', '.join(self.not_measured)}.")
        if self.not_predicted:
            said.append(f"Not predicted by this model: {', '.join(self.not_predicted)}.")
        return said

    def _table(self) -> Table:
        columns = [
            Column("rotation"), Column("rmse_deg", "RMSE"), Column("floor"), Column("mae_deg", "mean"),
            Column("bias_deg", "bias"), Column("percentile_95_deg", "95 %"), Column("coverage", "in sd"),
            Column("nlpd", "NLPD"), Column("baseline_deg", "spread"), Column("count", "frames"),
        ]  # fmt: skip
        rows = [
            (
                name, one.rmse_deg, interval_text(one.floor), one.mae_deg, one.bias_deg,
                one.percentile_95_deg, one.coverage, one.nlpd, one.baseline_deg, one.count,
            )
            for name, one in ((ALL, self.overall), *self.rotations.items())
        ]  # fmt: skip
        return Table(columns, rows, legend=SCALES)

    def _chart(self) -> Chart:
        bars = [
            Bar(name, one.rmse_deg, None if one.floor is None else one.floor.ends)
            for name, one in self.rotations.items()
        ]
        worst = max(self.rotations, key=lambda name: self.rotations[name].rmse_deg)
        sentence = f"The largest error is that of {worst}: {self.rotations[worst].rmse_deg:.2f} degrees."
        return Chart(
            lambda axes: draw_errors(axes, bars, "error, degrees"), 9, 1.5 + 0.24 * len(bars), sentence
        )


@answer
class SideBySide(Answer):
    """Models on the same takes."""

    models: Sequence[Comparison]

    def presentation(self) -> Presentation:
        first = self.models[0]
        facts = [Fact("Verdict", self._sentence())]
        for one in self.models:
            said = [*one.sentences, *([] if one.ceiling is None else [one.ceiling.sentence])]
            facts += [Fact("", f"{one.name}: {sentence}") for sentence in said]
            facts += [Fact("", f"{one.name}: {sentence}") for sentence in one.excluded_sentences]
        poses = [
            Section(f"{EACH_POSE}, {one.name}", [pose_table(one.poses)] if one.poses else [], is_detail=True)
            for one in self.models
        ]
        errors = Section("Errors", [self.chart(), self._table()])
        title = f"Against {first_of([take.name for take in first.takes])}"
        return Presentation(
            title, facts, seen_note(self.models), [errors, Section("Fingertips", self._tips()), *poses]
        )

    def _table(self) -> Table:
        columns = [Column("rotation", "RMSE (deg)"), *(Column(one.name) for one in self.models)]
        rows: list[list[Cell]] = []
        for name in self._rotations:
            errors = [one.errors_of(name) for one in self.models]
            spread = next(one.baseline_deg for one in errors if one is not None)
            rmse = [None if one is None else one.rmse_deg for one in errors]
            rows.append([name, *rmse, interval_text(self.smallest_floor(name)), spread])
        return Table([*columns, Column("floor"), Column("spread")], rows, legend=SIDE_BY_SIDE)

    def _tips(self) -> list[Part]:
        """RMSE, a row a finger, between the smallest of their floors and no model at all."""
        each = [{} if one.fingertips is None else one.fingertips.rows for one in self.models]
        rows: list[list[Cell]] = []
        for finger in dict.fromkeys(finger for one in each for finger in one):
            known = [one[finger] for one in each if finger in one]
            floors = [one.floor for one in known if one.floor is not None]
            least = min(floors, key=lambda one: (one.is_lower_bound, one.floor_mm), default=None)
            rmse = [one[finger].rmse_mm if finger in one else None for one in each]
            rows.append([finger, *rmse, None if least is None else least.text, known[0].baseline_mm])
        columns = [Column("finger", "fingertip RMSE (mm)"), *(Column(one.name) for one in self.models)]
        return [Table([*columns, Column("floor"), Column("spread")], rows)] if rows else []

    @property
    def _rotations(self) -> list[str]:
        return list(dict.fromkeys([ALL, *(name for one in self.models for name in one.rotations)]))

    def smallest_floor(self, rotation: str) -> NoiseFloor | None:
        """Of the models' own floors, since a model that jitters more has a higher one; lower bounds come
        last."""
        every = [one.errors_of(rotation) for one in self.models]
        floors = [one.floor for one in every if one is not None and one.floor is not None]
        return min(floors, key=lambda floor: (floor.is_lower_bound, floor.floor_deg), default=None)

    def chart(self) -> Chart:
        """One row a rotation, the largest error first."""
        rows = sorted(self._rotations[1:], key=lambda name: max(_rmse(one, name) for one in self.models))
        return Chart(
            lambda axes: self._draw(axes, [*rows, ALL]), 9, 1.6 + 0.26 * (len(rows) + 1), self._sentence()
        )

    def _draw(self, axes: Axes, rows: Sequence[str]) -> None:
        for place, rotation in enumerate(rows):
            floor = self.smallest_floor(rotation)
            if floor is not None:
                label = "noise floor, 95 % interval" if rotation == ALL else None
                axes.barh(
                    place, floor.high_deg - floor.low_deg, left=floor.low_deg, height=0.7, color=FLOOR,
                    alpha=0.45, label=label,
                )  # fmt: skip
        for number, one in enumerate(self.models):
            known = [(errors.rmse_deg, at) for at, name in enumerate(rows) if (errors := one.errors_of(name))]
            axes.plot(
                *zip(*known, strict=True), MARKERS[number % len(MARKERS)],
                color=SEVERAL[number % len(SEVERAL)], linestyle="", label=one.name,
            )  # fmt: skip
        axes.set_yticks(range(len(rows)), rows)
        axes.grid(axis="y", color=QUIET, alpha=0.4, linewidth=0.8)
        axes.set_axisbelow(True)
        axes.set(xlabel="error (RMSE), degrees", xlim=(0, None))
        legend_above(axes)

    def _sentence(self) -> str:
        first, *others = sorted(self.models, key=lambda one: one.rmse_deg)
        rotations = self._rotations[1:]
        best = sum(min(self.models, key=lambda one: _rmse(one, name, np.inf)) is first for name in rotations)
        floor = self.smallest_floor(ALL)
        rest = ", ".join(f"{one.rmse_deg:.2f} for {one.name}" for one in others)
        least = "at least " if floor is not None and floor.is_lower_bound else ""
        beside = f"; smallest noise floor: {least}{floor.floor_deg:.2f}" if floor is not None else ""
        return (
            f"{first.name} has the smallest error, {first.rmse_deg:.2f} degrees over all rotations "
            f"({rest}){beside}. It is best in {best} of {len(rotations)} rotations."
        )


def _rmse(one: Comparison, rotation: str, unknown: float = 0.0) -> float:
    errors = one.errors_of(rotation)
    return unknown if errors is None else errors.rmse_deg


def pose_table(poses: Sequence[PoseErrors]) -> Table:
    columns = [
        Column("pose"), Column("mean_deg", "mean |error|"), Column("sd_deg", "sd"), Column("count", "angles"),
    ]  # fmt: skip
    rows = [(one.pose, one.mean_deg, one.sd_deg, one.count) for one in poses]
    return Table(columns, rows)


def doubted_floors(floors: Mapping[str, NoiseFloor | None]) -> list[tuple[str, str]]:
    """Names and reasons of floors that are not reliable; those with the same reasons together."""
    by_reasons: dict[str, list[str]] = {}
    for name, floor in floors.items():
        if floor is not None and floor.reasons:
            by_reasons.setdefault("; ".join(floor.reasons), []).append(name)
    return [(", ".join(names), why) for why, names in by_reasons.items()]


def _lines(sentences: Sequence[str]) -> list[Part]:
    return [Lines(sentences)] if sentences else []
