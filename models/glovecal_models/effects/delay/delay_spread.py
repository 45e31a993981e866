"""Whether a delay spreads what it delays: swings that change their speed tell a filter from a mere delay.

A short delay of mean time T whose answer to an impulse has the variance V differs from a mere delay by V / 2
times the angle's second derivative. So V / T^2 tells the form, whatever it is: 0 of a mere delay, 1/3 of a
moving average, 0.55 of two poles, 1 of one pole. It is measured by what one pole as late would leave beside a
mere delay. While swings keep their speed that follows the angle, and a gain that is a little wrong looks like
it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.effects.base.assessment import block_starts
from glovecal_models.effects.base.comparison import Problem
from glovecal_models.effects.base.signals import Signals
from glovecal_models.effects.delay.delay_grid import FILTERS, SHORT_ROWS, base_slope
from glovecal_models.effects.delay.moved_angles import STEP_S, DelayForm, FineAngles, MovedCells

SWINGS_PER_S = 5.0
"""RMS speed of a joint that swings, over its standard deviation in the same rows: 0.8 Hz. Free motion of
simulated hands has 0.8 to 2.0 (2026-11-29)."""
SWING_SHARE = 0.4
"""Of a joint's usual deviation: less is trembling."""
OF_ITS_OWN = 0.1
"""Of the squares of what one pole would leave, that a gain, its change with the angle and a delay do not
tell."""
CLEAR_SE = 2.0
"""By so many standard errors a form has to miss what was found."""
UNLIKE = 0.2
"""And by so much: 25 simulated gloves that were late, or their clock, had -0.40 to 0.12 (2026-11-29). Beyond
twice it below zero lies a sensor that overshoots, which is none of the forms."""
TRIED = (
    DelayForm.PURE,
    DelayForm.MOVING_AVERAGE,
    DelayForm.DELAYED_WINDOW,
    DelayForm.ONE_POLE,
    DelayForm.TWO_POLES,
)
"""In the order in which cells are worked out."""
ONE = TRIED.index(DelayForm.ONE_POLE) - 1
"""Its place behind the mere delay."""


@dataclass(frozen=True)
class DelaySpread:
    """Of the delay of some takes, in that of one pole as late."""

    share: float
    se: float
    """Standard error, by blocks of a second."""
    of_form: Mapping[DelayForm, float]
    """What each form has in the same motion: for short delays V / T^2."""

    @property
    def is_mere_delay(self) -> bool:
        """Whether no filter is left."""
        return self.may_be(DelayForm.PURE) and not any(map(self.may_be, FILTERS))

    def may_be(self, form: DelayForm) -> bool:
        """Whether what was found does not rule a form out."""
        least, most = self.share - CLEAR_SE * self.se, self.share + CLEAR_SE * self.se
        own = self.of_form[form]
        # An average over two frames spreads as one pole does; sensors that answer faster one way spread more.
        largest = {DelayForm.MOVING_AVERAGE: 1.0, DelayForm.ONE_POLE: np.inf}.get(form, own)
        return own <= max(most, UNLIKE) and least <= largest + UNLIKE and most >= -2 * UNLIKE


def delay_spread(problem: Problem, late_s: float) -> DelaySpread | None:
    """Of a delay of ``late_s``, by the rows in which joints swing; None where none do, or none change their
    speed."""
    steps = round(late_s / STEP_S)
    if steps < 1:
        return None
    fine: dict[int, FineAngles] = {}
    usual_deg = np.concatenate([take.own for take in problem.signals]).std(axis=0)
    cells = MovedCells.of(np.array(TRIED), np.full(len(TRIED), steps * STEP_S))
    products, squares = [], []
    for joint, of_joint in enumerate(problem.products):
        for unit, (take, rows) in zip(of_joint.units, problem.units(joint), strict=True):
            angle, time_s = problem.signals[take].own[rows, joint], problem.signals[take].time_s[rows]
            if len(rows) < SHORT_ROWS:
                continue
            speed = np.gradient(angle, time_s)
            if not _swings(angle, speed, float(usual_deg[joint])):
                continue
            slope = base_slope(unit.base, of_joint.whole, angle)
            if take not in fine:
                fine[take] = FineAngles.of(problem.signals[take].time_s, problem.signals[take].own)
            (moved,) = cells.of_tracks([fine[take].track(joint, rows)])
            late, *others = *moved.read, *(moved.passed[0].T + moved.rested[0])
            left = unit.target - unit.base @ of_joint.whole - slope * (late - angle)
            spread = np.column_stack([slope * (other - late) for other in others])
            own = _own(spread[:, ONE], angle, slope, speed)
            if own is None:
                continue
            starts = block_starts([len(rows)], SHORT_ROWS)
            products.append(np.add.reduceat(own * left, starts))
            squares.append(np.add.reduceat(own[:, None] * spread, starts))
    if not squares:
        return None
    along, forms = np.concatenate(products), np.concatenate(squares)
    whole = float(forms[:, ONE].sum())
    share = float(along.sum()) / whole
    se = float(np.linalg.norm(along - share * forms[:, ONE])) / whole
    shares = [0.0, *(forms.sum(axis=0) / whole).tolist()]
    of_form: dict[DelayForm, float] = dict(zip(TRIED, shares, strict=True))
    return DelaySpread(share, se, of_form)


def shows_spread(takes: Sequence[Signals]) -> bool:
    """Whether a joint swings in one of them and changes its speed: another such take tells no more."""
    usual_deg = np.concatenate([take.own for take in takes]).std(axis=0)
    for take in takes:
        if len(take) < SHORT_ROWS:
            continue
        speeds = np.gradient(take.own, take.time_s, axis=0)
        bends = np.gradient(speeds, take.time_s, axis=0)
        for angle, speed, bend, usual in zip(take.own.T, speeds.T, bends.T, usual_deg, strict=True):
            if _swings(angle, speed, usual) and _own(bend, angle, np.ones_like(angle), speed) is not None:
                return True
    return False


def _swings(angle: np.ndarray, speed: np.ndarray, usual_deg: float) -> bool:
    """``angle`` (N,) and its ``speed``, of a joint that usually deviates by so much."""
    deviation = float(angle.std())
    return (
        deviation > SWING_SHARE * usual_deg and float(np.sqrt(np.mean(speed**2))) > SWINGS_PER_S * deviation
    )


def _own(spread: np.ndarray, angle: np.ndarray, slope: np.ndarray, speed: np.ndarray) -> np.ndarray | None:
    """What of ``spread`` (N,) no gain, change of gain with the angle, or delay tells; None where that is too
    little."""
    about = (angle - angle.mean()) / angle.std()
    columns = np.column_stack([np.ones_like(angle), slope * about, slope * about**2, slope * speed])
    known, _ = np.linalg.qr(columns)
    own = spread - known @ (known.T @ spread)
    return own if own @ own > OF_ITS_OWN * (spread @ spread) else None
