"""Where a model fails: floors, what each error depends on, wearings and the worst seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from glovecal_models.comparison.answer import OnSeenTakes, doubted_floors, seen_note
from glovecal_models.comparison.floor_estimate import ORDER, NoiseFloor, floor_text
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.presentation.document import (
    Cell,
    Chart,
    Column,
    Fact,
    Lines,
    Part,
    Pictures,
    Presentation,
    Section,
    Table,
    answer,
    counted,
)
from glovecal_models.presentation.drawing import HEAT, MODEL, QUIET, draw_heat, legend_above, plotted

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLOSE_UPS = 3
"""Rotations with pictures of their own, those farthest above their floor."""
MOST_COLUMNS, MOST_REGIONS = 32, 3
LEADING = ("angle", "speed", "direction", "time in take", "time since power-on", "wearing")
"""Columns that every heat map starts with; context and sensors follow."""
NOISE_FLOORS = "Noise floors"
FLOORS = (
    "Degrees with 95 % intervals; the leftmost estimate of a row counts. Spectrum and frame to frame are "
    "lower bounds: they do not include autocorrelated noise. slow: percent of the error's variance below "
    "1 Hz."
)
SMALL = (4.4, 3.3)
"""Width and height of a picture that stands beside others, inches."""


@answer
class SlowShare:
    """Share of an error's variance below 1 Hz."""

    share: float
    low: float
    """95 % interval, from resampled blocks of time."""
    high: float


@answer
class Dependence:
    """The error of one rotation against one recorded column."""

    covariate: str
    unit: str
    phrase: str
    """As a sentence names it."""
    edges: Sequence[float]
    """Of the bins (one more than bins), in the column's unit."""
    mean_deg: Sequence[float]
    """Mean error in each bin."""
    count: Sequence[int]
    """Frames in each bin."""
    chance_deg: Sequence[float | None]
    """How far 95 % of the circular shifts take a bin's mean from the mean of all; null: not tested."""
    explained_deg: float
    """Root mean square of the bin means' deviation from their mean: what this column explains."""
    p_value: float
    """Share of circular shifts that explain as much; 1 where it could not be tested."""
    is_significant: bool
    is_structure: bool
    """Significant, and large enough to matter."""

    def sentence(self, rotation: str, rmse_deg: float) -> str:
        """How far the error of a rotation goes with the column, and whether chance goes as far."""
        verdict = "significant" if self.is_significant else "not significant"
        if self.is_significant and not self.is_structure:
            verdict = f"significant, but a small part of {rmse_deg:.1f} degrees"
        return (
            f"Against {self.phrase} the mean error of {rotation} goes from {min(self.mean_deg):+.1f} to "
            f"{max(self.mean_deg):+.1f} degrees; RMS contribution {self.explained_deg:.1f} degrees, "
            f"p = {self.p_value:.3f}: {verdict}."
        )

    def chart(self, rotation: str, rmse_deg: float) -> Chart:
        """Mean error in bins of the column, beside what chance reaches."""
        return Chart(partial(self._draw, rotation), *SMALL, self.sentence(rotation, rmse_deg))

    def _draw(self, rotation: str, axes: Axes) -> None:
        middles = 0.5 * (np.array(self.edges[1:]) + self.edges[:-1])
        mean, chance = np.average(self.mean_deg, weights=self.count), np.array(self.chance_deg, dtype=float)
        axes.fill_between(
            middles, mean - chance, mean + chance, color=QUIET, alpha=0.5, linewidth=0,
            label="95 % of circular shifts",
        )  # fmt: skip
        axes.axhline(0, color=QUIET)
        axes.plot(middles, self.mean_deg, "o-", color=MODEL)
        axes.set_xlabel(f"{self.covariate} ({self.unit})" if self.unit else self.covariate)
        axes.set_ylabel(f"mean error of {rotation}, degrees")
        legend_above(axes)


@answer
class WearingErrors:
    """Mean error of one rotation in each wearing."""

    rotation: str
    wearings: Sequence[str]
    mean_deg: Sequence[float]
    takes: Sequence[int]
    spread_deg: float
    """Root mean square of the wearings' means about their mean."""
    p_value: float | None
    """Share of permutations of the takes over the wearings that spread as widely; null: too few takes."""
    is_significant: bool
    """The error changes with the wearing by more than from take to take."""
    sentence: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", self._sentence())

    def _sentence(self) -> str:
        low, high = int(np.argmin(self.mean_deg)), int(np.argmax(self.mean_deg))
        first, last = (
            f"{self.mean_deg[at]:+.1f} degrees in wearing {self.wearings[at]}" for at in (low, high)
        )
        ends = f"from {first} to {last}"
        if self.p_value is None:
            return f"The mean error goes {ends}; too few takes to say whether the wearing is the cause."
        if self.is_significant:
            return f"The mean error changes with the wearing, {ends} (p = {self.p_value:.2g})."
        return f"The mean error goes {ends}, no more than between takes (p = {self.p_value:.2g})."

    def chart(self) -> Chart:
        return Chart(self._draw, *SMALL, self.sentence)

    def _draw(self, axes: Axes) -> None:
        places = np.arange(len(self.wearings))
        axes.axhline(0, color=QUIET)
        axes.bar(places, self.mean_deg, color=MODEL, width=0.6)
        counts = zip(self.wearings, self.takes, strict=True)
        labels = [f"{name}\n{counted(takes, 'take')}" for name, takes in counts]
        many = len(labels) > 4
        axes.set_xticks(places, labels, rotation=60 if many else 0, ha="right" if many else "center")
        axes.set_ylabel(f"mean error of {self.rotation}, degrees")


@answer
class RotationFindings:
    """One rotation: how far from its floor, and what its error depends on."""

    rotation: str
    rmse_deg: float
    bias_deg: float
    floor: NoiseFloor | None
    other_floors: Sequence[NoiseFloor]
    """Less good estimates of the floor."""
    slow: SlowShare | None
    """Null: too little was measured without a gap."""
    dependences: Sequence[Dependence]
    """Every column tested, the one that explains most first."""
    wearings: WearingErrors | None
    is_near_floor: bool = False
    """The error is no larger than the noise floor, within its interval."""
    is_at_floor: bool = False
    """Only noise remains, and it is not the prediction's own."""
    is_own_jitter: bool = False
    """The error is no larger than the noise floor and the prediction's own jitter together."""
    is_mostly_bias: bool = False
    """Most of the error is a constant."""
    sentence: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "sentence", self._sentence())

    @property
    def structure(self) -> tuple[Dependence, ...]:
        """Significant dependences, the largest first."""
        return tuple(item for item in self.dependences if item.is_structure)

    @property
    def floors(self) -> list[NoiseFloor]:
        """Every estimate, the best first."""
        return [] if self.floor is None else [self.floor, *self.other_floors]

    def _sentence(self) -> str:
        """The error, its noise floor and what it depends on."""
        start, floor = f"{self.rotation}: RMSE {self.rmse_deg:.1f} degrees", self.floor
        if floor is not None:
            start += f" (noise floor {floor_text(floor, 1)})"
            if self.is_own_jitter:
                return (
                    f"{start}: no more than the prediction's own jitter of {floor.prediction_deg:.1f} while "
                    "the hand is still; the model follows its sensors too closely."
                )
            if self.is_near_floor:
                return f"{start}: at the noise floor."
        if self.is_mostly_bias:
            start += f", mostly a constant {self.bias_deg:+.1f}"
        if not self.structure:
            times = ""
            if floor is not None and floor.is_reliable and not floor.is_lower_bound and floor.floor_deg > 0:
                times = f"; the error is {self.rmse_deg / floor.floor_deg:.1f} times the floor"
            slow = (
                "" if self.slow is None else f"; {100 * self.slow.share:.0f} % of its variance is below 1 Hz"
            )
            return f"{start}; no recorded column explains it{times}{slow}."
        first, *rest = self.structure
        also = f"; {counted(len(rest), 'other column')} significant" if rest else ""
        return (
            f"{start}. It depends on {first.phrase}: from {min(first.mean_deg):+.1f} to "
            f"{max(first.mean_deg):+.1f} degrees, RMS contribution {first.explained_deg:.1f} degrees{also}."
        )

    def charts(self) -> list[Chart]:
        """Against the two columns that explain most, and by wearing."""
        against = (self.structure or self.dependences)[:2]
        found = [item.chart(self.rotation, self.rmse_deg) for item in against]
        return found if self.wearings is None else [*found, self.wearings.chart()]

    def dependence(self, column: str | None) -> Dependence:
        """On a column, or None for what explains most. Raises BadInput when it was not tested."""
        for item in (*self.structure, *self.dependences):
            if column in (None, item.covariate):
                return item
        there = ", ".join(item.covariate for item in self.dependences) or "none"
        asked = "no column" if column is None else f"column {column!r} was not"
        raise BadInput(f"{self.rotation}: {asked} tested; there are {there}")


@answer
class Stretch:
    """One stretch of a take; errors over the rotations measured in it, degrees."""

    take: str
    start_s: float
    end_s: float
    """Seconds on the take's own clock."""
    rmse_deg: float
    rotation: str
    """The rotation that is worst in it."""
    rotation_rmse_deg: float
    pose: str
    """What the take calls the pose in its middle, "" for nothing."""
    number: int
    """Of the take among those given, from 0: two may have one name."""


@answer
class RegionDifference:
    """One rotation in one range of its predicted angle."""

    rotation: str
    low_deg: float
    high_deg: float
    difference_deg: float
    """RMS difference of the two models' predictions."""
    claimed_deg: float
    """Root of their summed claimed variances, RMS."""
    ratio: float
    is_significant: bool
    """The model, not the noise, is wrong there."""


@answer
class CrossValidationDifference:
    """Two models trained on disjoint halves of the model's training takes."""

    halves: tuple[Sequence[str], Sequence[str]]
    """Wearings, or takes, of the two models."""
    are_wearings: bool
    regions: Sequence[RegionDifference]
    """The largest ratio first."""


def cross_validation_sentences(found: CrossValidationDifference | None) -> list[str]:
    """Where two models of disjoint halves differ by more than they claim."""
    if found is None:
        return ["Cross-validation difference: not estimated, each half needs two takes."]
    what = "wearings" if found.are_wearings else "takes"
    start = f"Cross-validation difference (two models, trained on disjoint {what})"
    wrong = [item for item in found.regions if item.is_significant]
    if not wrong:
        largest = "" if not found.regions else f", at most {found.regions[0].ratio:.1f} times"
        return [f"{start}: nowhere far above the claimed standard deviations{largest}."]
    each = "; ".join(
        f"{item.rotation} at {item.low_deg:.0f} to {item.high_deg:.0f} degrees: "
        f"{item.difference_deg:.1f} degrees apart, {item.ratio:.1f} times the claimed"
        for item in wrong[:MOST_REGIONS]
    )
    more = f"; {len(wrong) - MOST_REGIONS} more" if len(wrong) > MOST_REGIONS else ""
    return [f"{start}: the model, not the noise, is wrong here. {each}{more}."]


@answer
class WhereItFails(OnSeenTakes):
    """What each rotation's error depends on, the rotation farthest above its noise floor first."""

    rotations: Sequence[RotationFindings]
    """The one farthest above its noise floor first."""
    stretches: Sequence[Stretch]
    """The worst seconds, worst first."""
    cross_validation_difference: CrossValidationDifference | None = None
    """Null where it was not asked for, or there are no two halves."""
    sentences: Sequence[str] = ()
    """About the cross-validation difference, if asked for."""

    def findings(self, rotation: str) -> RotationFindings:
        """Of one rotation. Raises BadInput when it was not measured."""
        for item in self.rotations:
            if item.rotation == rotation:
                return item
        names = [item.rotation for item in self.rotations]
        raise BadInput(f"no rotation {rotation!r} was measured; {did_you_mean(rotation, names)}")

    def depends_on(self, rotation: str) -> tuple[str, ...]:
        """Columns on which the rotation's error depends significantly, the strongest first."""
        return tuple(item.covariate for item in self.findings(rotation).structure)

    def plot(self, rotation: str | None = None, column: str | None = None, *, ax: Axes | None = None) -> Axes:
        """Mean error of a rotation against a column, with what chance does to it (95 %); gives the axes back.

        Default: the first rotation, and the column that explains most of its error. Raises BadInput for a
        rotation or column that was not tested, ImportError without matplotlib.
        """
        if rotation is None and not self.rotations:
            raise BadInput("no rotation was measured, so there is nothing to draw")
        found = self.findings(rotation or self.rotations[0].rotation)
        return plotted(found.dependence(column).chart(found.rotation, found.rmse_deg), ax)

    @property
    def verdict(self) -> Fact:
        done, every = sum(item.is_at_floor for item in self.rotations), len(self.rotations)
        if done == every:
            return Fact("Verdict", f"All of {counted(done, 'rotation')} are at their noise floor.")
        above = f"{every - done} of {counted(every, 'rotation')} above their noise floor."
        return Fact("Verdict", above)

    @property
    def place(self) -> list[Fact]:
        return [
            Fact("Place", f"largest possible improvement: {item.sentence}") for item in self.rotations[:1]
        ]

    @property
    def next(self) -> list[Fact]:
        if self.model is None:
            return []
        verb = "model activate" if all(item.is_at_floor for item in self.rotations) else "diagnose"
        return [Fact("Next", f"glovecal {verb} {self.model[:12]}", is_command=True)]

    def presentation(self) -> Presentation:
        facts = [self.verdict, *self.known_ceiling, self.takes_named, *self.next]
        title = f"Where the model fails on {self.about}"
        return Presentation(title, facts, seen_note([self]), self.sections())

    def sections(self, pictures: Mapping[str, Sequence[Part]] | None = None) -> list[Section]:
        """``pictures`` of single rotations, above those that follow from the answer alone."""
        each = [
            item.sentence if item.wearings is None else f"{item.sentence}\n    {item.wearings.sentence}"
            for item in self.rotations
        ]
        return [
            Section("Each rotation", [Lines(each)] if each else []),
            Section("Cross-validation", [Lines(self.sentences)] if self.sentences else []),
            Section(
                "What the error depends on",
                [self._heat_map(), self._dependences()] if self.rotations else [],
                is_detail=True,
            ),
            *(
                Section(
                    f"Rotation {item.rotation}",
                    [item.sentence, *(pictures or {}).get(item.rotation, ()), Pictures(item.charts())],
                    is_detail=True,
                )
                for item in self.rotations[:CLOSE_UPS]
            ),
            Section("The worst seconds", [self._stretches()]),
            Section(NOISE_FLOORS, self._floors(), is_detail=True),
        ]

    def _dependences(self) -> Table:
        """A row for each rotation, with the column that explains most."""
        columns = [
            Column("rotation"), Column("rmse_deg", "RMSE"), Column("noise_floor_deg", "noise floor"),
            Column("bias_deg", "bias"), Column("depends_on", "depends on", folds=True),
            Column("explained_deg", "RMS contribution"), Column("p_value", "p", 3), Column("significant"),
        ]  # fmt: skip
        rows: list[Sequence[Cell]] = []
        for item in self.rotations:
            floor = None if item.floor is None else item.floor.floor_deg
            first = next(iter((*item.structure, *item.dependences)), None)
            explained: Sequence[Cell] = (None, None, None, False)
            if first is not None:
                explained = (first.covariate, first.explained_deg, first.p_value, first.is_structure)
            rows.append((item.rotation, item.rmse_deg, floor, item.bias_deg, *explained))
        return Table(columns, rows, legend="Degrees.")

    def _stretches(self) -> Table:
        columns = [
            Column("take"), Column("seconds"), Column("pose"), Column("rmse_deg", "RMSE (deg)"),
            Column("rotation", "worst rotation"), Column("rotation_rmse_deg", "its RMSE"),
        ]  # fmt: skip
        rows = [
            (
                one.take, f"{one.start_s:.1f} to {one.end_s:.1f}", one.pose or None, one.rmse_deg,
                one.rotation, one.rotation_rmse_deg,
            )
            for one in self.stretches
        ]  # fmt: skip
        return Table(columns, rows, empty="No take is long enough.")

    def _floors(self) -> list[Part]:
        known = [
            how for how in ORDER if any(one.how == how for item in self.rotations for one in item.floors)
        ]
        estimates = [Column(how, folds=True) for how in known]
        columns = [Column("rotation"), Column("rmse_deg", "RMSE"), *estimates, Column("slow")]
        rows: list[Sequence[Cell]] = []
        for item in self.rotations:
            cells = {one.how: one.with_interval for one in item.floors}
            slow = None if item.slow is None else round(100 * item.slow.share)
            rows.append((item.rotation, item.rmse_deg, *map(cells.get, known), slow))
        doubts = doubted_floors({item.rotation: item.floor for item in self.rotations})
        said = [f"Not reliable ({names}): {reason}." for names, reason in doubts]
        table = Table(columns, rows, legend=FLOORS, empty="Nothing was measured.")
        return [table, Lines(said)] if said else [table]

    def _heat_map(self) -> Chart:
        """Rotations by columns: share of the error that each column explains; significant ones marked."""
        cells = [_cells(item) for item in self.rotations]
        sizes: dict[str, float] = {}
        for of_rotation in cells:
            for name, (explained, _) in of_rotation.items():
                sizes[name] = max(sizes.get(name, 0.0), explained)
        columns = sorted(sizes, key=lambda name: (*_place(name), -sizes[name]))[:MOST_COLUMNS]
        shape = (len(self.rotations), len(columns))
        values, significant = np.full(shape, np.nan), np.zeros(shape, dtype=bool)
        for row, item in enumerate(self.rotations):
            for column, name in enumerate(columns):
                explained, significant[row, column] = cells[row].get(name, (np.nan, False))
                values[row, column] = explained / max(item.rmse_deg, 1e-12)

        def draw(axes: Axes) -> None:
            draw_heat(axes, values, significant, 1, "share of the rotation's RMSE")
            axes.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
            axes.set_yticks(range(len(self.rotations)), [item.rotation for item in self.rotations])

        return Chart(draw, 2.5 + 0.32 * len(columns), 2.2 + 0.24 * len(self.rotations), self._largest())

    def _largest(self) -> str:
        """The largest significant dependence."""
        marked = [(item, one) for item in self.rotations for one in item.structure]
        if not marked:
            return f"{HEAT} No recorded column explains a significant part of any error."
        item, one = max(marked, key=lambda pair: pair[1].explained_deg)
        return (
            f"{HEAT} The largest: {one.phrase}, RMS contribution {one.explained_deg:.1f} of "
            f"{item.rmse_deg:.1f} degrees at {item.rotation}."
        )


def _place(name: str) -> tuple[int, bool]:
    """Where a column stands in the heat map."""
    return (LEADING.index(name) if name in LEADING else len(LEADING), not name.startswith("context "))


def _cells(item: RotationFindings) -> dict[str, tuple[float, bool]]:
    """For each column of the heat map: degrees explained, and whether that is significant."""
    cells = {one.covariate: (one.explained_deg, one.is_structure) for one in item.dependences}
    if item.wearings is not None:
        cells["wearing"] = (item.wearings.spread_deg, item.wearings.is_significant)
    return cells
