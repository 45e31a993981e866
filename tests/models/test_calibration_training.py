"""Training a whole (small) glove: what is trained, what is a rule, what is refused, what is kept."""

import numpy as np
import pytest

from glovecal_models.calibration.artifact import dump, load, model_id, read_manifest
from glovecal_models.calibration.predictor import GlovePredictor
from glovecal_models.calibration.training import train
from glovecal_models.calibration.training_plan import plan_training
from glovecal_models.calibration.training_settings import TrainingSettings
from glovecal_models.comparison.compare import compare
from glovecal_models.errors import BadInput, Cancelled, DamagedArtifact, LayoutMismatch, NotTrainable
from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_toml("""
name = "half-hand"
sensors = ["I_MCP", "I_PIP", "M_MCP", "IM_ABD"]
[rotations]
I_MCP = ["I_MCP"]
I_PIP = ["I_PIP"]
IM_ABD = ["IM_ABD", "I_MCP", "M_MCP"]
[simulated]
I_DIP = "2/3 * I_PIP"
""")
QUICK = TrainingSettings(method="lmc_gpr", samples=150, folds=2)


def make_take(seed: int, name: str, measured=("I_MCP", "I_PIP", "IM_ABD"), frames=400) -> Take:
    """Flexion read nonlinearly, abduction stretched by both flexions (made up, noise 0.5 degrees)."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / 60
    smooth = np.cumsum(rng.normal(size=(frames, 4)), axis=0)
    unit = (smooth - smooth.min(axis=0)) / np.ptp(smooth, axis=0)
    flexion, abduction = 90 * unit[:, :3], 25 * unit[:, 3]
    readings = np.column_stack(
        [
            40 + 0.9 * flexion[:, 0] + 12 * np.sin(flexion[:, 0] / 40),
            50 + 1.3 * flexion[:, 1],
            45 + 0.8 * flexion[:, 2],
            200 - 3 * abduction - 0.004 * flexion[:, 0] * flexion[:, 2],
        ]
    )
    angles = {"I_MCP": flexion[:, 0], "I_PIP": flexion[:, 1], "IM_ABD": abduction}
    reference = np.array([angles[item] + rng.normal(0, 0.5, frames) for item in measured])
    return Take(
        name=name,
        wearing="w1",
        sensors=LAYOUT.sensors,
        time_s=time,
        readings=np.round(readings),
        rotations=tuple(measured),
        reference_time_s=time,
        reference=reference.reshape(len(measured), frames).T,
        simulated=True,
    )


@pytest.fixture(scope="module")
def takes():
    return [make_take(seed, f"take-{seed}") for seed in range(3)]


@pytest.fixture(scope="module")
def model(takes):
    return train(takes, LAYOUT, "anna", QUICK, take_hashes=["a" * 64, "b" * 64, "c" * 64])


def test_every_measured_rotation_is_trained_and_the_rest_follows_the_rule(model):
    methods = {item.rotation: item.regressor.method for item in model.rotations}
    assert methods == {"I_MCP": "lmc_gpr", "I_PIP": "lmc_gpr", "IM_ABD": "lmc_gpr", "I_DIP": "rule"}
    assert model.simulated
    assert model.error_estimate["how"] == "whole takes left out"
    assert 0.3 < model.error_estimate["rmse_deg"] < 3


def test_the_rule_is_two_thirds_of_the_calibrated_pip(model, takes):
    predictor = GlovePredictor(model)
    angles = predictor.predict(takes[0].readings)
    names = predictor.rotations
    np.testing.assert_allclose(
        angles.mean[:, names.index("I_DIP")], 2 / 3 * angles.mean[:, names.index("I_PIP")], atol=1e-9
    )


def test_lmc_gpr_beats_the_straight_line_on_a_take_it_has_not_seen(model, takes):
    linear = train(takes, LAYOUT, "anna", TrainingSettings(method="linear"))
    unseen = [make_take(77, "unseen")]
    assert compare(model, unseen).overall.rmse_deg < 0.6 * compare(linear, unseen).overall.rmse_deg


def test_comparison_says_how_far_off_and_whether_the_model_knows(model):
    comparison = compare(model, [make_take(78, "unseen")])
    for errors in comparison.rotations.values():
        assert errors.rmse_deg < errors.baseline_deg / 5
        assert 0.4 < errors.coverage < 0.9
        assert errors.mae_deg <= errors.rmse_deg <= errors.percentile_95_deg
    assert comparison.not_measured == ("I_DIP",)


def test_the_same_training_gives_the_same_bytes_and_they_load_back(model, takes):
    again = train(takes, LAYOUT, "anna", QUICK, take_hashes=["a" * 64, "b" * 64, "c" * 64])
    artifact = dump(model)
    assert dump(again) == artifact
    restored = load(artifact, expected_id=model_id(artifact))
    np.testing.assert_array_equal(
        GlovePredictor(restored).predict(takes[1].readings).mean,
        GlovePredictor(model).predict(takes[1].readings).mean,
    )
    assert restored.layout == LAYOUT
    assert read_manifest(artifact)["takes"] == ["a" * 64, "b" * 64, "c" * 64]


def test_any_changed_byte_is_refused(model):
    artifact = dump(model)
    name = model_id(artifact)
    rng = np.random.default_rng(5)
    for position in rng.integers(0, len(artifact), 200):
        damaged = bytearray(artifact)
        damaged[position] ^= 1 << int(rng.integers(8))
        with pytest.raises(DamagedArtifact, match=name[:12]):
            load(bytes(damaged), expected_id=name)


@pytest.mark.parametrize("junk", [b"", b"1234567", b"\xff" * 64, b"\x02" + b"\0" * 7 + b"{}", b"GIF89a" * 20])
def test_other_files_are_refused(junk):
    with pytest.raises(DamagedArtifact):
        load(junk)


def test_a_take_of_another_glove_is_refused_by_the_missing_sensor(takes):
    with pytest.raises(LayoutMismatch, match="T_TMC"):
        plan_training(takes, Layout.built_in("cyberglove22"), "anna")


def test_takes_without_reference_are_refused_with_the_cure():
    with pytest.raises(NotTrainable, match=r"r\.ROTATION"):
        plan_training([make_take(1, "t", measured=())], LAYOUT, "anna")


def test_a_reference_that_never_moves_is_refused_by_name():
    take = make_take(1, "t", measured=("I_MCP",))
    still = Take(**{**vars(take), "reference": np.full((len(take.time_s), 1), 30.0)})
    with pytest.raises(NotTrainable):
        plan_training([still], LAYOUT, "anna")


def test_training_stops_when_asked(takes):
    with pytest.raises(Cancelled):
        train(takes, LAYOUT, "anna", QUICK, cancelled=lambda: True)


def test_comparing_with_a_take_that_measured_nothing_is_refused(model):
    with pytest.raises(BadInput, match="none of the takes measured"):
        compare(model, [make_take(1, "t", measured=())])


def test_one_take_is_validated_on_stretches_of_time(takes):
    model = train(takes[:1], LAYOUT, "anna", QUICK)
    assert model.error_estimate["how"] == "stretches of the only take left out"


def test_task_keys_are_stable_and_tell_everything_apart(takes):
    first = [task.key for task in plan_training(takes, LAYOUT, "anna", QUICK).tasks]
    second = [task.key for task in plan_training(takes, LAYOUT, "bert", QUICK).tasks]
    assert first == second  # the fit does not depend on whose it is
    assert len(set(first)) == len(first)
    other = plan_training(takes, LAYOUT, "anna", TrainingSettings(samples=149, folds=2)).tasks
    assert not set(first) & {task.key for task in other}
