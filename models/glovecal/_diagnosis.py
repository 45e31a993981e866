"""Which physical effect is missing."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import Progress, library_call
from glovecal._effects import declared
from glovecal._model import CalibrationModel, inner_model
from glovecal._plotting import CONTROL, MODEL, axes_for, finished, named_rows
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal._takes import takes_in
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.diagnosis.diagnosis import Diagnosis as InnerDiagnosis

COLUMNS = (
    Column("effect"), Column("rotations"), Column("rmse_deg"), Column("with_effect_rmse_deg"),
    Column("with_control_rmse_deg"), Column("p_value", 3), Column("significant"),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """Evidence for physical effects that a model does not have, each beside its control."""

    inner: InnerDiagnosis
    """``glovecal_models.diagnosis.diagnosis.Diagnosis``: evidence for each rotation and block of time."""
    set_aside: tuple[str, ...] = ()
    """A sentence on each take that does not fit the others, and what would make it fit."""

    @property
    def effect(self) -> str | None:
        """The effect that is named; None when none is."""
        named = self.inner.named
        return None if named is None else named.effect

    @property
    def rotations(self) -> tuple[str, ...]:
        """Where the named effect acts; sensors or takes where it is a fault of those."""
        named = self.inner.named
        return () if named is None else named.where

    @property
    def confidence_set(self) -> tuple[str, ...]:
        """The named effect, and all that these takes cannot tell from it."""
        named = self.inner.named
        return () if named is None else named.confidence_set

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to know, the most important first."""
        from glovecal_models.diagnosis.text import diagnosis_sentences

        return (*self.set_aside, *diagnosis_sentences(self.inner))

    @property
    def not_identifiable(self) -> dict[str, str]:
        """Effects that these takes cannot show, and why."""
        return {item.effect: item.why for item in self.inner.not_identifiable}

    @property
    def next_take(self) -> str | None:
        """What to record to tell the confidence set apart; None when there is nothing to tell apart."""
        following = self.inner.next_take
        return None if following is None else f"{following.seconds} s: {following.what}"

    def table(self) -> Table:
        """One row for each effect that was tried, those that beat their control first."""
        rows = [
            (
                item.effect, ", ".join(item.joints[i] for i in item.significant_joints), item.rmse_deg.before,
                item.rmse_deg.after, item.rmse_deg.control, item.p_value, bool(item.significant_joints),
            )
            for item in self.inner.ranked_assessments
        ]  # fmt: skip
        return Table.of(COLUMNS, rows, after=self.sentences)

    def plot(self, ax: Axes | None = None) -> Axes:
        """What each effect saves of the smoothed error beside what its control saves; gives the axes back."""
        tried = self.inner.ranked_assessments
        axes = axes_for(ax, len(tried))
        errors = [item.rmse_deg for item in tried]
        for shift, saved, color, label in (
            (-0.18, [item.before - item.after for item in errors], MODEL, "effect"),
            (0.18, [item.before - item.control for item in errors], CONTROL, "control"),
        ):
            rows = [row + shift for row in range(len(tried))]
            axes.barh(rows, saved, height=0.34, color=color, label=label)
        named_rows(axes, [item.effect + (" *" if item.significant_joints else "") for item in tried])
        axes.axvline(0.0, color="black", linewidth=0.6)
        axes.set_xlabel("saved of the smoothed error (degrees); *: significant")
        return finished(axes)


def diagnose(
    model: CalibrationModel,
    takes: Take | Iterable[Take],
    *,
    also: Sequence[str] = (),
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Diagnosis:
    """Try every known effect on held-out takes, beside a control with the same freedom that cannot be right.

    A take that does not fit the others is set aside first, and told. ``also``: effects of your own as text,
    such as ``"name = strap; columns = c.strap_n * own"``. ``seed`` is of the controls. Raises BadInput,
    Cancelled.
    """
    from glovecal_models.diagnosis.model_on_takes import diagnose_model

    inner, takes = inner_model(model), takes_in(takes)
    own = declared(also)
    with library_call(progress) as report:
        found = diagnose_model(inner, takes, own=own, seed=seed, cancelled=cancelled, report=report)
    return Diagnosis(found.diagnosis, tuple(item.told for item in found.odd if item.is_set_aside))
