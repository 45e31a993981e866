"""Which physical effects a model lacks, how sure that is, and what to do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from glovecal_models.calibration.answer import ModelEffect
from glovecal_models.ceiling.answer import LeftToGain
from glovecal_models.comparison.answer import doubted_floors
from glovecal_models.comparison.floor_estimate import NoiseFloor
from glovecal_models.diagnosis.hold_answer import DriftInHolds
from glovecal_models.diagnosis.residual_answer import (
    FREE_MOTION,
    NextTake,
    Remedy,
    TakePlan,
    Unexplained,
    to_record,
    unplanned,
)
from glovecal_models.diagnosis.trial.answer import Candidate, tried_parts
from glovecal_models.effects.base.findings import Stretch
from glovecal_models.presentation.document import (
    AboutTakes,
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
    with_same_reason,
)
from glovecal_models.presentation.drawing import FLOOR, MODEL, legend_above
from glovecal_models.takes.camera_estimates import CoveredRange

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Verdict = Literal["named", "ambiguous", "associated"]
"""Of an effect: the only one that explains the error, one of several that may, or one that was tried because
the residual goes along with a recorded column: no cause is claimed."""
SHORT = 12
LONG_ENOUGH_S = 60
"""Of movement, to tell an unexplained residual from noise."""
DECIDED = "Rules that decided"
NOTHING_NAMED = "No known effect beats its control significantly."
ASKED_FOR = (
    "Held-out RMSE of the rotation's sensor in degrees: without the effect, with it in the form that the "
    "takes ask for, with its control of the same form. An effect column:NAME or context:NAME only names what "
    "the error goes along with; no cause is claimed. A method is named where the layout gives the rotation "
    "the column and a straight line cannot use it: nonlinearity of the base."
)


@answer
class RotationError:
    rmse_deg: float | None
    noise_floor_deg: float | None = None
    floor: NoiseFloor | None = None
    """Of errors that are not smoothed, as `compare` tells it of the same takes."""


@answer
class NamedEffect:
    """The effect that a diagnosis names first."""

    effect: str
    where: tuple[str, ...]
    """Rotations; sensors or takes where it is a fault of those."""
    kind: str | None
    """As in the catalogue; finding: nothing to add, to be put right at the glove; null: named by drift in
    held poses, of which `where` are the sensors."""
    confidence_set: tuple[str, ...]
    """It, and all that these takes cannot tell from it."""
    parameters: Mapping[str, Any]
    """Learned numbers, units in their names; of each rotation where it was compared."""
    saved_deg: float | None = None
    """Saved of the smoothed held-out error; null: found by its signature."""
    control_saved_deg: float | None = None
    """The same of its control."""
    method: str | None = None
    """To be trained with: its base learns the effect by itself, a straight line cannot."""
    sentence: str = ""
    verdict: Verdict = "named"

    @property
    def rivals(self) -> list[str]:
        return [name for name in self.confidence_set if name != self.effect]


@answer
class NotShown:
    """An effect that these takes cannot show."""

    effect: str
    why: str


@answer
class FoundInRecording:
    """What is known by a signature in the recording."""

    effect: str
    kind: str
    """Which of the effect's signatures, such as "stuck"."""
    where: Sequence[str]
    sentence: str
    stretches: Sequence[Stretch] = ()


@answer
class Decision:
    """What one rule changed in a diagnosis."""

    rule: str
    """As docs/ablation.md lists them."""
    effects: tuple[str, ...]
    sentence: str
    """What it changed."""


@answer
class TakeSetAside:
    """A take that does not fit the others; nothing else was judged on it."""

    take: str
    """Its name."""
    sentence: str
    how: str
    """What makes it fit: signs, sensors or rotations (columns in another order), columns (either), gains, own
    map, another subject; level: its readings lie elsewhere; nothing."""
    error_deg: float
    """Of a line through the other takes."""
    usual_deg: float
    """The same of the other takes, at most."""
    fitted_deg: float
    """With what makes it fit."""
    id: str = ""
    place: int = 0
    """Among the takes that were looked at, from 0."""


@answer
class MissingEffects(AboutTakes):
    """Which effects a model lacks: errors in degrees, on held-out takes, readings and reference identically
    smoothed."""

    rotations: Mapping[str, RotationError]
    named: NamedEffect | None
    candidates: Sequence[Candidate]
    """Every effect that was compared, the best first."""
    not_identifiable: Sequence[NotShown]
    unexplained_residual: Unexplained | None
    next_take: NextTake | None
    sentences: Sequence[str]
    """What to know, the most important first."""
    _: KW_ONLY
    take_plan: TakePlan | None = None
    """All takes to record so that more can be judged, that of `next_take` among them."""
    findings: Sequence[FoundInRecording] = ()
    camera_ranges: Sequence[CoveredRange] = ()
    """Of rotations that a camera measured: angles outside of these ranges are not judged."""
    sensor_problems: Sequence[str] = ()
    """Faults that readings show by themselves, before any effect is tried."""
    reference_problems: Sequence[str] = ()
    hold_drift: DriftInHolds | None = None
    actions: Sequence[Remedy] = ()
    """One for each association of the residual, what saves most first."""
    decided: Sequence[Decision] = ()
    """The rules that changed something, in the order in which they are asked."""
    odd_takes: Sequence[TakeSetAside] = ()
    """Takes that do not fit the others; nothing else was judged on them."""
    excluded: Sequence[str] = ()
    """On reference angles that jump away and come back: they neither train nor score."""
    model_effects: Sequence[ModelEffect] = ()
    """What the model has learned already."""
    ceiling: LeftToGain | None = None
    """Of the model; null: not asked for yet."""
    hand: str | None = None
    """That of the model; null: nobody said it."""
    declarations: Sequence[Mapping[str, Any]] = field(default_factory=tuple)
    """Effects of the user's own that were tried too."""

    @property
    def clearest_rotation(self) -> str | None:
        """Of those of the named effect the one of which it saves the largest share; None: unknown."""
        named = self.named
        known = [] if named is None else [name for name in named.where if name in self.rotations]
        shares = {} if self.tried is None else self.tried.saved_share
        return max(known, key=lambda name: shares.get(name) or 0.0) if known else None

    @property
    def tried(self) -> Candidate | None:
        """The named effect, where it was compared."""
        named = self.named
        return next((item for item in self.candidates if named and item.effect == named.effect), None)

    @property
    def about_candidates(self) -> list[str]:
        """Why one that is significant is not in the confidence set, and which rows are not to be compared."""
        told, named = [], self.named
        if named is not None and self.tried is not None:
            worse = [
                item.effect
                for item in self.candidates
                if item.passes and item.effect not in named.confidence_set
            ]
            if worse:
                told.append(
                    f"Significant and not in the confidence set: {', '.join(worse)}. With {named.effect} "
                    "significantly less of the error is left on the same rotations."
                )
        if len({frozenset(item.where) for item in self.candidates if item.where}) > 1:
            told.append(
                "Each row is of the sensors that read its own rotations; rows of other rotations are not to "
                "be compared."
            )
        return told

    @property
    def next_command(self) -> str:
        """The one command to run after it."""
        model, named = (self.model or "MODEL")[:SHORT], self.named
        if self.odd_takes:
            without = "".join(f" --leave-out {take.id}" for take in self.odd_takes)
            return self._train(self.method or "lmc_gpr") + without
        if self.reference_problems or (self.sensor_problems and named is None):
            return f"glovecal take check {self._spoken_of}"
        if named is not None and named.kind == "finding":
            return f"glovecal record GLOVE after-mending --seconds {LONG_ENOUGH_S}"
        if named is not None and named.verdict == "named":
            if named.method:
                return self._train(named.method)
            # A fault is named by its sensors or takes: only a correction has rotations.
            where = "".join(f" --rotation {name}" for name in named.where) * (named.kind == "correction")
            return f"glovecal add-effect {model} {named.effect}{where}"
        if self.next_take is not None:
            return (self.take_plan.steps[0] if self.take_plan else self.next_take).command
        if named is not None:
            return f"glovecal add-effect {model} {named.effect}"
        known = next((command for item in self.actions if (command := self.command_of(item))), None)
        if known is not None:
            return known
        left = self.unexplained_residual
        if left is not None and left.is_significant:
            return f"glovecal where {model} --report where-{model}.html"
        if left is not None and left.not_identifiable:
            return f"glovecal record GLOVE {FREE_MOTION} --seconds {LONG_ENOUGH_S}"
        return f"glovecal model activate {model}"

    def command_of(self, asked: Remedy) -> str | None:
        """None where nothing is known that would help."""
        if asked.method:
            return self._train(asked.method)
        if not asked.saves:
            return None
        model = (self.model or "MODEL")[:SHORT]
        return f"glovecal add-effect {model} {asked.effect} --rotation {asked.rotation}"

    def _train(self, method: str) -> str:
        of_hand = f" --hand {self.hand}" if self.hand else ""
        return f"glovecal train --subject {self.subject or 'SUBJECT'}{of_hand} --method {method}"

    @property
    def _spoken_of(self) -> str:
        """The id of the take that the first problem speaks of, else of the first: names need not be
        unique."""
        problem = [*self.sensor_problems, *self.reference_problems][0]
        spoken_of = [
            take
            for take in self.takes
            if f"take {take.name}:" in problem or problem.startswith(f"Take {take.name!r}:")
        ]
        return next((take.id for take in (*spoken_of, *self.takes)), "TAKE")

    @property
    def unplanned_take(self) -> NextTake | None:
        """What decides and is not in the plan."""
        return unplanned(self.next_take, self.take_plan)

    @property
    def to_record(self) -> TakePlan | None:
        """The plan, else that of the one take that decides."""
        return to_record(self.next_take, self.take_plan)

    @property
    def not_shown(self) -> list[str]:
        """Effects that no planned take opens and why these takes cannot show them, those with the same reason
        together."""
        opened = () if self.take_plan is None else self.take_plan.opens
        return with_same_reason(
            (item.effect, item.why) for item in self.not_identifiable if item.effect not in opened
        )

    @property
    def of_the_recording(self) -> list[Note]:
        """What was found before any effect was tried."""
        told = {
            "Takes set aside": [item.sentence for item in self.odd_takes],
            "Excluded from the reference": self.excluded,
            "Problems of sensors": self.sensor_problems,
            "Problems of the reference": self.reference_problems,
            "Found in the recording": [item.sentence for item in self.findings],
        }
        return [Note(heading, sentences) for heading, sentences in told.items() if sentences]

    def presentation(self) -> Presentation:
        model = self.title or (f"model {self.model[:SHORT]}" if self.model else self.subject or "the model")
        following, held, plan = self.unplanned_take, self.hold_drift, self.take_plan
        decided = [f"{item.rule}: {item.sentence}" for item in self.decided]
        rows = [("model", self.model), ("takes", first_of([take.name for take in self.takes]) or None)]
        details = Table([Column("detail", ""), Column("value", "")], rows)
        return Presentation(
            f"Missing effects in {model} ({counted(len(self.takes), 'take')})",
            self._summary(),
            [*self.of_the_recording, *([] if following is None else [Note("", [following.sentence])])],
            [
                *self._effects(),
                Section("What remains unexplained", self.unexplained_parts),
                Section("What to do about it", self._remedies(), is_detail=True),
                Section(
                    "Readings while a pose is held",
                    [held.sentence, held.presentation().table] if held is not None and held.poses else [],
                ),
                Section("Error of each rotation", self._errors()),
                Section("Effects of the model", self._of_the_model(), is_detail=True),
                Section("What to record next", [] if plan is None else plan.parts),
                Section(
                    "Not identifiable from these takes", [Lines(self.not_shown)] if self.not_shown else []
                ),
                Section(DECIDED, [Lines(decided)] if decided else [], is_detail=True),
                Section("Details", [details], is_detail=True),
            ],
        )

    def _summary(self) -> list[Fact]:
        named, held = self.named, self.hold_drift
        if held is not None:
            facts = held.facts
        elif named is None:
            facts = [Fact("Verdict", NOTHING_NAMED), *self._largest_error()]
        else:
            also = f"; these takes cannot tell it from {', '.join(named.rivals)}" if named.rivals else ""
            tried = self.tried
            facts = [
                Fact("Verdict", f"{named.effect} is missing{also}."),
                Fact("Size", named.sentence if tried is None else tried.size),
                Fact("Place", ", ".join(named.where) or "all takes"),
            ]
        if self.ceiling is not None:
            facts.append(Fact("Ceiling", self.ceiling.sentence))
        return [*facts, Fact("Next", self.next_command, is_command=True)]

    def _largest_error(self) -> list[Fact]:
        if not self.rotations:
            return []
        name, error = max(self.rotations.items(), key=lambda item: item[1].rmse_deg or 0.0)
        floor = "" if error.noise_floor_deg is None else f" (noise floor {error.noise_floor_deg:.2f})"
        return [
            Fact("Size", f"{error.rmse_deg or 0.0:.2f} degrees{floor}"),
            Fact("Place", f"largest error at {name}"),
        ]

    def _effects(self) -> list[Section]:
        """What is named, or possible, then what was tried beside it."""
        from glovecal_models.effect_block import effect_block, effects_explained

        own = {str(item["name"]): item for item in self.declarations if "name" in item}
        named, parts = self.named, list[Part]()
        possible = [] if named is None else list(dict.fromkeys([*named.confidence_set, named.effect]))
        if named is not None:
            parts = [] if self.tried is None else [named.sentence]  # else the summary says it
            learned = {named.effect: named.parameters}
            parts += [effect_block(name, learned.get(name), own.get(name)) for name in possible]
        others = [item.effect for item in self.candidates if item.effect not in possible]
        tried = list[Part]()
        if self.candidates:
            about = self.about_candidates
            tried = [*tried_parts(self.candidates), *([Lines(about)] if about else [])]
            tried += effects_explained(others, own)
        heading = "The effect" if len(possible) == 1 else "The effects that are possible"
        return [Section(heading, parts), Section("What was tried", tried)]

    def _of_the_model(self) -> list[Part]:
        from glovecal_models.effect_block import effect_block

        return [
            effect_block(item.effect, item.parameters, item.declaration, item.curves)
            for item in self.model_effects
        ]

    @property
    def unexplained_parts(self) -> list[Part]:
        """What is left, what that is associated with, and what the associations ask for."""
        left = self.unexplained_residual
        if left is None:
            return []
        columns = [
            Column("column", "unexplained residual is associated with", folds=True), Column("rotation"),
            Column("size_deg", "RMS contribution, degrees"),
            Column("p_value", "p value, all columns counted", 3),
        ]  # fmt: skip
        rows = [(item.phrase, item.rotation, item.size_deg, item.p_value) for item in left.associations]
        asked = [Lines([item.sentence for item in self.actions])] if self.actions else []
        return [left.sentence, *([Table(columns, rows)] if rows else []), *asked]

    def _remedies(self) -> list[Part]:
        columns = [
            Column("rotation"), Column("column", "associated with"), Column("to_try", "effect or method"),
            Column("rmse_before_deg", "before"), Column("rmse_after_deg", "after"),
            Column("rmse_control_deg", "control"), Column("command", folds=True),
        ]  # fmt: skip
        rows = [
            (
                item.rotation, item.phrase, item.to_try, item.rmse_before_deg, item.rmse_after_deg,
                item.rmse_control_deg, self.command_of(item),
            )
            for item in self.actions
        ]  # fmt: skip
        return [Table(columns, rows, ASKED_FOR)] if rows else []

    def _errors(self) -> list[Part]:
        columns = [Column("rotation"), Column("rmse_deg", "error"), Column("noise_floor_deg", "noise floor")]
        rows = [(name, item.rmse_deg, item.noise_floor_deg) for name, item in self.rotations.items()]
        floors = {name: item.floor for name, item in self.rotations.items()}
        doubts = [f"Noise floor not reliable ({names}): {why}." for names, why in doubted_floors(floors)]
        drawn = [self._errors_chart()] if rows and self.hold_drift is None else []
        said = [Lines(doubts)] if doubts else []
        return [*drawn, Table(columns, rows, empty="Nothing was measured."), *said]

    def _errors_chart(self) -> Chart:
        """A bar for each rotation's error, its noise floor marked; and which is farthest above."""
        shown = sorted(self.rotations.items(), key=lambda item: item[1].rmse_deg or 0.0)
        names, errors = [name for name, _ in shown], [item.rmse_deg or 0.0 for _, item in shown]
        known = [
            (row, item.noise_floor_deg)
            for row, (_, item) in enumerate(shown)
            if item.noise_floor_deg is not None
        ]

        def draw(axes: Axes) -> None:
            axes.barh(np.arange(len(names)), errors, color=MODEL, label="error (RMSE)")
            if known:
                rows, values = zip(*known, strict=True)
                marks = {"color": FLOOR, "markersize": 11, "markeredgewidth": 3, "label": "noise floor"}
                axes.plot(values, rows, "|", **marks)
            axes.set_yticks(range(len(names)), names)
            axes.set_xlabel("smoothed error on held-out takes, degrees")
            axes.set_xlim(0, None)
            legend_above(axes)

        sentence = "The noise floors of these takes are unknown."
        if known:
            most, row = max((errors[row] - floor, row) for row, floor in known)
            sentence = "No rotation is above its noise floor."
            if most > 0:
                sentence = (
                    f"Largest possible improvement at {names[row]}: {errors[row]:.2f} degrees, {most:.2f} "
                    "above its noise floor."
                )
        return Chart(draw, 9, 1.2 + 0.24 * len(names), sentence)
