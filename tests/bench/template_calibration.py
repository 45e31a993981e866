"""What a template from five hand shapes reaches on simulated gloves, with the paper's palm terms and without.

    python tests/bench/template_calibration.py [--gloves 12] [--guided 3] [--law closing|squared]

The hand is simulated: its palm arches by a law of its own, from the joints that close it (``closing``), or
by its square (``squared``), and never by equations (2) to (5) of Krnoul et al. 2016. The person keeps the
tips together by that hand. Gloves are counted from ``FIRST``: none of them was looked at while the template
was made (numbers 1 to 6 were). Errors are means of absolute errors over frames and rotations in the nine
poses of Table 3 of Wang & Neff 2013 and 20 s of free motion; wrist and unmeasured palm are left out.
Distances are medians over the frames of four touching motions of thumb and little finger that nobody
trained on.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "simulated"))

from asked_session import RECORDING, asked_session

from glovecal_models.calibration.model import CalibrationModel
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.template import planes_of
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.hand.dimensions import HandDimensions
from glovecal_models.hand.rotations import PALM, WRIST
from glovecal_models.hand.skeleton import Skeleton, hand_skeleton
from glovecal_models.sampling.catalogue import ProtocolName, make_protocol
from glovecal_models.sampling.guided.guided_calibration import guided_calibration
from glovecal_models.sampling.guided.labelled_takes import LabelledTake
from glovecal_models.sampling.inverse_kinematics.contact import TipChains
from glovecal_models.sampling.inverse_kinematics.follow import predicted_hand
from glovecal_models.sampling.sampled_takes import sampled_takes
from glovecal_models.sampling.template.template_samples import template_calibration
from glovecal_models.simulation.protocol import evaluation_segment, free_segment
from glovecal_models.simulation.simulated_glove import SimulatedGlove, SimulatedTake, simulate_take
from glovecal_models.simulation.simulated_hand import ROTATIONS, SimulatedHand
from glovecal_models.simulation.touching import touching_segment

FIRST = 21
SIZES = HandDimensions.from_measured({"hand_length": 182})
ARCHING, RIGID = hand_skeleton(SIZES, palm="arching"), hand_skeleton(SIZES)
HIGHEST_DEG = 25.0


class SquaredPalm(SimulatedHand):
    """Its palm stays flat for longer and then arches faster."""

    def complete(self, driven: Mapping[str, np.ndarray]) -> np.ndarray:
        angles = super().complete(driven)
        palm = ROTATIONS.index(PALM)
        angles[:, palm] = angles[:, palm] ** 2 / HIGHEST_DEG
        return angles


def glove_of(seed: int, law: str) -> SimulatedGlove:
    glove = SimulatedGlove(seed)
    if law == "squared":
        glove.hand = SquaredPalm(seed)
    return glove


def sampled(glove: SimulatedGlove, protocol: ProtocolName) -> list[LabelledTake]:
    session = asked_session(
        make_protocol(protocol, glove.layout, seed=glove.seed), glove, seed=glove.seed, rate_hz=30,
        skeleton=ARCHING, at_once_s=0.2,
    )  # fmt: skip
    return [
        LabelledTake.of(each) for each in sampled_takes(session.state, {RECORDING: session.take}, name="s")
    ]


def mean_error_deg(model: CalibrationModel, glove: SimulatedGlove) -> dict[str, float]:
    """Mean absolute error by rotation."""
    predictor, found = GlovePredictor(model), {}
    for segment in (evaluation_segment(glove.seed), free_segment(glove.seed, 20.0)):
        test = simulate_take(glove, segment, seed=glove.seed, rate_hz=20)
        angles = predictor.predict(test.take.readings).mean
        for column, name in enumerate(predictor.rotations):
            if name not in (*WRIST, PALM):
                off = np.abs(angles[:, column] - test.truth[:, glove.rotations.index(name)])
                found.setdefault(name, []).append(float(off.mean()))
    return {name: float(np.mean(each)) for name, each in found.items()}


def touches(glove: SimulatedGlove) -> list[SimulatedTake]:
    return [
        simulate_take(glove, touching_segment(glove.hand, ARCHING, "P", seed, 2.0), seed=seed, rate_hz=20)
        for seed in range(70, 74)
    ]


def touch_mm(model: CalibrationModel, takes: list[SimulatedTake], skeleton: Skeleton) -> float:
    chains, found = TipChains(skeleton, ("T", "P")), []
    for each in takes:
        hand = predicted_hand(each.take, model, skeleton.rotations).mean_deg
        tips = chains.tips_mm(hand[:, chains.columns])
        found.append(np.linalg.norm(tips[:, 0] - tips[:, 1], axis=1))
    return float(np.median(np.concatenate(found)))


def of_template(seed: int, law: str) -> dict[str, object]:
    """With the palm's terms, and without them on a rigid hand. The same least squares initialises both and
    closes the touches of the five shapes as far as it can. ``named_shapes_only``: without the terms and
    without touches."""
    glove = glove_of(seed, law)
    shapes, test = sampled(glove, "five_shapes"), touches(glove)
    row: dict[str, object] = {"glove": seed}
    models = {}
    for name, palm, skeleton in (("with", True, ARCHING), ("without", False, RIGID)):
        model = template_calibration(shapes, glove.layout, "anna", skeleton, palm=palm)
        errors = mean_error_deg(model, glove)
        models[name] = touch_mm(model, test, skeleton)
        row[f"{name}_mean_deg"] = round(float(np.mean(list(errors.values()))), 2)
        row[f"{name}_worst"] = max(errors, key=lambda each: errors[each])
        row[f"{name}_worst_deg"] = round(max(errors.values()), 1)
        row[f"{name}_touch_mm"] = round(models[name], 1)
    apart = [each for each in shapes if not each.contacts]
    plain = template_calibration(apart, glove.layout, "anna", RIGID, palm=False)
    row["named_shapes_only_touch_mm"] = round(touch_mm(plain, test, RIGID), 1)
    row["ratio"] = round(models["without"] / models["with"], 2)
    return row


def of_guided(seed: int, law: str) -> dict[str, object]:
    """LMC-GPR of the whole guided sampling of the same person; then with the five shapes' template as its
    prior mean."""
    glove = glove_of(seed, law)
    takes = sampled(glove, "new_subject")
    settings = replace(TrainingSettings(), samples=400, folds=0)
    found = guided_calibration(takes, glove.layout, "anna", RIGID, settings)
    errors = mean_error_deg(found.model, glove)
    template = template_calibration(sampled(glove, "five_shapes"), glove.layout, "anna", ARCHING)
    on_top = guided_calibration(
        takes, glove.layout, "anna", RIGID, replace(settings, prior=planes_of(template))
    )
    with_prior = mean_error_deg(on_top.model, glove)
    return {
        "glove": seed,
        "guided_mean_deg": round(float(np.mean(list(errors.values()))), 2),
        "on_template_mean_deg": round(float(np.mean(list(with_prior.values()))), 2),
        "on_template_worst_deg": round(max(with_prior.values()), 1),
        "worst": max(errors, key=lambda each: errors[each]),
        "worst_deg": round(max(errors.values()), 1),
        "refused_touches": [each.pose for each in found.refused],
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--gloves", type=int, default=12)
    options.add_argument("--guided", type=int, default=3)
    options.add_argument("--law", choices=("closing", "squared"), default="closing")
    chosen = options.parse_args()
    rows = []
    for seed in range(FIRST, FIRST + chosen.gloves):
        rows.append(of_template(seed, chosen.law))
        print(json.dumps(rows[-1]), flush=True)
    if rows:
        for name in ("with_mean_deg", "without_mean_deg", "with_touch_mm", "without_touch_mm",
                     "named_shapes_only_touch_mm", "ratio"):  # fmt: skip
            values = np.array([row[name] for row in rows], dtype=float)
            low, high = np.percentile(values, [0, 100])
            print(f"{name}: median {np.median(values):.2f}, {low:.2f} to {high:.2f}, {len(values)} gloves")
        print(f"ratio >= 3 on {sum(float(str(row['ratio'])) >= 3 for row in rows)} of {len(rows)} gloves")
    for seed in range(FIRST, FIRST + chosen.guided):
        print(json.dumps(of_guided(seed, chosen.law)), flush=True)


if __name__ == "__main__":
    main()
