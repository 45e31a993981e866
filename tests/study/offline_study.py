"""``python3 do.py study offline``: what both directions of time save, or a delay, on takes that no model saw.

Simulated gloves; each model has the effect that its glove hides, and was trained without the last take of
every wearing. Errors of those takes are against the true angles, which a reference's noise would hide; the
95 % interval is asked of measurements, of which every claim is. Gloves of smaller numbers were looked at
while the method was made.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.offline import OfflinePredictor
from glovecal_models.calibration.predictor import GloveAngles, GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.delay_answer import DELAYS_MS, draw_delay_curves
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.presentation.document import Chart
from glovecal_models.presentation.drawing import GREY, png
from glovecal_models.simulation.causes.form import Cause
from glovecal_models.simulation.session import RecordedSession, record_session
from glovecal_models.simulation.session_plan import SessionPlan
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import pin_blas_to_one_thread

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SENSORS = ("I_MCP", "I_PIP", "M_MCP")
WEARINGS, TAKES, TAKE_S = 2, 4, 30.0
FIRST_SEED, GLOVES = 9100, 6
TUNED_SEED = 9000
"""The first of the gloves that were looked at."""
HALF_95 = 1.959964


@dataclass(frozen=True)
class Condition:
    """What a glove hides, how noisy its sensors are, and what is asked."""

    name: str
    effect: str | None
    strength_deg: tuple[float, ...] = ()
    noise_deg: float = 0.3
    at_most: float | None = None
    """Error offline, in those live."""


CONDITIONS = (
    Condition("noise alone", None, at_most=0.6),
    Condition("noise alone, 1 degree", None, noise_deg=1.0, at_most=0.6),
    Condition("lag", "lag", (2.3, 3.0, 3.8), at_most=0.4),
    Condition("lag, noise of 1 degree", "lag", (2.3, 3.0, 3.8), noise_deg=1.0, at_most=0.4),
    Condition("creep", "creep", (1.5, 2.5, 3.5), at_most=0.8),
    Condition("creep, noise of 1 degree", "creep", (1.5, 2.5, 3.5), noise_deg=1.0, at_most=0.8),
    Condition("hysteresis", "hysteresis", (1.5, 2.5, 3.5)),
)


DELAYS_S = (*(delay / 1000 for delay in DELAYS_MS), float("inf"))


class Found(NamedTuple):
    """Of one glove live, with each of ``DELAYS_MS``, and offline."""

    rms_deg: tuple[float, ...]
    inside: tuple[float, ...]
    """Shares of measurements inside the 95 % interval."""
    about: str


def session_of(condition: Condition, seed: int) -> RecordedSession:
    plan = SessionPlan(
        seed=seed, sensors=SENSORS, wearings=WEARINGS, takes_per_wearing=TAKES, take_s=TAKE_S,
        nuisance="white", sensor_noise_deg=condition.noise_deg, bits=(8, 10, 12)[seed % 3],
        rate_hz=(60.0, 100.0)[seed % 2],
    )  # fmt: skip
    if condition.effect is None:
        return record_session(plan)
    strength = condition.strength_deg[seed % len(condition.strength_deg)]
    return record_session(plan, [Cause(condition.effect, strength_deg=strength)])


def split(session: RecordedSession) -> tuple[list[int], list[int]]:
    """Takes to train with, and the last of each wearing."""
    held = [number for number in range(len(session.takes)) if (number + 1) % TAKES == 0]
    return [number for number in range(len(session.takes)) if number not in held], held


def model_of(condition: Condition, takes: Sequence[Take]) -> CalibrationModel:
    layout = Layout.from_columns("study", SENSORS, SENSORS)
    settings = TrainingSettings(method="lmc_gpr", folds=2)
    plain = train(takes, layout, "study", settings)
    if condition.effect is None:
        return plain
    return add_effect(plain, takes, condition.effect, settings=settings, least_gain=-9).model


def found_of(condition: Condition, seed: int) -> Found:
    session = session_of(condition, seed)
    known, held = split(session)
    model = model_of(condition, [session.takes[number] for number in known])
    rows = [session.plan.rotations.index(name) for name in model.rotation_names]
    errors, inside = [], []
    for number in held:
        take = session.takes[number]
        asked = take.time_s, take.readings, take.context, take.wearing
        each = [
            GlovePredictor(model).predict_take(*asked),
            *OfflinePredictor(model).predict_delayed(*asked, DELAYS_S),
        ]
        errors.append([angles.mean - session.truth[number][:, rows] for angles in each])
        inside.append([_inside(angles, take, model) for angles in each])
    return Found(
        tuple(float(np.sqrt(np.mean(np.concatenate(one) ** 2))) for one in zip(*errors, strict=True)),
        tuple(float(np.mean(np.concatenate(one))) for one in zip(*inside, strict=True)),
        _about(session),
    )


def _inside(angles: GloveAngles, take: Take, model: CalibrationModel) -> np.ndarray:
    reference = take.reference_at_frames(model.rotation_names)
    known = np.isfinite(reference)
    return (np.abs(angles.mean - reference) <= HALF_95 * angles.sd)[known]


def _about(session: RecordedSession) -> str:
    if not session.causes:
        return ""
    cause = session.causes[0]
    sizes = list(cause.sizes.values())
    said = f"{1000 * min(sizes):.0f} to {1000 * max(sizes):.0f} ms" if cause.name == "lag" else ""
    return f"{cause.form} {said}".strip()


def rms_of(found: Sequence[Found]) -> np.ndarray:
    """Over all gloves, in the order of ``Found.rms_deg``, degrees."""
    return np.sqrt(np.mean(np.square([one.rms_deg for one in found]), axis=0))


def row_of(condition: Condition, found: Sequence[Found]) -> str:
    """Ratio of the errors over all gloves, with the smallest and largest of single ones."""
    live, *_, offline = rms_of(found)
    each = [one.rms_deg[-1] / one.rms_deg[0] for one in found]
    asked = "" if condition.at_most is None else f"at most {condition.at_most:g}"
    inside = np.mean([one.inside for one in found], axis=0)
    cells = (
        condition.name, str(len(found)), f"{live:.2f}", f"{offline:.2f}", f"{offline / live:.2f}",
        f"{min(each):.2f} to {max(each):.2f}", asked, f"{100 * inside[0]:.1f} %", f"{100 * inside[-1]:.1f} %",
    )  # fmt: skip
    return f"| {' | '.join(cells)} |"


def curve_row_of(condition: Condition, found: Sequence[Found]) -> str:
    """Errors in degrees, and the shares inside the interval with each delay."""
    inside = 100 * np.mean([one.inside for one in found], axis=0)[1:-1]
    errors = [f"{each:.2f}" for each in rms_of(found)]
    cells = (condition.name, *errors, f"{inside.min():.1f} to {inside.max():.1f} %")
    return f"| {' | '.join(cells)} |"


def draw_curves(found: Mapping[str, Sequence[Found]], path: Path) -> None:
    """Errors in those live, a curve for each condition by its name."""
    curves = {name: (rms := rms_of(each)) / rms[0] for name, each in found.items()}

    def draw(axes: Axes) -> None:
        draw_delay_curves(axes, curves, "error over live error")
        axes.axhline(1.0, color=GREY, linewidth=0.8, linestyle="--")

    path.write_bytes(png(Chart(draw, 7, 3.6, "")))


HEAD = (
    "| hidden, and in the model | gloves | live, deg | offline, deg | ratio | of single gloves | asked "
    "| inside 95 %, live | offline, asked 92 to 98 % |\n" + "|---" * 9 + "|"
)
CURVE_HEAD = (
    "| hidden, and in the model | live, deg | "
    + " | ".join(f"{delay} ms" for delay in DELAYS_MS)
    + " | offline | inside 95 % with a delay |\n"
    + "|---" * (len(DELAYS_MS) + 4)
    + "|"
)


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="do.py study offline", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--gloves", type=int, default=GLOVES, metavar="N", help=f"per row (default {GLOVES})")
    parser.add_argument("--only", default="", metavar="TEXT", help="rows whose name begins so")
    tuned = "the gloves that were looked at while the method was made"
    parser.add_argument("--tuned", action="store_true", help=tuned)
    parser.add_argument("--folder", type=Path, default=Path(".study"), help="for tables and picture")
    parser.add_argument("--smoke", action="store_true", help="one glove without a hidden effect, no files")
    options = parser.parse_args(arguments)
    pin_blas_to_one_thread()
    if options.smoke:
        found = [found_of(CONDITIONS[0], TUNED_SEED)]
        print(HEAD, row_of(CONDITIONS[0], found), CURVE_HEAD, curve_row_of(CONDITIONS[0], found), sep="\n")
        return 0
    first, rows, curves = TUNED_SEED if options.tuned else FIRST_SEED, [HEAD], [CURVE_HEAD]
    of_all: dict[str, list[Found]] = {}
    print(HEAD, flush=True)
    for condition in CONDITIONS:
        if not condition.name.startswith(options.only):
            continue
        found = of_all[condition.name] = []
        for number in range(options.gloves):
            found.append(found_of(condition, first + number))
            print(f"  {condition.name} {first + number}: {found[-1]}", file=sys.stderr, flush=True)
        rows.append(row_of(condition, found))
        curves.append(curve_row_of(condition, found))
        print(rows[-1], curves[-1], sep="\n", flush=True)
    options.folder.mkdir(exist_ok=True)
    (options.folder / "offline.md").write_text("\n".join([*rows, "", *curves, ""]), encoding="utf-8")
    draw_curves(of_all, options.folder / "delay.png")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
