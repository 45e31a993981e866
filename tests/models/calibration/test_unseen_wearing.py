"""The error in a wearing that training did not see: told, and claimed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student_t

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.effect_correction import EffectCorrection
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.text import wearing_sentences
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.calibration.unseen_wearing import LeftOutWearing, unseen_wearing
from glovecal_models.comparison.compare import compare
from glovecal_models.comparison.residuals import residuals
from glovecal_models.improvement.add_effect import add_effect
from glovecal_models.layout import Layout
from glovecal_models.takes.clock_scan import aligned, clock_offsets
from glovecal_models.takes.table import read_takes
from glovecal_models.takes.take import Take

ANKLE = Path(__file__).parents[4] / "shared" / "data" / "ankle"
LINEAR = TrainingSettings(method="linear", folds=2)
SHIFTS_DEG = {"one": 0.0, "two": 6.0, "three": -5.0, "four": 4.0}


def shifted_take(wearing: str, number: int) -> Take:
    """One sensor of 10 counts a degree, shifted by the wearing; noise of half a degree."""
    generator = np.random.default_rng(number)
    time = np.arange(300) / 30.0
    angle = 40.0 + 30.0 * np.sin(0.9 * time + number)
    reading = 10.0 * (angle + SHIFTS_DEG[wearing] + generator.normal(0.0, 0.5, len(time)))
    return Take(
        name=f"{wearing}-{number}",
        time_s=time,
        sensors=("I_MCP",),
        readings=reading[:, None],
        rotations=("I_MCP",),
        reference_time_s=time,
        reference=angle[:, None],
        wearing=wearing,
    )


def takes_of(*wearings: str) -> list[Take]:
    return [shifted_take(name, 10 * at + n) for at, name in enumerate(wearings) for n in range(2)]


LAYOUT = Layout.from_columns("one", ("I_MCP",), ("I_MCP",))


def test_two_wearings_claim_by_a_t_and_lean_on_the_prior():
    left_out = [
        LeftOutWearing("I_MCP", wearing, 1, square=100 * 36.25, count=100, claimed=0.25, noise=0.25)
        for wearing in ("one", "two")
    ]
    found = unseen_wearing(["one", "two"], left_out, {"I_MCP": 0.25})
    own = 36.0 / 2
    pooled = (own + 2 * 3.5**2) / 3
    variance = (own + 2 * pooled) / 3
    quantile = student_t.ppf(norm.cdf(1.0), 3)
    assert found.rmse_deg == pytest.approx(np.sqrt(36.25))
    assert found.between_sd_deg["I_MCP"] == pytest.approx(np.sqrt(variance))
    assert found.added_variance["I_MCP"] == pytest.approx(1.5 * variance * quantile**2)
    assert found.interval_deg is not None
    assert found.interval_deg[0] < np.sqrt(36.25) < found.interval_deg[1]


def test_training_tells_the_next_wearing_first_and_claims_it():
    model = train(takes_of("one", "two", "three"), LAYOUT, "anna", LINEAR)
    again = load(dump(model))
    assert again.unseen_wearing == model.unseen_wearing
    assert model.error_estimate["rmse_unseen_wearing_deg"] > 5
    first, second, *_ = wearing_sentences(model, model.error_estimate["rmse_deg"])
    assert first.startswith("In a wearing not seen: ")
    assert "3 wearings, each left out whole" in first
    assert second.startswith("In the wearings seen: ")
    new, old = shifted_take("four", 90), shifted_take("one", 91)
    found = compare(again, [new, old])
    assert found.unseen_wearing is not None
    assert found.seen_wearing is not None
    assert found.unseen_wearings == ("four",)
    assert [text.split(":")[0] for text in found.sentences] == [
        "In wearings not seen",
        "In the wearings seen",
    ]
    sd = {item.take.wearing: float(item.sd.mean()) for item in residuals(again, [new, old]).takes}
    within = float(GlovePredictor(again).predict(old.readings).sd.mean())
    assert sd["one"] == pytest.approx(within), "nothing is added in a wearing that was seen"
    assert sd["four"] > 1.2 * within


def test_live_frames_claim_what_a_take_does():
    model = train(takes_of("one", "two"), LAYOUT, "anna", LINEAR)
    predictor = GlovePredictor(model)
    assert predictor.has_effects
    for wearing in ("one", "four", ""):
        take = replace(shifted_take("four", 7), wearing=wearing)
        whole = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing)
        base = predictor.predict(take.readings[:1])
        live = EffectCorrection.of_frames(
            [predictor.stream()], take.time_s[:1], base.mean, take.readings[:1], [{}], [wearing]
        )
        frame = predictor.corrected(base, live.degrees, live.undefined, live.inflation)
        assert frame.sd[0] == pytest.approx(whole.sd[0])


def test_one_wearing_says_so():
    model = train(takes_of("one"), LAYOUT, "anna", LINEAR)
    assert model.unseen_wearing is not None
    assert model.unseen_wearing.rmse_deg is None
    assert "rmse_unseen_wearing_deg" not in model.error_estimate
    [sentence] = wearing_sentences(model, model.error_estimate["rmse_deg"])
    assert "all takes are of one wearing" in sentence
    older = replace(model, unseen_wearing=None)
    assert wearing_sentences(older, 1.0) == []
    assert load(dump(older)).unseen_wearing is None
    assert compare(older, [shifted_take("two", 5)]).unseen_wearing is None


def test_a_donning_shift_is_not_counted_twice():
    takes = takes_of("one", "two", "three")
    plain = train(takes, LAYOUT, "anna", LINEAR)
    model = add_effect(plain, takes, "donning_shift", settings=LINEAR, least_gain=-9).model
    take = shifted_take("four", 8)
    predictor = GlovePredictor(model)
    claimed = predictor.predict_take(take.time_s, take.readings, take.context, take.wearing).sd ** 2
    base = predictor.predict(take.readings)
    assert model.unseen_wearing is not None
    between = model.unseen_wearing.added_variance["I_MCP"]
    without = replace(model, unseen_wearing=None)
    own = GlovePredictor(without).predict_take(take.time_s, take.readings, take.context, take.wearing).sd ** 2
    expected = base.sd**2 + np.maximum(own - base.sd**2, between)
    assert claimed == pytest.approx(expected)


@pytest.mark.needs_shared_data
def test_a_whole_placement_of_an_ankle_left_out_is_claimed():
    """Real recordings, 5 people, 3 placements: 79 % within one claimed SD, mean claim 1.2 times the RMSE."""
    inside, errors, claims = {}, [], []
    for person in ("P300", "P301", "P302", "P303", "P304"):
        takes = [take for path in sorted(ANKLE.glob(f"{person}-*.frames.csv")) for take in read_takes(path)]
        offsets = clock_offsets(takes)
        takes = [aligned(take, found.offset_s) for take, found in zip(takes, offsets, strict=True)]
        takes = [replace(take, wearing="-".join(take.name.split("-")[:2])) for take in takes]
        layout = Layout.from_columns("ankle", takes[0].sensors, takes[0].rotations)
        own_errors, own_claims = [], []
        for wearing in dict.fromkeys(take.wearing for take in takes):
            training = [take for take in takes if take.wearing != wearing]
            model = train(training, layout, person.lower(), LINEAR)
            found = residuals(model, [take for take in takes if take.wearing == wearing])
            error, sd = found.stacked("error"), found.stacked("sd")
            own_errors.append(error[np.isfinite(error)])
            own_claims.append(sd[np.isfinite(error)])
        error, sd = np.concatenate(own_errors), np.concatenate(own_claims)
        inside[person] = float(np.mean(np.abs(error) <= sd))
        errors.append(error)
        claims.append(sd)
    error, sd = np.concatenate(errors), np.concatenate(claims)
    assert min(inside.values()) > 0.40
    assert 0.55 < float(np.mean(np.abs(error) <= sd)) < 0.85
    assert sd.mean() < 2 * np.sqrt(np.mean(error**2))
