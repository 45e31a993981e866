"""What takes could have shown: sizes at which effects are named in trials, and effects that look alike."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import exp, isinf, log, sqrt
from typing import TYPE_CHECKING, Literal

from glovecal_models.diagnosis.residual_answer import NextTake
from glovecal_models.presentation.document import (
    AboutTakes,
    Chart,
    Column,
    Explanation,
    Fact,
    Lines,
    Part,
    Presentation,
    Section,
    Table,
    answer,
    counted,
    first_of,
    with_same_reason,
)
from glovecal_models.presentation.drawing import CONTROL, FLOOR, MODEL, QUIET, legend_above

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Outcome = Literal["named", "ambiguous", "mistaken", "not_found"]
OUTCOMES: Mapping[Outcome, tuple[str, str]] = {
    "named": ("named alone", MODEL),
    "ambiguous": ("named together with others", FLOOR),
    "mistaken": ("only others named", CONTROL),
    "not_found": ("not found", QUIET),
}
FOUND: tuple[Outcome, ...] = ("named", "ambiguous")
CLEARLY, HARDLY = 0.8, 0.5
"""Of the trials: from the first on a size is said to be named, below the second not to be."""
BOUND_LEVEL = 0.95
PAIRS_SHOWN = 8
METHOD = (
    "Each sensor reads what the fitted map makes of the measured angles; noise and nuisance are as measured, "
    "from other takes and moments. The effect is added: its size is the RMS of what no static map explains. "
    "Then the session is diagnosed again. Its shape is the middle of what the diagnosis searches."
)
SIZES = (
    "Of the trials: named alone + named with others; then the sizes that half and 80 % of the trials name "
    "alone, and that half find (interpolated)."
)
ALIKE = (
    "Correlation of what one effect adds with its best imitation by the other, the static map projected out; "
    "own part: what is left of its size then. Found from the takes alone, before anything is named."
)


@dataclass(frozen=True)
class Trial:
    """One diagnosis of the session with an effect put in."""

    outcome: Outcome
    named: tuple[str, ...]
    """The confidence set, the effect named first in front; empty where nothing was named."""


@answer
class SizeTried:
    """All trials of one size."""

    size_deg: float
    """RMS of what is put in and no static map explains."""
    trials: int
    """0: these takes cannot hold so much of the effect."""
    named: int = 0
    """It alone is named."""
    ambiguous: int = 0
    """It is named together with others."""
    mistaken: int = 0
    """Only others are named."""
    not_found: int = 0
    mistaken_for: Mapping[str, int] = field(default_factory=dict)
    """Effects named instead, and how often."""
    together_with: Sequence[str] = ()
    """All other effects that were named, alone or beside it."""

    @classmethod
    def of(cls, size_deg: float, trials: Sequence[Trial], effect: str) -> SizeTried:
        count = Counter(item.outcome for item in trials)
        instead = Counter(item.named[0] for item in trials if item.outcome == "mistaken")
        others = {name for item in trials for name in item.named} - {effect}
        return cls(size_deg, len(trials), **count, mistaken_for=dict(instead), together_with=sorted(others))

    def count(self, *outcomes: Outcome) -> int:
        return sum(getattr(self, outcome) for outcome in outcomes)

    def share(self, *outcomes: Outcome) -> float:
        return self.count(*outcomes) / max(self.trials, 1)

    def of_trials(self, *outcomes: Outcome) -> str:
        return f"{self.count(*outcomes)} of {self.trials} trials"

    @property
    def text(self) -> str:
        return f"{self.size_deg:g} degree{'' if self.size_deg == 1 else 's'}"


@answer
class EffectDetectability:
    """How large one effect has to be on some rotations to be named in these takes."""

    effect: str
    rotations: Sequence[str]
    """On which it is put in, all at once."""
    sizes: Sequence[SizeTried] = ()
    why_not: str | None = None
    """Why these takes cannot show it at any size; none was tried then."""
    named_50_deg: float | None = None
    """Size at which half of the trials name it alone, interpolated; null: none tried."""
    named_80_deg: float | None = None
    """The same of 80 % of the trials."""
    found_50_deg: float | None = None
    """Named alone or together with others, half of them."""
    sentence: str = ""

    def __post_init__(self) -> None:
        derived = {
            "named_50_deg": self.size_deg(0.5, "named"),
            "named_80_deg": self.size_deg(0.8, "named"),
            "found_50_deg": self.size_deg(0.5, *FOUND),
            "sentence": self._sentence(),
        }
        for name, value in derived.items():
            object.__setattr__(self, name, value)

    @property
    def tried(self) -> list[SizeTried]:
        return [item for item in self.sizes if item.trials]

    def size_deg(self, probability: float, *outcomes: Outcome) -> float | None:
        """The smallest size that ends in one of ``outcomes`` with ``probability``; None: none that was tried.

        Shares of trials, made monotone in size and interpolated over its logarithm. Where the smallest size
        that was tried does, that size: it may be smaller.
        """
        tried = self.tried
        shares = _monotone([item.share(*outcomes) for item in tried], [item.trials for item in tried])
        for number, (item, share) in enumerate(zip(tried, shares, strict=True)):
            if share < probability:
                continue
            if number == 0:
                return item.size_deg
            before, low = tried[number - 1].size_deg, shares[number - 1]
            part = (probability - low) / (share - low)
            return exp(log(before) + part * (log(item.size_deg) - log(before)))
        return None

    def size_text(self, size_deg: float | None) -> str:
        """The smallest size tried may be smaller, one not reached is larger."""
        if size_deg is None:
            return f"> {self.tried[-1].size_deg:g}" if self.tried else "-"
        return f"<= {size_deg:g}" if size_deg == self.tried[0].size_deg else f"{size_deg:.2g}"

    def _sentence(self) -> str:
        """Which size would have been named, and which would not."""
        start = f"{self.effect} on {', '.join(self.rotations)}"
        if self.why_not is not None:
            return f"{self.effect} cannot be tried in these takes: {self.why_not}."
        tried = self.tried
        if not tried:
            why = "the static map takes it up, or it is a delay too large to be compared"
            return f"{start} shows at no size: {why}."
        named = _from_where(tried, "named")
        if named is not None:
            small = [
                item for item in tried if item.size_deg < named.size_deg and item.share("named") < HARDLY
            ]
            sentence = f"{start}: {named.text} would have been named ({named.of_trials('named')})"
            if small:
                return f"{sentence}, {small[-1].text} would not ({small[-1].of_trials('named')})."
            if named is tried[0]:
                return f"{sentence}; no smaller size was tried."
            before = tried[tried.index(named) - 1]
            return f"{sentence}, {before.text} in {before.of_trials('named')}."
        in_set = _from_where(tried, *FOUND)
        if in_set is not None:
            rivals = ", ".join(sorted({name for item in tried for name in item.together_with}))
            return (
                f"{start}: {in_set.text} would have been found ({in_set.of_trials(*FOUND)}), but not told"
                f" apart from {rivals}."
            )
        last = tried[-1]
        instead = _times(last.mistaken_for)
        more = f"; named instead: {instead}" if instead else ""
        return f"{start}: even {last.text} would not have been named ({last.of_trials('named')}{more})."


@answer
class Control:
    """Trials with nothing put in: what is named then is named by chance, or for want of fit."""

    trials: int
    named: Mapping[str, int] = field(default_factory=dict)
    """What is named nevertheless, and how often."""
    sentence: str = ""

    @classmethod
    def of(cls, trials: Sequence[Trial]) -> Control:
        return cls(len(trials), dict(Counter(item.named[0] for item in trials if item.named)))

    def __post_init__(self) -> None:
        start = "Control: with nothing put in"
        sentence = f"{start} nothing is named in {self.trials} of {self.trials} trials."
        if self.named:
            sentence = (
                f"{start}, {_times(self.named)} in {self.trials} trials is named all the same: so far the"
                " noise of these takes imitates an effect."
            )
        object.__setattr__(self, "sentence", sentence)


@answer
class PairOfEffects:
    """Two effects on the rotation where they are most alike."""

    effects: tuple[str, str]
    """The second imitates the first better than the other way round."""
    rotation: str
    correlation: float
    """Of what they add, the static map projected out; 0 to 1."""
    is_confused: bool
    """Whether the correlation is above the limit."""
    next_take: NextTake | None = None
    """The recording that tells them apart, where they are confused."""

    @property
    def own_pct(self) -> int:
        """What is left of the first's size beside its best imitation."""
        return round(100 * sqrt(max(1 - min(self.correlation, 1.0) ** 2, 0.0)))

    @property
    def text(self) -> str:
        return f"{' and '.join(self.effects)} (correlation {self.correlation:.2f} on {self.rotation})"

    @property
    def sentence(self) -> str:
        following = self.next_take
        own = f"{self.own_pct} % of what {self.effects[0]} adds is its own."
        record = f" To separate them, record {following.seconds} s: {following.what}" if following else ""
        return f"Alike in these takes: {self.text}; {own}{record}"


@answer
class Confusability:
    """All pairs of effects of one session."""

    effects: Sequence[str]
    """Those that were compared."""
    pairs: Sequence[PairOfEffects]
    """The most alike first."""
    condition: Mapping[str, float | None]
    """Condition number of all effects together, by rotation; 1: none is like another; null: infinite."""
    condition_of_others: Mapping[str, float | None]
    """The same, one of each confused pair left out: what more than two effects together hide."""
    not_applicable: Mapping[str, str]
    """Effects these takes cannot show, and why."""
    most_condition: float
    """Above it they cannot be separated (Belsley, Kuh & Welsch 1980)."""
    sentences: Sequence[str] = ()
    """The pairs that are alike, each with the recording that decides; and the whole."""

    def __post_init__(self) -> None:
        pairs = [item.sentence for item in self.confused]
        if not pairs:
            most = f"; the most alike are {self.pairs[0].text}" if self.pairs else ""
            pairs = [f"No two effects are alike in these takes{most}."]
        object.__setattr__(self, "sentences", [*pairs, *self._separable()])

    @property
    def confused(self) -> list[PairOfEffects]:
        return [item for item in self.pairs if item.is_confused]

    def _separable(self) -> list[str]:
        if not self.condition_of_others:
            return []
        values = {name: _or_infinite(value) for name, value in self.condition_of_others.items()}
        rotation = max(values, key=lambda name: values[name])
        worst = values[rotation]
        beside = " (one of each such pair left out)" if self.confused else ""
        verdict = "they cannot all be separated" if worst > self.most_condition else "they can be separated"
        value = f"{worst:.0f}" if worst < 1e4 else "above 10000"
        return [
            f"Condition number of all effects together{beside}: {value} (largest, {rotation}; limit"
            f" {self.most_condition:g}): {verdict}."
        ]


@answer
class Detectable(AboutTakes):
    """Trials with effects of known size in a session's own readings, and effects that look alike."""

    trials: int
    """For each size."""
    residual_deg: Mapping[str, float | None]
    """RMS of noise and nuisance as measured, by rotation: what effects have to exceed."""
    effects: Sequence[EffectDetectability]
    control: Control
    confusability: Confusability
    sentences: Sequence[str] = ()
    """What to know, the most important first."""

    def __post_init__(self) -> None:
        said = [item.sentence for item in self.effects]
        every = [*said, self.control.sentence, trials_sentence(self.trials), *self.confusability.sentences]
        object.__setattr__(self, "sentences", every)

    @property
    def shown(self) -> list[EffectDetectability]:
        return [item for item in self.effects if item.why_not is None]

    @property
    def not_possible(self) -> dict[str, str]:
        """Effects that cannot be put in, and why."""
        return {item.effect: item.why_not for item in self.effects if item.why_not is not None}

    @property
    def named_80_deg(self) -> dict[str, float | None]:
        """By effect the size that 80 % of the trials name alone; None: none that was tried."""
        return {item.effect: item.named_80_deg for item in self.effects}

    def presentation(self) -> Presentation:
        said = [item.sentence for item in self.shown] or ["No effect can be put into these takes."]
        said += [self.control.sentence, *self.confusability.sentences[-1:]]
        worst = [_or_infinite(value) for value in self.confusability.condition.values()]
        details = [
            ("model", self.model or "-"),
            ("takes", first_of([item.name for item in self.takes])),
            ("trials for each size", str(self.trials)),
            ("condition number of all effects, largest rotation", _condition_text(max(worst, default=1.0))),
        ]
        residual = Table(
            [Column("rotation"), Column("noise_deg", "noise and nuisance, ° RMS")],
            list(self.residual_deg.items()),
        )
        return Presentation(
            f"What {self.about} could have shown",
            [Fact("Verdict", said[0]), *(Fact("", sentence) for sentence in said[1:])],
            sections=[
                Section("Sizes that would have been named", self._sizes()),
                Section("Not shown at any size", _lines(with_same_reason(self.not_possible.items()))),
                Section(
                    "Effects that are alike in these takes",
                    [self._pairs(), Explanation(ALIKE)],
                ),
                Section("What effects have to exceed", [residual]),
                Section(
                    "Details", [Table([Column("detail", ""), Column("value", "")], details)], is_detail=True
                ),
            ],
        )

    def _sizes(self) -> list[Part]:
        shown = self.shown
        if not shown:
            return []
        columns = [Column("effect"), Column("rotations", "on", folds=True)]
        columns += [Column(f"size_{size.size_deg:g}_deg", f"{size.size_deg:g}°") for size in shown[0].sizes]
        columns += [
            Column("named_50_deg", "50 % named, °"),
            Column("named_80_deg", "80 % named, °"),
            Column("found_50_deg", "50 % found, °"),
        ]
        rows = [
            [
                item.effect, ", ".join(item.rotations), *map(_cell, item.sizes),
                item.size_text(item.named_50_deg), item.size_text(item.named_80_deg),
                item.size_text(item.found_50_deg),
            ]
            for item in shown
        ]  # fmt: skip
        sentence = f"Above each cell: trials that name the effect alone, of {counted(self.trials, 'trial')}."
        width, height = 3.2 + 1.1 * len(shown[0].sizes), 1.6 + 0.55 * len(shown)
        chart = Chart(lambda axes: _draw_outcomes(axes, shown), width, height, sentence)
        return [chart, Table(columns, rows, legend=SIZES), Explanation(METHOD)]

    def _pairs(self) -> Table:
        most = max(PAIRS_SHOWN, len(self.confusability.confused))
        columns = [
            Column("effects"), Column("rotation"), Column("correlation"), Column("own_pct", "own part, %"),
            Column("record", "to separate them, record", folds=True),
        ]  # fmt: skip
        rows = [
            [
                " and ".join(pair.effects), pair.rotation, pair.correlation, pair.own_pct,
                "-" if pair.next_take is None else f"{pair.next_take.seconds} s: {pair.next_take.what}",
            ]
            for pair in self.confusability.pairs[:most]
        ]  # fmt: skip
        return Table(columns, rows, empty="Fewer than two effects can be shown.")


def trials_sentence(trials: int) -> str:
    """How sure so few trials are."""
    return (
        f"{trials} trials a size: {trials} of {trials} mean a probability of at least"
        f" {100 * lowest_probability(trials):.0f} % (one-sided 95 % bound)."
    )


def lowest_probability(trials: int) -> float:
    """The one-sided lower 95 % bound of a probability that held in every one of so many trials."""
    return (1 - BOUND_LEVEL) ** (1 / trials) if trials else 0.0


def _draw_outcomes(axes: Axes, effects: Sequence[EffectDetectability]) -> None:
    """Effects by sizes, each cell split into what the trials ended in."""
    rows = list(effects)[::-1]
    for row, item in enumerate(rows):
        for column, size in enumerate(item.sizes):
            left = column - 0.46
            for name, (_, colour) in OUTCOMES.items():
                axes.barh(row, width := 0.92 * size.share(name), left=left, height=0.5, color=colour)
                left += width
            said = f"{size.named}/{size.trials}" if size.trials else "-"
            axes.text(column, row + 0.26, said, ha="center", va="bottom", fontsize=9)
    for label, colour in OUTCOMES.values():
        axes.barh([0], [0], color=colour, label=label)
    axes.set_xlim(-0.5, len(rows[0].sizes) - 0.5)
    axes.set_ylim(-0.6, len(rows) - 0.3)
    axes.set_xticks(range(len(rows[0].sizes)), [f"{size.size_deg:g}" for size in rows[0].sizes])
    on = [
        item.rotations[0] if len(item.rotations) == 1 else f"{len(item.rotations)} rotations" for item in rows
    ]
    axes.set_yticks(
        range(len(rows)), [f"{item.effect}, {where}" for item, where in zip(rows, on, strict=True)]
    )
    axes.set_xlabel("size of the effect, degrees RMS beyond any static map")
    legend_above(axes, 2)


def _row_name(item: EffectDetectability) -> str:
    where = item.rotations
    return f"{item.effect}, {where[0] if len(where) == 1 else f'{len(where)} rotations'}"


def _cell(size: SizeTried) -> str:
    also = f"+{size.ambiguous}" if size.ambiguous else ""
    return f"{size.named}{also} of {size.trials}" if size.trials else "-"


def _times(names: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count} times" for name, count in names.items())


def _lines(sentences: Sequence[str]) -> list[Part]:
    return [Lines(sentences)] if sentences else []


def _or_infinite(value: float | None) -> float:
    return float("inf") if value is None else value


def _condition_text(value: float) -> str:
    return "infinite" if isinf(value) else f"{value:.0f}"


def _from_where(tried: Sequence[SizeTried], *outcomes: Outcome) -> SizeTried | None:
    """The smallest size from which on every size ends so in most trials."""
    first = None
    for item in reversed(tried):
        if item.share(*outcomes) < CLEARLY:
            break
        first = item
    return first


def _monotone(shares: Sequence[float], weights: Sequence[int]) -> list[float]:
    """The nearest shares that do not fall (pool adjacent violators)."""
    pools: list[list[float]] = []
    for share, weight in zip(shares, weights, strict=True):
        pools.append([share, float(weight), 1.0])
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            value, size, count = pools.pop()
            before = pools[-1]
            before[0] = (before[0] * before[1] + value * size) / (before[1] + size)
            before[1] += size
            before[2] += count
    return [value for value, _, count in pools for _ in range(int(count))]
