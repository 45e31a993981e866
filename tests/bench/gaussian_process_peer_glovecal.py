"""Our own side of the bench: fast LMC-GPR, SPGP as in the paper, fused prediction."""

from __future__ import annotations

import time

import numpy as np
from gaussian_process_data import OUTPUTS
from gaussian_process_reference import Hyperparameters, Trained

from glovecal_models.calibration.model import CalibrationModel, RotationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.covariance.functions import SquaredExponentialArd
from glovecal_models.layout import Correspondence, Layout
from glovecal_models.regression.factorisation import pivoted_cholesky
from glovecal_models.regression.fast_lmc import fit_lmc_gpr
from glovecal_models.regression.profiled_likelihood import NystromFit
from glovecal_models.regression.regressor import ProcessRegressor
from glovecal_models.regression.served_nodes import NodeChooser
from glovecal_models.regression.spgp import fit_spgp
from glovecal_models.regression.training_samples import MergedSamples, standardise


def train(inputs: np.ndarray, target: np.ndarray) -> tuple[Trained, ProcessRegressor]:
    """LMC-GPR with several starts, certificate and choice of nodes, everything counted."""
    start = time.process_time()
    fitted = fit_lmc_gpr(inputs, target)
    seconds = time.process_time() - start
    facts = fitted.evidence
    note = f"{len(facts['starts'])} starts, {facts['certificate']}, {facts['served_nodes']} nodes"
    return Trained(
        "Glovecal LMC-GPR", seconds, hyperparameters(fitted), note, facts["nlml"], None, facts
    ), fitted


def hyperparameters(fitted: ProcessRegressor) -> Hyperparameters:
    """In units of the target's standard deviation."""
    unit = fitted.evidence["target_scale_deg"] ** 2
    signal, lengthscales = float(np.exp(fitted.theta[0])), np.exp(-0.5 * fitted.theta[1:])
    return Hyperparameters(lengthscales, signal / unit, fitted.noise_variance / unit)


def train_spgp(inputs: np.ndarray, target: np.ndarray, iterations: int) -> Trained:
    """Paper mode: 100 pseudo-inputs optimised together with the hyperparameters."""
    start = time.process_time()
    fitted = fit_spgp(inputs, target, pseudo_inputs=100, iterations=iterations)
    seconds = time.process_time() - start
    facts = fitted.evidence
    return Trained(
        "Glovecal SPGP", seconds, None, f"{iterations} iterations", facts.get("fitc_nlml"), facts=facts
    )


def hundred_node_regressor(inputs: np.ndarray, target: np.ndarray, nodes: int = 100) -> ProcessRegressor:
    """The trained process of a joint on exactly ``nodes`` nodes, to compare equal work."""
    fitted = fit_lmc_gpr(inputs, target)
    standard = standardise(inputs, target)
    samples = MergedSamples.of(standard.x, standard.y)
    given = hyperparameters(fitted)
    factor = pivoted_cholesky(samples.inputs / given.lengthscales, 0.0, nodes)
    fit = NystromFit(samples, factor.rows, given.noise / given.signal)
    best = fit.profile()
    chooser = NodeChooser(fit, factor.rows, factor.pivots, best.residual, best.scale)
    served = chooser.serve(nodes, chooser.reference(), np.inf)
    plane = samples.to_plane @ best.plane * standard.target_scale
    signal = best.scale * standard.target_scale**2
    return ProcessRegressor(
        method="lmc_gpr",
        input_shift=standard.input_shift,
        input_scale=standard.input_scale,
        slope=plane[:-1],
        intercept=float(plane[-1] + standard.target_shift),
        covariance=SquaredExponentialArd(),
        theta=np.append(np.log(signal), -2.0 * np.log(given.lengthscales)),
        nodes=samples.inputs[served.pivots],
        weights=served.weights * (standard.target_scale / signal),
        variance_root=served.variance_root / np.sqrt(signal),
        noise_variance=given.noise / given.signal * signal,
        jitter=0.0,
    )


def predictor(regressors: dict[str, ProcessRegressor], sensors: dict[str, tuple[str, ...]]) -> GlovePredictor:
    """A glove that predicts ``regressors`` from the named sensors, every check and flag included."""
    items = tuple(Correspondence(name, "MS1R", sensors[name]) for name in regressors)
    layout = Layout("bench", tuple(sorted({s for item in items for s in item.sensors})), items)
    rotations = tuple(
        RotationModel(
            item,
            regressors[item.rotation],
            np.zeros(len(item.sensors)),
            np.full(len(item.sensors), 255.0),
            3.0,
            None,
            2000,
        )
        for item in items
    )
    return GlovePredictor(CalibrationModel(layout, "bench", "lmc_gpr", rotations, ()))


def whole_glove_predictor(regressors: dict[str, ProcessRegressor]) -> GlovePredictor:
    return predictor(regressors, OUTPUTS)
