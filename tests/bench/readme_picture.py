"""The picture of README.md: one rotation over a second wearing, and the error that each method leaves.

uv run --group bench python tests/bench/readme_picture.py service/pictures/second-wearing.png
"""

from __future__ import annotations

import sys

import matplotlib as mpl
import numpy as np

from glovecal_models.calibration.methods import METHODS
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.layout import Layout
from glovecal_models.simulation.protocol import evaluation_segment, sampling_protocol
from glovecal_models.simulation.simulated_glove import SimulatedGlove, simulate_take
from glovecal_models.takes.take import Take
from glovecal_models.worker_processes import pin_blas_to_one_thread

SEED, ROTATION, SUBJECT = 1, "IM_ABD", "demo-subject"
NAMES = {"raw": "raw readings", "linear": "linear", "lmc_gpr": "LMC-GPR", "spgp": "SPGP 100"}
COLOURS = {"raw": "#b0b6bd", "linear": "#d9822b", "lmc_gpr": "#1d6cab", "spgp": "#3f9c6b"}
DRAWN = ("raw", "linear", "lmc_gpr")


def main(path: str) -> None:
    """Train on the first wearing, predict the second, draw."""
    mpl.use("Agg")
    pin_blas_to_one_thread()
    layout = Layout.built_in("cyberglove18")
    first, second = SimulatedGlove(seed=SEED), SimulatedGlove(seed=SEED, wearing=1)
    takes = [simulate_take(first, segment, seed=SEED).take for segment in sampling_protocol(SEED)]
    test = simulate_take(second, evaluation_segment(SEED), seed=SEED, reference_noise_deg=0.0).take
    settings = {method: TrainingSettings(method=method, samples=1000, folds=0) for method in METHODS}
    models = {method: train(takes, layout, SUBJECT, settings[method]) for method in METHODS}
    errors = {method: compare(model, [test]).overall.rmse_deg for method, model in models.items()}
    angles = {method: GlovePredictor(models[method]).predict(test.readings) for method in DRAWN}
    draw(path, test, {m: (a.mean, a.sd) for m, a in angles.items()}, models["raw"].rotation_names, errors)


def draw(
    path: str,
    test: Take,
    angles: dict[str, tuple[np.ndarray, np.ndarray]],
    rotations: tuple[str, ...],
    errors: dict[str, float],
) -> None:
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 3.6), width_ratios=(3, 1), constrained_layout=True
    )
    column, time = rotations.index(ROTATION), test.time_s - test.time_s[0]
    for method, (mean, sd) in angles.items():
        middle, width = mean[:, column], sd[:, column]
        if method == "lmc_gpr":
            band = (middle - 2 * width, middle + 2 * width)
            left.fill_between(time, *band, color=COLOURS[method], alpha=0.2, linewidth=0, label="± 2 sd")
        left.plot(time, middle, color=COLOURS[method], linewidth=1.2, label=NAMES[method])
    truth = test.reference[:, test.rotations.index(ROTATION)]
    left.plot(test.reference_time_s - test.time_s[0], truth, "k:", linewidth=1.6, label="truth")
    left.set(xlabel="seconds, second wearing", ylabel="degrees")
    left.set_title("Index-middle abduction through nine poses (simulated glove)", fontsize=10)
    left.legend(ncols=5, fontsize=8, frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    bars = right.bar([NAMES[m] for m in errors], list(errors.values()), color=[COLOURS[m] for m in errors])
    right.bar_label(bars, fmt="%.1f°", fontsize=8)
    right.set_title("Error over 22 rotations, RMSE", fontsize=10)
    right.tick_params(axis="x", labelsize=7)
    right.set_ylabel("degrees")
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main(sys.argv[1])
