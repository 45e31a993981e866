"""A prior from other people's takes: laws, and its interval counted on people who were left out."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load
from glovecal_models.calibration.people_prior import PeoplePlane, PeoplePrior, people_prior
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.errors import BadInput, NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.regression.linear_regressor import fit_linear
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_columns("sleeve", ("A", "B"), ("BEND",))
POPULATION = np.array([0.2, -0.1, 5.0])
BETWEEN = {"person": np.array([0.05, 0.03, 6.0]), "wearing": np.array([0.02, 0.01, 4.0])}
FRAME_DEG = 1.5


def takes_of(seed: int, wearings: int = 2, takes: int = 3) -> list[Take]:
    """Of one person: degrees = plane of two readings, with errors of single frames."""
    random = np.random.default_rng(seed)
    own = POPULATION + BETWEEN["person"] * random.standard_normal(3)
    found = []
    for wearing in range(wearings):
        plane = own + BETWEEN["wearing"] * random.standard_normal(3)
        for number in range(takes):
            readings = random.uniform(-100, 100, (60, 2)) + 300
            angle = (readings - 300) @ plane[:2] + plane[2] + FRAME_DEG * random.standard_normal(60)
            time = np.arange(60) / 30
            found.append(
                Take(
                    f"w{wearing}-{number}", f"wearing-{wearing}", ("A", "B"), time, readings, ("BEND",),
                    reference_time_s=time, reference=angle[:, None],
                )
            )  # fmt: skip
    return found


def pairs(takes: list[Take]) -> dict[str, list[tuple[np.ndarray, np.ndarray]]]:
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for take in takes:
        target = take.reference_at_frames(["BEND"])[:, 0]
        found.setdefault(take.wearing, []).append((take.readings, target))
    return found


@pytest.fixture(scope="module")
def prior() -> PeoplePrior:
    return people_prior({f"person-{seed}": takes_of(seed) for seed in range(12)}, LAYOUT)


def test_with_no_own_take_the_population_speaks_and_its_interval_holds_for_others(prior: PeoplePrior) -> None:
    regressor = prior.planes[0].regressor({})
    readings = np.array([[300.0, 300.0], [400.0, 250.0]])
    expected = (readings - 300) @ POPULATION[:2] + POPULATION[2]
    np.testing.assert_allclose(regressor.mean(readings), expected, atol=6.0)
    inside = []
    for seed in range(100, 200):
        take = takes_of(seed, 1, 1)[0]
        found = regressor.predict(take.readings)
        sd = np.sqrt(found.variance + regressor.noise_variance)
        inside.append(np.mean(np.abs(found.mean - take.reference_at_frames(["BEND"])[:, 0]) < 1.96 * sd))
    assert 0.88 < np.mean(inside) < 0.99


def test_own_takes_bring_the_error_down_and_less_than_alone_is_needed(prior: PeoplePrior) -> None:
    plane, errors = prior.planes[0], []
    for seed in range(200, 240):
        first, *_, last = takes_of(seed, 1, 3)
        few = replace(
            first, time_s=first.time_s[:5], readings=first.readings[:5], reference=first.reference[:5],
            reference_time_s=first.reference_time_s[:5],
        )  # fmt: skip
        inputs, target = pairs([few])["wearing-0"][0]
        truth = last.reference_at_frames(["BEND"])[:, 0]
        each = [
            plane.regressor({}), plane.regressor(pairs([few])), fit_linear(inputs, target),
            plane.regressor(pairs([first])),
        ]  # fmt: skip
        errors.append([np.mean((one.mean(last.readings) - truth) ** 2) for one in each])
    nothing, little, alone, take = np.sqrt(np.mean(errors, axis=0))
    assert take < little < 0.7 * nothing
    assert little < alone


def test_without_other_people_or_with_endless_own_takes_it_is_training_alone(prior: PeoplePrior) -> None:
    takes = takes_of(300, 1, 3)
    inputs = np.concatenate([take.readings for take in takes])
    target = np.concatenate([take.reference_at_frames(["BEND"])[:, 0] for take in takes])
    plane, alone = prior.planes[0], fit_linear(inputs, target)
    unknown = replace(
        plane, covariance=tuple(map(tuple, (1e8 * np.eye(3)).tolist())), take_variance=(0.0,) * 3,
        frame_variance=1.0,
    )  # fmt: skip
    np.testing.assert_allclose(unknown.regressor(pairs(takes)).mean(inputs), alone.mean(inputs), atol=1e-3)
    many = pairs(takes_of(301, 1, 300))
    inputs = np.concatenate([x for x, _ in many["wearing-0"]])
    alone = fit_linear(inputs, np.concatenate([y for _, y in many["wearing-0"]]))
    np.testing.assert_allclose(plane.regressor(many).mean(inputs), alone.mean(inputs), atol=0.15)


def test_a_known_person_is_nearer_in_the_next_wearing_than_a_new_one(prior: PeoplePrior) -> None:
    off = []
    for seed in range(400, 440):
        *known, last = takes_of(seed, 3, 1)
        truth = last.reference_at_frames(["BEND"])[:, 0]
        planes = prior, prior.of_person(known)
        each = [one.planes[0].regressor({}).mean(last.readings) - truth for one in planes]
        off.append([np.mean(error**2) for error in each])
    new, known = np.sqrt(np.mean(off, axis=0))
    assert known < 0.8 * new
    assert prior.of_person(takes_of(1)).planes[0].knows_person
    assert prior.of_person([]).planes == prior.planes


def test_a_file_holds_no_person_and_is_refused_once_it_was_changed(prior: PeoplePrior) -> None:
    text = prior.dump()
    assert "person-" not in text
    assert "wearing-" not in text
    assert PeoplePrior.load(text, "prior.json") == prior
    changed = json.loads(text)
    changed["planes"][0]["mean"][0] += 1
    with pytest.raises(BadInput, match="changed after it was written"):
        PeoplePrior.load(json.dumps(changed), "prior.json")
    with pytest.raises(BadInput, match="is no prior of people"):
        PeoplePrior.load("{}", "prior.json")
    with pytest.raises(BadInput, match="incomplete or damaged"):
        PeoplePlane.from_document({**changed["planes"][0], "mean": [1.0]})


def test_one_other_person_is_no_prior() -> None:
    with pytest.raises(NotTrainable, match="measured in 2 other people"):
        people_prior({"anna": takes_of(1)}, LAYOUT)


def test_training_leans_on_people_and_what_is_held_out_is_not_seen_by_the_plane(prior: PeoplePrior) -> None:
    takes = takes_of(500, 1, 4)
    settings = TrainingSettings(method="linear", folds=2, people=prior.planes)
    model = train(takes, LAYOUT, "new", settings)
    own = model.rotations[0]
    expected = prior.planes[0].regressor(pairs(takes))
    np.testing.assert_allclose(own.regressor.mean(takes[0].readings), expected.mean(takes[0].readings))
    assert own.held_out_rmse_deg == pytest.approx(FRAME_DEG, abs=0.5)
    assert load(dump(model)).rotations[0].regressor.settings()["evidence"]["people"] == 12
    stored = json.loads(json.dumps(asdict(settings)))
    assert TrainingSettings(**stored).people == prior.planes
    with pytest.raises(BadInput, match="--method linear"):
        TrainingSettings(people=prior.planes)
