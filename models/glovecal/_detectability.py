"""What takes could have shown: how large an effect must be to be named in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import Progress, library_call
from glovecal._effects import declared
from glovecal._layouts import LayoutLike, layout_for
from glovecal._model import CalibrationModel, inner_model
from glovecal._plotting import MODEL, axes_for, finished
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal._takes import takes_in
from glovecal_models.progress import Cancel
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from glovecal_models.diagnosis.detectability.confusability import Confusability
    from glovecal_models.diagnosis.detectability.detection import Control, Detectability

COLUMNS = (
    Column("effect"), Column("rotations"), Column("size_deg"), Column("trials"), Column("named"),
    Column("ambiguous"), Column("mistaken"), Column("not_found"),
)  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Detectable(Shown):
    """Trials with effects of known size in the session's own readings, and effects that look alike."""

    inner: tuple[Detectability, ...]
    """``glovecal_models.diagnosis.detectability.detection.Detectability`` of each effect."""
    control: Control
    """The same trials with nothing put in."""
    confusability: Confusability
    """Which effects these takes make alike, before anything is named."""

    @property
    def named_80_deg(self) -> dict[str, float | None]:
        """By effect the size that 80 % of the trials name alone; None: none that was tried."""
        return {item.effect: item.size_deg(0.8, "named") for item in self.inner}

    @property
    def not_possible(self) -> dict[str, str]:
        """Effects that cannot be put in, and why."""
        return {item.effect: item.why_not for item in self.inner if item.why_not is not None}

    @property
    def sentences(self) -> tuple[str, ...]:
        """What to know, the most important first."""
        from glovecal_models.diagnosis.detectability.text import (
            confusability_sentences,
            control_sentence,
            detectability_sentence,
        )

        tried = [detectability_sentence(item) for item in self.inner]
        return (*tried, control_sentence(self.control), *confusability_sentences(self.confusability))

    def table(self) -> Table:
        """One row for each effect and size: what the trials ended in."""
        rows = [
            (
                item.effect, ", ".join(item.rotations), size.size_deg, len(size.trials),
                size.count("named"), size.count("ambiguous"), size.count("mistaken"), size.count("not found"),
            )
            for item in self.inner
            for size in item.sizes
        ]  # fmt: skip
        return Table.of(COLUMNS, rows, after=self.sentences)

    def plot(self, ax: Axes | None = None) -> Axes:
        """The share of trials that name each effect alone, over its size; gives the axes back."""
        axes = axes_for(ax)
        for item in self.inner:
            tried = [size for size in item.sizes if size.trials]
            if tried:
                shares = [100 * size.share("named") for size in tried]
                only = len(self.inner) == 1
                axes.plot(
                    [size.size_deg for size in tried],
                    shares,
                    marker="o",
                    color=MODEL if only else None,
                    label=item.effect,
                )
        axes.set_xlabel("size of the effect, degrees RMS beyond any static map")
        axes.set_ylabel("trials that name it alone, %")
        return finished(axes)


def detectable(
    takes: Take | Iterable[Take],
    effects: str | Sequence[str],
    *,
    model: CalibrationModel | None = None,
    layout: LayoutLike = None,
    rotations: Sequence[str] | None = None,
    sizes_deg: Sequence[float] = (0.5, 1.0, 2.0, 4.0),
    trials: int = 3,
    also: Sequence[str] = (),
    seed: int = 0,
    cancelled: Cancel | None = None,
    progress: Progress = None,
) -> Detectable:
    """Put effects of known size into these takes, made perfect otherwise, and diagnose them again.

    ``model``: its effects and layout count; without one the takes are looked at by themselves. ``rotations``:
    put in there at once; None for all. ``also``: effects of your own as text, put in by their names as well.
    A trial takes seconds. Raises BadInput, Cancelled.
    """
    from glovecal_models.diagnosis.detectability.confusability import confusability
    from glovecal_models.diagnosis.detectability.detection import Control, detectability, trial
    from glovecal_models.diagnosis.detectability.surrogate_session import SurrogateSession
    from glovecal_models.diagnosis.model_on_takes import ModelOnTakes
    from glovecal_models.effects.catalogue import effect

    recorded, own = takes_in(takes), declared(also)
    names = [effects] if isinstance(effects, str) else list(effects)
    names = list(dict.fromkeys([*names, *(item.name for item in own)]))
    with library_call(progress) as report:
        if model is None:
            on = ModelOnTakes(tuple(recorded), layout_for(layout, recorded), own=tuple(own))
        else:
            on = ModelOnTakes.of(inner_model(model), recorded, own)
        session, own_names = SurrogateSession.of(on), {item.name: item for item in on.own}
        report("comparing effects with each other", 0.0)
        alike = confusability(session.problem, declared=on.own)
        report("trials with nothing put in", 0.05)
        nothing = [trial(session, None, (), 0.0, seed=seed + i, cancelled=cancelled) for i in range(trials)]
        found = []
        for number, name in enumerate(names):
            report(f"trials of {name}", 0.1 + 0.9 * number / max(len(names), 1))
            put_in = own_names.get(name) or effect(name)
            found.append(
                detectability(
                    session, put_in, rotations, sizes_deg, trials=trials, seed=seed, cancelled=cancelled
                )
            )
    return Detectable(tuple(found), Control(tuple(item for item in nothing if item is not None)), alike)
