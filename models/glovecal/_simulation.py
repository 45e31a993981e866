"""A simulated session, so that everything can be tried without hardware."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import library_call
from glovecal._layouts import LayoutLike, layout_for
from glovecal._shown import Shown
from glovecal._table import Table
from glovecal._takes import Takes
from glovecal_models.errors import BadInput
from glovecal_models.layout import Layout
from glovecal_models.names import did_you_mean

if TYPE_CHECKING:
    from glovecal_models.simulation.session import RecordedSession


@dataclass(frozen=True, eq=False, repr=False)
class Session(Shown):
    """Takes of a simulated glove; every one of them is marked as simulated, in files too."""

    layout: Layout
    """Its sensors and rotations."""
    takes: Takes
    """In the order of recording."""
    inner: RecordedSession
    """``glovecal_models.simulation.session.RecordedSession``: also the true angles, and each take as it would
    be without what is hidden."""

    @property
    def hidden(self) -> str | None:
        """The effect that is hidden in the takes; None in a healthy glove."""
        return self.inner.causes[0].name if self.inner.causes else None

    @property
    def hidden_on(self) -> tuple[str, ...]:
        """The sensors it acts on."""
        return self.inner.causes[0].channels if self.inner.causes else ()

    def table(self) -> Table:
        """One row for each take; what is hidden is not told."""
        takes = self.takes.table()
        title = f"SIMULATED session of {len(self.takes)} takes, layout {self.layout.name}"
        return Table.of(takes.columns, takes.rows, before=[title])


def simulate(
    effect: str | None = "hysteresis",
    *,
    on: Sequence[str] | None = None,
    strength_deg: float = 3.0,
    form: str | None = None,
    layout: LayoutLike = None,
    sensors: Sequence[str] = ("I_MCP", "I_PIP", "M_MCP", "M_PIP", "R_MCP"),
    wearings: int = 3,
    takes_per_wearing: int = 3,
    take_s: float = 20.0,
    seed: int = 0,
) -> Session:
    """Record a simulated glove with one effect hidden in it. The same arguments give the same takes.

    ``effect``: a name of ``effects()``, ``unknown:...`` for a cause outside the catalogue, None for a healthy
    glove. ``on``: the sensors it acts on; None draws them. ``strength_deg``: RMS of what no static
    calibration explains. ``form``: how the effect is generated; None draws one. ``layout`` simulates a whole
    glove such as ``cyberglove18``, else there is one rotation for each of ``sensors``. Raises BadInput.
    """
    from glovecal_models.simulation.causes.form import Cause
    from glovecal_models.simulation.session import record_session
    from glovecal_models.simulation.session_plan import SessionPlan

    size = {"seed": seed, "wearings": wearings, "takes_per_wearing": takes_per_wearing, "take_s": take_s}
    if layout is None:
        given = Layout.from_columns("simulated", tuple(sensors), tuple(sensors))
        plan = SessionPlan(sensors=tuple(sensors), **size)
    else:
        given = layout_for(layout, ())
        plan = SessionPlan.of_layout(given, **size)
    unknown = [name for name in on or () if name not in plan.sensors]
    if unknown:
        raise BadInput(f"no sensor {unknown[0]!r}; {did_you_mean(unknown[0], plan.sensors)}")
    channels = None if on is None else tuple(on)
    causes = [] if effect is None else [Cause(effect, form, strength_deg=strength_deg, channels=channels)]
    with library_call():
        recorded = record_session(plan, causes)
    return Session(given, Takes(recorded.takes), recorded)
