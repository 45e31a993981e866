"""What became of a model that was asked to gain or to lose an effect, or to be improved all the way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

from glovecal_models.ceiling.answer import LeftToGain
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.hold_answer import DriftInHolds
from glovecal_models.diagnosis.residual_answer import NextTake, TakePlan, Unexplained, to_record, unplanned
from glovecal_models.effects.base.form_curve import LaneCurves
from glovecal_models.improvement.fall.answer import FallStep, FloorBand, fall_chart
from glovecal_models.presentation.document import (
    Answer,
    Chart,
    Column,
    Explanation,
    Fact,
    Folded,
    Lines,
    Note,
    Presentation,
    Section,
    Table,
    answer,
    counted,
    with_same_reason,
)
from glovecal_models.presentation.drawing import MODEL, QUIET, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHORT = 12
Verdict = Literal["named", "ambiguous", "associated"]
STOPPED = {
    "noise_floor": "The error is at the noise floor.",
    "nothing_named": "No other known effect beats its control significantly.",
    "ambiguous": "These takes cannot tell the remaining effects apart.",
    "not_better": "The next effect does not reduce the held-out error enough and was undone.",
}
MEASURED_HOW = (
    "RMSE in degrees over all rotations, held-out: on takes not trained on, the same for every step."
)
MESSAGES = "Messages of every step; a diagnosis measures on smoothed signals, so its errors differ a little"


@answer
class ClaimCheck:
    """Claimed standard deviations before and after, on held-out takes; expected: coverage 0.68 and 0.95."""

    nlpd_before: float
    """Mean negative log predictive density, nats."""
    coverage_before: float
    """Share of measurements within one claimed standard deviation."""
    coverage_95_before: float
    """Share within 1.96 of them."""
    nlpd_after: float
    coverage_after: float
    coverage_95_after: float
    is_truer: bool = True
    """Whether the density falls by the ``least_fall_nats`` that are needed."""
    least_fall_nats: float = 0.0


@answer
class EffectTried:
    """An effect that was added, or undone again."""

    effect: str
    where: Sequence[str]
    """Rotations."""
    added: bool
    sentence: str
    before: Mapping[str, float | None]
    """Held-out error of each rotation, degrees."""
    after: Mapping[str, float | None]
    """With it."""
    parameters: Mapping[str, Mapping[str, Any]]
    """Learned numbers of each rotation, units in their names."""
    curves: Mapping[str, LaneCurves] = field(default_factory=dict)
    """For each rotation what a learned form adds over its inputs."""
    claim: ClaimCheck | None = None
    """Of an effect that widens the claimed interval."""
    declaration: Mapping[str, Any] | None = None
    """Of an effect of the user's own that was added."""


@answer
class EffectAdded(EffectTried, Answer):
    """Whether an effect stays in a model, and the child that has it."""

    _: KW_ONLY
    model: str | None = None
    """The child; null when the effect was undone."""
    parent: str = ""
    active: bool = False
    title: str = ""
    """The parent as people call it: subject, version and date."""

    def presentation(self) -> Presentation:
        from glovecal_models.effect_block import effect_block

        facts = [Fact("Verdict", self.sentence)]
        if self.model is not None:
            facts.append(Fact("", child_sentence(self.model, self.parent, self.active)))
            facts.append(Fact("Next", f"glovecal diagnose {self.model[:SHORT]}", is_command=True))
        elif self.parent:
            facts.append(Fact("", f"Model {self.parent[:SHORT]} stays as it is; nothing was stored."))
        columns = [
            Column("rotation"), Column("before_rmse_deg", "error before (°)"),
            Column("after_rmse_deg", "after (°)"), Column("learned", folds=True),
        ]  # fmt: skip
        rows = [
            (name, before, self.after.get(name), _numbers(self.parameters.get(name, {})))
            for name, before in self.before.items()
        ]
        chart = Chart(self._draw, 6.0, 1.4 + 0.4 * len(rows), "Held-out RMSE of each rotation, degrees.")
        return Presentation(
            f"Adding {self.effect} to {_named(self.title, self.parent)}",
            facts,
            sections=[
                Section("Errors on held-out takes", [chart, Table(columns, rows)]),
                Section(
                    "The effect",
                    [effect_block(self.effect, self.parameters, self.declaration, self.curves)],
                    is_detail=True,
                ),
            ],
        )

    def _draw(self, axes: Axes) -> None:
        for shift, when, errors, colour in (
            (-0.18, "before", self.before, QUIET),
            (0.18, "after", self.after, MODEL),
        ):
            rows = [row + shift for row in range(len(errors))]
            values = [float("nan") if value is None else value for value in errors.values()]
            axes.barh(rows, values, height=0.34, color=colour, label=f"{when} {self.effect}")
        axes.set_yticks(range(len(self.before)), list(self.before))
        axes.set_ylim(len(self.before) - 0.4, -0.6)
        axes.set_xlabel("held-out error, degrees")
        legend_above(axes)


@answer
class EffectRemoved(Answer):
    """A child of a model, learned without one of its effects."""

    effect: str
    before: float | None
    """Held-out error over all rotations, degrees."""
    after: float | None
    sentence: str = ""
    parent: str = ""
    model: str | None = None
    """The child."""
    active: bool = False
    title: str = ""
    """The parent as people call it."""

    def __post_init__(self) -> None:
        goes = "" if self.before is None else f" from {self.before:.2f}"
        after = "an unknown number of" if self.after is None else f"{self.after:.2f}"
        sentence = f"Without {self.effect} the error on takes left out goes{goes} to {after} degrees."
        object.__setattr__(self, "sentence", sentence)

    def presentation(self) -> Presentation:
        facts = [Fact("Verdict", self.sentence)]
        if self.model is not None:
            facts.append(Fact("", child_sentence(self.model, self.parent, self.active)))
        return Presentation(f"Removing {self.effect} from {_named(self.title, self.parent)}", facts)


@answer
class AddedInStep:
    """The effect that a step of an improvement added."""

    effect: str
    where: Sequence[str]
    confidence_set: Sequence[str]
    """It, and all that the takes could not tell from it."""
    parameters: Mapping[str, Any]
    """Learned numbers, units in their names."""
    claim: ClaimCheck | None = None
    next_take: NextTake | None = None
    """The recording that would tell the confidence set apart."""
    associated_with: str | None = None
    """The column that the residual went along with, where that is why it was added: no cause is claimed."""
    control_share: float | None = None
    """Of the error of its rotations that its control leaves; null where there is none."""
    curves: Mapping[str, LaneCurves] = field(default_factory=dict)
    """For each rotation what a learned form adds over its inputs."""
    verdict: Verdict = "named"

    def __post_init__(self) -> None:
        is_sure = len(self.confidence_set) < 2
        associated = self.associated_with is not None
        verdict = "associated" if associated else "named" if is_sure else "ambiguous"
        object.__setattr__(self, "verdict", verdict)

    @property
    def text(self) -> str:
        """The effect, its rotations, and what may be behind it else."""
        rivals = [name for name in self.confidence_set if name != self.effect]
        doubt = f" (or {', '.join(rivals)})" if rivals else ""
        if self.verdict == "associated":
            doubt = f" (associated with {self.associated_with}; no cause is claimed)"
        return f"{self.effect} on {', '.join(self.where) or 'all takes'}{doubt}"


@answer
class ImprovementStep:
    """One model on the way."""

    model: str | None
    """Its id."""
    added: AddedInStep | None
    """Null: the base alone."""
    rmse_deg: float | None
    """Over all rotations."""
    per_rotation: Mapping[str, float | None]
    control_rmse_deg: float | None = None
    """With the control of the effect instead."""
    rmse_unseen_wearing_deg: float | None = None
    """In a wearing that training did not see; null: one wearing only."""


class OnTheWay(Protocol):
    """A step, whether it is computed or told."""

    @property
    def added(self) -> AddedInStep | None: ...
    @property
    def rmse_deg(self) -> float | None: ...
    @property
    def control_rmse_deg(self) -> float | None: ...


def falls_of(method: str, steps: Sequence[OnTheWay]) -> list[FallStep]:
    """The base by ``method``, and each effect. No control is above the error before: what made it worse would
    have been undone."""
    falls: list[FallStep] = []
    before: float | None = None
    for step in steps:
        label = method if step.added is None else "+ " + step.added.effect.replace("_", "\n", 1)
        control = step.control_rmse_deg
        known = min(control, before) if control is not None and before else None
        before = step.rmse_deg
        falls.append(FallStep(label, before or 0.0, known))
    return falls


@answer
class ImprovedSoFar:
    """What a running improvement has reached."""

    falls: Sequence[FallStep] = ()


@answer
class Improved(Answer):
    """The fall of the error from a base model through every effect that was added."""

    steps: Sequence[ImprovementStep]
    noise_floor_deg: Mapping[str, float | None]
    stopped: str
    """noise_floor, nothing_named, ambiguous or not_better."""
    undone: Sequence[EffectTried]
    next_take: NextTake | None
    sentences: Sequence[str]
    take_plan: TakePlan | None = None
    """Of the last diagnosis: all takes to record so that more can be judged."""
    baselines: Mapping[str, float | None] = field(default_factory=dict)
    """Errors of simpler calibrations, degrees."""
    noise_floor_interval_deg: Mapping[str, Sequence[float | None]] = field(default_factory=dict)
    noise_floors: Mapping[str, NoiseFloor] = field(default_factory=dict)
    """The same with how it was found and how far it can be trusted."""
    hold_drift: DriftInHolds | None = None
    unexplained_residual: Unexplained | None = None
    """Of the last diagnosis."""
    ceiling: LeftToGain | None = None
    """Of the last model; null: not asked for."""
    method: str = ""
    """The base."""
    subject: str = ""
    title: str = ""
    """The last model as people call it."""
    active: bool = False
    """Whether live frames are predicted with the last model."""

    @property
    def to_record(self) -> TakePlan | None:
        """The plan, else that of the one take that decides."""
        return to_record(self.next_take, self.take_plan)

    @property
    def last(self) -> ImprovementStep:
        return self.steps[-1]

    @property
    def band(self) -> FloorBand | None:
        """The noise floor over all rotations that the last step measured; None when that of one is
        unknown."""
        floors, spans = self.noise_floor_deg, self.noise_floor_interval_deg
        known = {}
        for name in self.last.per_rotation:
            floor = floors.get(name)
            if floor is None:
                return None
            low, high = spans.get(name, (floor, floor))
            known[name] = (floor, floor if low is None else low, floor if high is None else high)
        return FloorBand.of(known)

    @property
    def falls(self) -> list[FallStep]:
        """Simpler calibrations, the base, and each effect."""
        scale = sorted(
            ((name, error or 0.0) for name, error in self.baselines.items()), key=lambda one: -one[1]
        )
        return [
            *(FallStep(name, error, is_scale=True) for name, error in scale),
            *falls_of(self.method, self.steps),
        ]

    def presentation(self) -> Presentation:
        from glovecal_models.effect_block import effect_block

        added = [step.added for step in self.steps if step.added is not None]
        held = self.hold_drift
        ids = [(self._label(step), step.model or "-") for step in self.steps]
        log: list[Any] = [
            Folded(MESSAGES, [Lines(self.sentences)]),
            Folded(f"{counted(len(ids), 'model')} by id", [Table([Column("step"), Column("model")], ids)]),
        ]
        doubts = with_same_reason(
            (name, "; ".join(floor.reasons)) for name, floor in self.noise_floors.items() if floor.reasons
        )
        following, plan = unplanned(self.next_take, self.take_plan), self.take_plan
        notes = [Note("", [following.sentence])] if following else []
        return Presentation(
            f"Improvement of {self.title or self.subject}",
            self._summary(),
            [*notes, *([Note("Noise floor not reliable", doubts)] if doubts else [])],
            [
                Section(
                    "How the error falls",
                    [fall_chart(self.falls, self.band), self._steps(), Explanation(MEASURED_HOW)],
                ),
                Section(
                    "Effects added",
                    [effect_block(item.effect, item.parameters, None, item.curves) for item in added],
                    is_detail=True,
                ),
                Section("Each rotation", [self._rotations()], is_detail=True),
                Section("What to record next", [] if plan is None else plan.parts),
                Section(
                    "Readings while a pose is held",
                    [held.sentence, held.presentation().table] if held and held.poses else [],
                    is_detail=True,
                ),
                Section("Details", log if self.sentences else [], is_detail=True),
            ],
        )

    def _summary(self) -> list[Fact]:
        first, last, band = self.steps[0], self.last, self.band
        floor = "" if band is None else f"; noise floor {band.floor_deg:.2f}"
        added = [step.added.effect for step in self.steps if step.added]
        verdict = f"with {', '.join(added)}" if added else "alone; no effect was added"
        size = f"held-out error {_degrees(last.rmse_deg)} degrees{floor}"
        if added:
            fall = f"from {_degrees(first.rmse_deg)} to {_degrees(last.rmse_deg)}"
            size = f"held-out error reduced {fall} degrees{floor}"
        if last.rmse_unseen_wearing_deg is not None:
            unseen = f"{last.rmse_unseen_wearing_deg:.2f} degrees in a wearing not seen"
            size = f"{unseen}; in the wearings seen: {size}"
        facts = [
            Fact("Verdict", f"{self.method} {verdict}. {STOPPED.get(self.stopped, '')}"),
            Fact("Size", size),
        ]
        errors = {name: error for name, error in last.per_rotation.items() if error is not None}
        if errors:
            worst = max(errors, key=lambda name: errors[name])
            facts.append(Fact("Place", f"largest remaining error at {worst}: {errors[worst]:.2f} degrees"))
        floors = ", ".join(f"{name} {_degrees(value)}" for name, value in self.noise_floor_deg.items())
        facts.append(Fact("Noise floors (°)", floors or "unknown"))
        if self.ceiling is not None:
            facts.append(Fact("Ceiling", self.ceiling.sentence))
        if last.model is not None:
            kept = f"The models are kept for subject {self.subject}."
            facts.append(Fact("", f"{kept} The last is active." if self.active else kept))
        return [*facts, Fact("Next", self._next(), is_command=True)]

    def _next(self) -> str:
        model = (self.last.model or "MODEL")[:SHORT]
        if self.next_take is not None:
            return (self.take_plan.steps[0] if self.take_plan else self.next_take).command
        if not self.active:
            return f"glovecal model activate {model}"
        return f"glovecal where {model} --report where-{model}.html"

    def _steps(self) -> Table:
        columns = [
            Column("model"), Column("added", folds=True),
            Column("rmse_unseen_wearing_deg", "next wearing (°)"), Column("rmse_deg", "error (°)"),
            Column("with_control_rmse_deg", "control (°)"),
        ]  # fmt: skip
        rows = [
            (
                (step.model or "-")[:SHORT],
                f"{self.method} alone" if step.added is None else step.added.text,
                step.rmse_unseen_wearing_deg, step.rmse_deg, fall.control_rmse_deg,
            )
            for step, fall in zip(self.steps, falls_of(self.method, self.steps), strict=True)
        ]  # fmt: skip
        return Table(columns, rows)

    def _rotations(self) -> Table:
        columns = [Column("rotation"), *(Column(self._label(step)) for step in self.steps)]
        columns.append(Column("noise_floor_deg", "noise floor"))
        first = self.steps[0].per_rotation
        rows = [
            [name, *(step.per_rotation.get(name) for step in self.steps), self.noise_floor_deg.get(name)]
            for name in sorted(self.last.per_rotation, key=lambda name: -(first.get(name) or 0.0))
        ]
        return Table(columns, rows)

    def _label(self, step: ImprovementStep) -> str:
        return self.method if step.added is None else f"+ {step.added.effect}"


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def child_sentence(model: str, parent: str, active: bool) -> str:
    """Where a new version comes from, and whether live frames are predicted with it."""
    short = model[:SHORT]
    told = "Active." if active else f"Not active; glovecal model activate {short} makes it so."
    return f"Model {short}, made from {parent[:SHORT]}. {told}"


def _named(title: str, model: str) -> str:
    return title or (f"model {model[:SHORT]}" if model else "the model")


def _numbers(values: Mapping[str, Any]) -> str:
    each = [f"{name} {value:.3g}" for name, value in values.items() if isinstance(value, int | float)]
    return ", ".join(each)
