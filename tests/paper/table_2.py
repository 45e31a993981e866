"""Table 2 of Wang & Neff 2013, the choice of the model, on tuples of the simulated glove beside the paper's.

The tuples are the paper's: readings of IM_ABD, I_MCP and M_MCP with the rotation IM_ABD, from widgets of 0,
10, 20 and 30 degrees between the fingers while these bend freely (FK cross-couple sampling), and from thumb
and index finger touching (IK sampling, angles from inverse kinematics). The paper's glove is real, ours
simulated, so NLML and noise are compared between the models, not with the paper's values: its readings are
noisier, and NLML grows with the number of tuples. Eight models are exact, each is one line; the ninth line
is the trainer that the product uses for the paper's choice. Times are CPU seconds of one thread.

    python tests/paper/table_2.py
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from ik_samples import ik_samples

from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.covariance.functions import LinearArd, SquaredExponential, SquaredExponentialArd
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.skeleton import hand_skeleton
from glovecal_models.progress import Report
from glovecal_models.regression.exact import fit_exact
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.linear_regressor import LinearMean, ZeroMean
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.sampling.inverse_kinematics.contact import Touch
from glovecal_models.simulation.protocol import (
    WIDGET_DEG,
    cross_couple_segment,
    free_segment,
    sampling_protocol,
)
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.simulation.touching import touching_segment
from glovecal_models.worker_processes import pin_blas_to_one_thread

Fit = Callable[[np.ndarray, np.ndarray], ProcessRegressor]

MODELS: dict[tuple[str, str], Fit] = {
    ("m_0", "k_RBF"): lambda s, r: fit_exact(s, r, ZeroMean(), SquaredExponential()),
    ("m_0", "k_LARD"): lambda s, r: fit_exact(s, r, ZeroMean(), LinearArd()),
    ("m_0", "k_seARD + k_seARD"): lambda s, r: fit_exact(
        s, r, ZeroMean(), SquaredExponentialArd() + SquaredExponentialArd()
    ),
    ("m_0", "k_LARD + k_seARD"): lambda s, r: fit_exact(
        s, r, ZeroMean(), LinearArd() + SquaredExponentialArd()
    ),
    ("m_l", "k_RBF"): lambda s, r: fit_exact(s, r, LinearMean(), SquaredExponential()),
    ("m_l", "k_LARD"): lambda s, r: fit_exact(s, r, LinearMean(), LinearArd()),
    ("m_l", "k_seARD + k_seARD"): lambda s, r: fit_exact(
        s, r, LinearMean(), SquaredExponentialArd() + SquaredExponentialArd()
    ),
    ("m_l", "k_LARD + k_seARD"): lambda s, r: fit_exact(
        s, r, LinearMean(), LinearArd() + SquaredExponentialArd()
    ),
    ("m_l", "k_seARD, fast trainer"): lambda s, r: fit_lmc_gpr(s, r),
}
"""Mean and covariance: how to train. Beside a free linear mean k_LARD is redundant (``fast_lmc``)."""

PAPER: dict[tuple[str, str], tuple[float, float, float, float]] = {
    ("m_0", "k_RBF"): (752.3, 7.1, 5795.0, -1.79),
    ("m_0", "k_LARD"): (197.5, 0.55, 7641.0, 2.39),
    ("m_0", "k_seARD + k_seARD"): (4569.2, 16.5, 4962.0, -1.79),
    ("m_0", "k_LARD + k_seARD"): (333.8, 0.97, 4545.0, -1.81),
    ("m_l", "k_RBF"): (2615.5, 23.4, 4973.0, -1.80),
    ("m_l", "k_LARD"): (219.2, 0.68, 7635.0, 2.39),
    ("m_l", "k_seARD + k_seARD"): (3760.3, 8.2, 4600.0, -1.80),
    ("m_l", "k_LARD + k_seARD"): (331.2, 0.81, 4543.0, -1.81),
}
"""Training and prediction time in seconds, NLML, log sigma (degrees)."""

SENSORS = ("IM_ABD", "I_MCP", "M_MCP")
ROTATION = "IM_ABD"
HAND_MM = 182.0
WIDGET_HZ, TOUCH_HZ, CLIP_HZ = 20.0, 60.0, 60.0
TOUCHES, TOUCH_FRAMES, CLIP_FRAMES = 3, 176, 267
ROUNDS = 5
"""Times that each widget is held: in one short clip the readings would tell the widget by their path."""
PREDICTIONS = 5


@dataclass(frozen=True)
class Tuples:
    """Readings (N, 3), counts, with the rotation IM_ABD (N,), degrees; and a clip nobody trained on."""

    inputs: np.ndarray
    target: np.ndarray
    clip: np.ndarray
    """(267, 3), counts."""
    clip_truth: np.ndarray
    """(267,), degrees."""


@dataclass(frozen=True)
class Table2Row:
    """The paper's figures are None for the line that the paper has not."""

    mean: str
    covariance: str
    tuples: int
    paper_train_s: float | None
    train_s: float
    """CPU seconds."""
    paper_clip_s: float | None
    clip_s: float
    """CPU seconds for mean and variance of 267 frames, median."""
    paper_nlml: float | None
    nlml: float
    """Nats, target in degrees."""
    paper_log_sigma: float | None
    log_sigma: float
    """Natural logarithm of the noise's standard deviation in degrees."""
    clip_rmse_deg: float
    """On the clip, against the true angle."""


def table_2(seed: int = 1, every: int = 1, report: Report | None = None) -> list[Table2Row]:
    """The paper's rows, in its order, and the fast trainer's, from every ``every``-th of 2128 tuples."""
    data = tuples(seed, every)
    rows = []
    for done, (mean, covariance) in enumerate(MODELS):
        if report:
            report(f"({mean}, {covariance})", done / len(MODELS))
        rows.append(_row(mean, covariance, data))
    return rows


@cache
def tuples(seed: int, every: int = 1) -> Tuples:
    glove = SimulatedGlove(seed)
    columns = [glove.sensors.index(name) for name in SENSORS]
    place = glove.rotations.index(ROTATION)
    inputs, target = [], []
    for number, widget in product(range(ROUNDS), WIDGET_DEG):
        segment = cross_couple_segment(ROUNDS * seed + number, widget)
        clip = simulate_take(glove, segment, seed=ROUNDS * seed + number, rate_hz=WIDGET_HZ)
        inputs.append(clip.take.readings[:, columns])
        target.append(np.full(len(clip.truth), widget))
    for readings, angles in _touches(glove, seed):
        inputs.append(readings[:, columns])
        target.append(angles)
    free = free_segment(seed, CLIP_FRAMES / CLIP_HZ, part=1)
    clip = simulate_take(glove, free, seed=seed + 1, rate_hz=CLIP_HZ)
    return Tuples(
        np.concatenate(inputs)[::every],
        np.concatenate(target)[::every],
        clip.take.readings[:, columns],
        clip.truth[:, place],
    )


def _touches(glove: SimulatedGlove, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Readings and angles of thumb and index finger touching, by inverse kinematics."""
    hand = hand_skeleton(HandDimensions.from_measured({"hand_length": HAND_MM}))
    first = simulate_take(glove, sampling_protocol(seed), seed=seed, rate_hz=30.0).take
    model = train([first], glove.layout, "subject", TrainingSettings(samples=300, folds=0))
    found = []
    for number in range(TOUCHES):
        segment = touching_segment(glove.hand, hand, "I", seed + number, TOUCH_FRAMES / TOUCH_HZ)
        take = simulate_take(glove, segment, seed=seed + number, rate_hz=TOUCH_HZ).take
        samples = ik_samples(take, model, hand, Touch(("T", "I")))
        found.append((samples.readings, samples.angles_deg[:, samples.rotations.index(ROTATION)]))
    return found


def nlml_deg(regressor: ProcessRegressor, samples: int) -> float:
    """Nats for a target in degrees: training works on a target divided by its spread."""
    facts = regressor.evidence
    return facts["nlml"] + samples * float(np.log(facts["target_scale_deg"]))


def _row(mean: str, covariance: str, data: Tuples) -> Table2Row:
    begin = time.process_time()
    regressor = MODELS[mean, covariance](data.inputs, data.target)
    train_s = time.process_time() - begin
    predicted = regressor.predict(data.clip).mean
    paper = PAPER.get((mean, covariance), (None,) * 4)
    return Table2Row(
        mean=mean,
        covariance=covariance,
        tuples=len(data.target),
        paper_train_s=paper[0],
        train_s=train_s,
        paper_clip_s=paper[1],
        clip_s=statistics.median(_clip_s(regressor, data.clip) for _ in range(PREDICTIONS)),
        paper_nlml=paper[2],
        nlml=nlml_deg(regressor, len(data.target)),
        paper_log_sigma=paper[3],
        log_sigma=0.5 * float(np.log(regressor.noise_variance)),
        clip_rmse_deg=float(np.sqrt(np.mean((predicted - data.clip_truth) ** 2))),
    )


def _clip_s(regressor: ProcessRegressor, clip: np.ndarray) -> float:
    begin = time.process_time()
    regressor.predict(clip)
    return time.process_time() - begin


def main() -> None:
    pin_blas_to_one_thread()
    print("Table 2: paper (a real glove, a Core 2 Duo) | ours (simulated, CPU seconds of this machine)")
    heads = ("training s", "267 frames s", "NLML", "log sigma")
    print(f"{'mean':<5} {'covariance':<22} " + " ".join(f"{head:>19}" for head in heads) + "  clip RMSE")
    for row in table_2():
        pairs = (
            (row.paper_train_s, row.train_s, ".3g"),
            (row.paper_clip_s, row.clip_s, ".2g"),
            (row.paper_nlml, row.nlml, ".1f"),
            (row.paper_log_sigma, row.log_sigma, ".2f"),
        )
        cells = [
            f"{'-' if paper is None else f'{paper:{kind}}'} | {ours:{kind}}" for paper, ours, kind in pairs
        ]
        print(
            f"{row.mean:<5} {row.covariance:<22} "
            + " ".join(f"{cell:>19}" for cell in cells)
            + f"  {row.clip_rmse_deg:.2f}"
        )


if __name__ == "__main__":
    main()
