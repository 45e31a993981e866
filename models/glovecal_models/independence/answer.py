"""An independence examination: which sensors stretch which others, and how each rotation should be read.

Per cents are of the still sensor's active range, as in Wang & Neff 2013, section 3.1 and Table 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import nan
from typing import TYPE_CHECKING, Any, Literal

from glovecal_models.hand.rotations import ACTIVE_RANGE_DEG
from glovecal_models.layout import CorrespondenceKind
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
)
from glovecal_models.presentation.drawing import CARD, FLOOR, MEASURED, MODEL, QUIET, legend_above, shares

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LEAST_STD_PCT, LEAST_MAX_PCT = 5.0, 12.0
"""The paper's rule: from either on a sensor is cross-coupled."""
LEAST_BLOCKS = 10
UNEXPLAINED_PCT = 5.0
"""Of the range: so much that no other sensor explains is a joint that was not still."""
SEEN_SHARE = 0.6
"""Of a healthy hand's active range: with less, a range is not seen."""
STILL_STD_PCT, STILL_SPAN_PCT = 3.0, 10.0
"""Of the joint's active range: what a joint kept still moves all the same."""
LEAST_SENSORS = 3
"""Bending and sideways, each: with fewer it is not told whose hand the glove is of."""
MOST_SHOWN_PCT = 50.0
MATRIX = (
    "Standard | largest deviation caused by each affecting sensor alone, % of the still sensor's active "
    "range. Dot: affects by the 5 % and 12 % rule; ?: undecided; grey: the sensor did not move alone, "
    "unknown; empty: no effect; hatched: the joint's own sensor."
)
RangeSource = Literal["its own range take", "measured angles", "all that was read", "what the glove can send"]
WornVerdict = Literal["as it should be", "other hand", "back to front", "not identifiable"]


@answer
class AffectingShare:
    """What one sensor's joint does to the still sensor; ``_low`` and ``_high`` are 95 % intervals."""

    sensor: str
    std_pct: float
    std_low: float
    """Pieces of time weighted anew."""
    std_high: float
    max_pct: float
    max_low: float
    max_high: float
    affects: Literal["yes", "no", "undecided"]
    """By the 5 % and 12 % rule; undecided when the interval lies on both sides of it, or a rival could be the
    cause."""
    moved_pct: float
    """How much of its own range it was moved through."""
    rivals: Sequence[str]
    """Sensors that always moved along and could be the cause."""

    @property
    def text(self) -> str:
        mark = {"yes": "", "undecided": "?", "no": "-"}[self.affects]
        return f"{self.sensor}{mark} ({self.std_pct:.1f} %, {self.max_pct:.1f} %)"


@answer
class Stillness:
    """How much a rotation moved that was to be kept still, by measured angles, per cent of its range."""

    std_pct: float
    span_pct: float
    is_still: bool = False

    def __post_init__(self) -> None:
        is_still = self.std_pct <= STILL_STD_PCT and self.span_pct <= STILL_SPAN_PCT
        object.__setattr__(self, "is_still", is_still)


@answer
class ActiveRange:
    """How far a sensor reads while its own joint goes through its range: the scale of every per cent."""

    sensor: str
    readings: float
    """Readings between the two ends of the range; 0 when nothing is known."""
    source: RangeSource
    angle_deg: float | None
    """How far the joint went, degrees, where it was measured."""
    has_moved: bool
    """False: the sensor read nothing but noise in these takes."""

    @property
    def doubt(self) -> str | None:
        """What is wrong with it, and what to record."""
        sensor = self.sensor
        how = f"record a take called range-{sensor} in which only that joint goes through its range"
        if not self.has_moved and self.source == "what the glove can send":
            return (
                f"The range of {sensor} was not seen yet: per cents are of all the glove can send, so they "
                f"are too small; {how}."
            )
        if not self.has_moved:
            return f"The range of {sensor} was not seen yet: nothing can be given in per cent of it; {how}."
        if sensor in ACTIVE_RANGE_DEG and self.angle_deg is not None:
            low, high = ACTIVE_RANGE_DEG[sensor]
            if self.angle_deg < SEEN_SHARE * (high - low):
                return (
                    f"{sensor} went through {self.angle_deg:.0f} degrees; a healthy hand goes through "
                    f"{high - low:.0f}: per cents of so short a range are too large; {how}."
                )
        if self.source == "all that was read":
            return (
                f"The range of {sensor} is all that it read, its neighbours' crosstalk included, so per "
                f"cents may be too small; {how}."
            )
        return None


@dataclass(frozen=True)
class NotExamined:
    """A rotation that was kept still in a take, but could not be examined."""

    rotation: str
    unknown_range: ActiveRange | None
    """Of its sensor; None: the takes are too short."""
    seconds: int
    """For which it was kept still."""

    @property
    def sentence(self) -> str:
        """Why not, and what to record."""
        if self.unknown_range is not None:
            sensor = self.unknown_range.sensor
            return self.unknown_range.doubt or f"The range of {sensor} was not seen yet."
        return (
            f"{self.rotation} was kept still for {self.seconds} s in all; move the others for "
            f"{LEAST_BLOCKS} s or more."
        )


@answer
class ExaminedRotation:
    """What the sensor of a rotation did while that was kept still and others moved."""

    rotation: str
    sensor: str
    takes: Sequence[str]
    seconds: float
    std_pct: float
    """Standard deviation, per cent of the active range."""
    max_pct: float
    is_coupled: bool
    """By the paper's rule, from 5 % standard or 12 % largest deviation on."""
    unexplained_pct: float
    """RMS, on held-out pieces of time, that no other sensor explains."""
    affecting: Sequence[AffectingShare]
    """Sensors that add something, the strongest first."""
    products: Sequence[tuple[str, str]]
    """Pairs whose common movement does something else than the sum of both."""
    not_moved: Sequence[str]
    """Sensors that moved too little, or only by crosstalk of others: whether they affect this one is not
    known."""
    still: Stillness | None
    """By measured angles; null where there are none."""
    active_range: ActiveRange
    is_dead: bool
    """The sensor does not move at all in any take."""
    rough_causes: Sequence[str]
    """Causes that are cross-coupled themselves and whose angle was not measured: their shares are rough."""
    doubts: Sequence[str] = ()
    """What makes the result doubtful."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "doubts", self._doubts())

    def _doubts(self) -> list[str]:
        sensor, still = self.sensor, self.still
        doubts = [dead_sentence(sensor)] if self.is_dead else []
        if still is not None and not still.is_still:
            doubts.append(
                f"{self.rotation} was not still: it moved by {still.std_pct:.0f} % of its range (standard "
                f"deviation; {still.span_pct:.0f} % from end to end). What its angle explains is removed."
            )
        if still is None and self.unexplained_pct >= UNEXPLAINED_PCT:
            doubts.append(
                f"{sensor} moved by {self.unexplained_pct:.0f} % of its range independently of every other "
                f"sensor: was {self.rotation} really kept still? Nothing else here measures it."
            )
        doubts += [
            f"{share.sensor} and {listed(share.rivals)} always moved together, so which of them affects "
            f"{sensor} is not identifiable: move each for some seconds by itself."
            for share in self.affecting
            if share.rivals and share.affects != "no"
        ]
        doubts += [doubt] if (doubt := self.active_range.doubt) else []
        if self.rough_causes:
            are = "are" if len(self.rough_causes) > 1 else "is"
            doubts.append(
                f"{listed(self.rough_causes)} {are} cross-coupled too, so the shares in {sensor} are rough: "
                "measure the angles, or move each joint alone, in takes called like "
                f"still-{sensor}-move-{self.rough_causes[0]}."
            )
        return doubts


@answer
class OneWay:
    """A coupling that was examined both ways and acts in one direction only."""

    affecting: str
    affected: str
    sentence: str = ""

    def __post_init__(self) -> None:
        first, second = self.affecting, self.affected
        sentence = f"{first} affects {second}, {second} does not affect {first}."
        object.__setattr__(self, "sentence", sentence)


@answer
class WornSide:
    """Which hand the glove is of."""

    verdict: WornVerdict
    p_value: float | None
    """That random signs agree so well with the verdict; null where it is not identifiable."""
    reversed_sensors: Sequence[str]
    is_known_glove: bool
    """Whether it is known which way each of its sensors reads: a CyberGlove."""
    bending: str = ""
    """How many bending sensors read the wrong way, as "1 of 9"."""
    sideways: str = ""
    sentence: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", self._sentence())

    def _sentence(self) -> str:
        """And how sure that is."""
        if self.verdict == "not identifiable":
            why = (
                "only of a CyberGlove it is known which way each sensor reads"
                if not self.is_known_glove
                else f"it takes measured angles of {LEAST_SENSORS} bending and {LEAST_SENSORS} sideways "
                "joints that moved"
            )
            return f"Which hand the glove is of is not identifiable: {why}."
        count = f"{self.bending} bending and {self.sideways} sideways sensors read the wrong way"
        if self.verdict == "as it should be":
            names = ", ".join(self.reversed_sensors)
            odd = f" {names} read the wrong way: are they swapped with others?" if names else ""
            return f"The glove is of this hand: {count}.{odd}"
        question = (
            "Is this a left glove on a right hand (or the reverse), or worn back to front?"
            if self.verdict == "back to front"
            else "Is this the glove of the other hand?"
        )
        return (
            f"{question} {count} (p = {self.p_value:.2g} for random signs). A reference that counts angles "
            "the other way looks the same."
        )


@answer
class Proposal:
    """How a rotation should be read. The user confirms, the layout keeps it."""

    rotation: str
    kind: CorrespondenceKind
    sensors: Sequence[str]
    kind_now: CorrespondenceKind
    sensors_now: Sequence[str]
    is_sure: bool | None
    """Null: not examined, it stays as it is. False: an affecting sensor is undecided."""
    sentence: str
    """And why."""
    is_change: bool = False

    def __post_init__(self) -> None:
        is_change = set(self.sensors) != set(self.sensors_now) or self.kind != self.kind_now
        object.__setattr__(self, "is_change", is_change)

    @property
    def line(self) -> str:
        if not self.is_change:
            return self.sentence
        return f"{self.sentence} {'(a change)' if self.is_sure else '(a change, unsure)'}"


@answer
class Rule:
    """From either on a sensor is cross-coupled."""

    std_pct: float = LEAST_STD_PCT
    max_pct: float = LEAST_MAX_PCT


@answer
class Independence(AboutTakes):
    """A whole glove examined: each rotation that was kept still in a take, and what is odd about it."""

    layout: str
    rule: Rule
    sensors: Sequence[str]
    still: Mapping[str, Sequence[str]]
    """Take to the rotations that were kept still in it."""
    rotations: Sequence[ExaminedRotation]
    """In the layout's order."""
    one_way: Sequence[OneWay]
    dead_sensors: Sequence[str]
    worn_side: WornSide
    proposals: Sequence[Proposal]
    """One for each rotation, in the layout's order."""
    proposed_layout: Mapping[str, Any]
    """With the proposals that are sure; store it with PUT gloves/{layout}."""
    sentences: Sequence[str]
    """What is odd about the glove or the takes."""

    def of(self, rotation: str) -> ExaminedRotation | None:
        return next((item for item in self.rotations if item.rotation == rotation), None)

    def presentation(self) -> Presentation:
        rows = self.rotations
        layout = [item.line for item in self.proposals if item.is_sure is not None]
        stay = [item.rotation for item in self.proposals if item.is_sure is None]
        layout += [f"As before, since not examined: {', '.join(stay)}."] if stay else []
        changes = [item for item in self.proposals if item.is_change]
        each: list[Part] = [self._shares()] if any(item.affecting for item in rows) else []
        return Presentation(
            f"Cross-coupling of sensors in {self.about}, layout {self.layout}",
            self._summary(changes),
            [Note("Check this first", self.sentences)] if self.sentences else [],
            [
                Section("Which sensor affects which", self._couplings()),
                Section("Total deviation", [self._deviations()] if rows else [], is_detail=True),
                Section("Deviation caused by each sensor alone", each, is_detail=True),
                Section("Proposed layout", [Lines(layout), *[self._changes(changes)] * bool(changes)]),
            ],
        )

    def _summary(self, changes: Sequence[Proposal]) -> list[Fact]:
        rows = self.rotations
        coupled = [item.rotation for item in rows if item.is_coupled]
        verdict = (
            f"{len(coupled)} of {counted(len(rows), 'examined sensor')} cross-coupled "
            f"({counted(len(self.still), 'take')}); {counted(len(changes), 'change')} of the layout proposed."
        )
        facts = [Fact("Verdict", verdict)]
        if rows:
            worst = max(item.std_pct for item in rows)
            size = f"largest: {worst:.1f} % of the active range (limit {self.rule.std_pct:g} %)"
            facts += [Fact("Size", size), Fact("Place", ", ".join(coupled) or "none")]
        command = "glovecal take examine --keep NAME" if changes else "glovecal train --subject SUBJECT"
        return [*facts, Fact("Next", command, is_command=True)]

    def _couplings(self) -> list[Part]:
        if not self.rotations:
            return ["No rotation could be examined."]
        columns = [
            Column("rotation", "kept still"), Column("std_pct", "std. dev., %", 1),
            Column("max_pct", "max. dev., %", 1), Column("is_coupled", "cross-coupled"),
            Column("affecting", "affecting sensors (std., max. dev. of their own)", folds=True),
        ]  # fmt: skip
        rows = [
            (
                item.rotation, item.std_pct, item.max_pct, item.is_coupled,
                ", ".join(share.text for share in item.affecting) or "none",
            )
            for item in self.rotations
        ]  # fmt: skip
        legend = (
            "Per cent of the joint's active range, as its sensor reads it. Cross-coupled from "
            f"{self.rule.std_pct:g} % standard or {self.rule.max_pct:g} % largest deviation on; ? undecided, "
            "- below."
        )
        width, height = 2.8 + 0.56 * len(self.sensors), 2.1 + 0.4 * len(self.rotations)
        matrix = Chart(self._draw_matrix, width, height, self._matrix_sentence())
        one_way = [Lines([item.sentence for item in self.one_way])] if self.one_way else []
        return [matrix, Table(columns, rows, legend), *one_way]

    def _shares(self) -> Table:
        columns = [
            Column("rotation", "joint kept still"), Column("sensor", "affecting sensor"),
            Column("std_pct", "std. dev., %", 1), Column("std_interval", "95 % interval"),
            Column("max_pct", "max. dev., %", 1), Column("max_interval", "95 % interval"), Column("affects"),
        ]  # fmt: skip
        rows = [
            (
                item.rotation, share.sensor, share.std_pct, f"{share.std_low:.1f} to {share.std_high:.1f}",
                share.max_pct, f"{share.max_low:.1f} to {share.max_high:.1f}", share.affects,
            )
            for item in self.rotations
            for share in item.affecting
        ]  # fmt: skip
        return Table(columns, rows)

    def _changes(self, changes: Sequence[Proposal]) -> Table:
        columns = [
            Column("rotation"), Column("kind_now", "now"), Column("sensors_now", "read from"),
            Column("kind", "proposed"), Column("sensors", "read from"), Column("is_sure", "significant"),
        ]  # fmt: skip
        rows = [
            (
                item.rotation, item.kind_now, ", ".join(item.sensors_now), item.kind,
                ", ".join(item.sensors), item.is_sure,
            )
            for item in changes
        ]  # fmt: skip
        legend = "The layout stays as it is until you keep the proposal; --rotation keeps some of it."
        return Table(columns, rows, legend)

    def _matrix_sentence(self) -> str:
        each = [(share, item) for item in self.rotations for share in item.affecting]
        if not each:
            return f"No sensor affects another. {MATRIX}"
        share, item = max(each, key=lambda one: (one[0].affects == "yes", one[0].std_pct))
        return (
            f"Largest: {share.sensor} alone moves the reading of {item.sensor} by {share.std_pct:.0f} % of "
            f"its range ({share.std_low:.0f} to {share.std_high:.0f}), at most {share.max_pct:.0f} %. "
            + MATRIX
        )

    def _draw_matrix(self, axes: Axes) -> None:
        """Rows: rotations kept still; columns: affecting sensors; in each cell the two deviations."""
        rows, columns = self.rotations, list(self.sensors)
        own = [{share.sensor: share.std_pct for share in item.affecting} for item in rows]
        values = [[row.get(name, nan) for name in columns] for row in own]
        image = axes.imshow(
            values, cmap=shares(), aspect="auto", vmin=0, vmax=MOST_SHOWN_PCT, interpolation="none"
        )
        for row, item in enumerate(rows):
            _draw_row(axes, row, item, columns)
        axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        axes.set_yticks(range(len(rows)), [item.rotation for item in rows])
        axes.set_xticks([at - 0.5 for at in range(len(columns) + 1)], minor=True)
        axes.set_yticks([at - 0.5 for at in range(len(rows) + 1)], minor=True)
        axes.grid(which="minor", color=QUIET, linewidth=0.5)
        axes.tick_params(which="minor", length=0)
        axes.set(xlabel="affecting sensor", ylabel="joint kept still")
        axes.figure.colorbar(image, ax=axes, label="standard deviation, % of range", shrink=0.8)

    def _deviations(self) -> Chart:
        """Standard and largest deviation of each still rotation, the rule's limits marked."""
        coupled = ", ".join(item.rotation for item in self.rotations if item.is_coupled)
        alone = ", ".join(item.rotation for item in self.rotations if not item.is_coupled)
        sentence = (
            f"Cross-coupled: {coupled or 'none'}. Independent: {alone or 'none'}. "
            "Above either limit: cross-coupled (Wang & Neff 2013)."
        )
        return Chart(self._draw_deviations, 9, 1.4 + 0.3 * len(self.rotations), sentence)

    def _draw_deviations(self, axes: Axes) -> None:
        rows, rule = list(self.rotations)[::-1], self.rule
        for shift, name, colour in ((0.2, "std_pct", MODEL), (-0.2, "max_pct", QUIET)):
            places = [at + shift for at in range(len(rows))]
            label = "standard deviation" if name == "std_pct" else "largest deviation"
            axes.barh(places, [getattr(item, name) for item in rows], 0.38, color=colour, label=label)
        axes.axvline(rule.std_pct, color=FLOOR, linewidth=1.2, label=f"{rule.std_pct:g} % standard")
        axes.axvline(
            rule.max_pct, color=FLOOR, linewidth=1.2, linestyle=":", label=f"{rule.max_pct:g} % largest"
        )
        axes.set_yticks(range(len(rows)), [item.rotation for item in rows])
        axes.set_xlabel("% of the active range, while the joint is kept still")
        axes.set_xlim(0, None)
        legend_above(axes, 2)


def dead_sentence(sensor: str) -> str:
    return f"Sensor {sensor} does not move in any take: is it broken, or its wire?"


def listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _draw_row(axes: Axes, row: int, item: ExaminedRotation, columns: Sequence[str]) -> None:
    fills = [(name, CARD, None) for name in item.not_moved]
    for name, colour, hatch in [*fills, (item.sensor, "none", "///")]:
        left = columns.index(name) - 0.5
        axes.fill_between(
            [left, left + 1],
            row - 0.5,
            row + 0.5,
            facecolor=colour,
            edgecolor=QUIET,
            hatch=hatch,
            linewidth=0,
        )
    for share in item.affecting:
        column = columns.index(share.sensor)
        colour = "white" if share.std_pct > 0.6 * MOST_SHOWN_PCT else MEASURED
        text = f"{share.std_pct:.0f} | {share.max_pct:.0f}"
        axes.text(column, row, text, ha="center", va="center", fontsize=7.5, color=colour)
        if share.affects == "yes":
            axes.plot(column + 0.36, row - 0.33, "o", color=FLOOR, markersize=4)
        elif share.affects == "undecided":
            axes.text(column + 0.36, row - 0.3, "?", ha="center", va="center", color=FLOOR, weight="bold")
