"""What one frame's angles are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from glovecal._calls import library_call
from glovecal._model import CalibrationModel, inner_model
from glovecal._shown import Shown
from glovecal._table import Column, Table
from glovecal_models.errors import BadInput
from glovecal_models.names import did_you_mean
from glovecal_models.takes.take import Take

if TYPE_CHECKING:
    from glovecal_models.calibration.explanation import AngleTerms
    from glovecal_models.calibration.explanation import Explanation as InnerExplanation

COLUMNS = (Column("rotation"), Column("term"), Column("degrees"), Column("sd_deg"))


@dataclass(frozen=True, eq=False, repr=False)
class Explanation(Shown):
    """The terms of each angle of one frame; they add up to what is predicted."""

    rotations: tuple[str, ...]
    """Those that are explained."""
    inner: InnerExplanation
    """``glovecal_models.calibration.explanation.Explanation``: also variances, readings, measured angles."""

    @property
    def time_s(self) -> float:
        """When the frame was read, seconds by the take's clock."""
        return self.inner.frame.time_s

    @property
    def degrees(self) -> dict[str, float]:
        """The predicted angles by rotation."""
        return {item.rotation: item.degrees for item in self._angles}

    @property
    def sd_deg(self) -> dict[str, float]:
        """Standard deviation of a measurement of each rotation, noise included."""
        return {item.rotation: item.sd_deg for item in self._angles}

    @property
    def sentences(self) -> tuple[str, ...]:
        """Transients, faulty sensors, what is not stored, and what was measured."""
        from glovecal_models.calibration.text import angle_sentences, frame_sentences

        said = [
            f"{item.rotation}: {sentence}"
            for item in self._angles
            for sentence in angle_sentences(item, self.inner.measured.get(item.rotation))
        ]
        return (*frame_sentences(self.inner.frame), *said)

    def terms(self, rotation: str) -> dict[str, float]:
        """Degrees by term, in the order in which they are applied; several effects of one name are added up.

        Raises BadInput for a rotation that is not explained.
        """
        for item in self._angles:
            if item.rotation == rotation:
                found: dict[str, float] = {}
                for term in item.terms:
                    found[term.name] = found.get(term.name, 0.0) + term.degrees
                return found
        raise BadInput(f"rotation {rotation!r} is not explained; {did_you_mean(rotation, self.rotations)}")

    def table(self) -> Table:
        """One row for each term, then one for the angle."""
        rows = []
        for item in self._angles:
            rows += [(item.rotation, term.name, term.degrees, term.sd_deg) for term in item.terms]
            rows.append((item.rotation, "angle", item.degrees, item.sd_deg))
        mark = ", SIMULATED" if self.inner.simulated else ""
        title = f"Take {self.inner.take}, frame {self.inner.number} at {self.time_s:.3f} s{mark}"
        return Table.of(COLUMNS, rows, before=[title], after=self.sentences)

    @property
    def _angles(self) -> list[AngleTerms]:
        return [item for item in self.inner.frame.angles if item.rotation in self.rotations]


def explain(
    model: CalibrationModel, take: Take, at_s: float, *, rotations: Sequence[str] | None = None
) -> Explanation:
    """What the angles of the frame nearest to ``at_s`` (seconds by the take's clock) are made of.

    Raises BadInput for a time outside the take and for a rotation that the model does not have.
    """
    from glovecal_models.calibration.explanation import chosen_rotations
    from glovecal_models.calibration.explanation import explain as explain_frame

    inner = inner_model(model)
    chosen = chosen_rotations(inner, rotations or ())
    with library_call():
        return Explanation(chosen, explain_frame(inner, take, at_s))
