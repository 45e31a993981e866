"""Drawn photographs and what is read from them: colours, casts, files."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from other_gloves import other_hand
from sklearn.mixture import GaussianMixture

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.database import PoseDatabase
from glovecal_models.colour_glove.lookup import PoseLookup, pca_code
from glovecal_models.colour_glove.pattern import (
    PRINTED_SRGB,
    encoded_light,
    glove_pattern,
    linear_light,
)
from glovecal_models.colour_glove.photograph import (
    Photograph,
    Photographer,
    Photography,
    hand_motion,
    labelled_photographs,
)
from glovecal_models.colour_glove.pictures.classify import (
    ColourTable,
    _Mixture,
    drawn_colours,
    many_coloured,
    smoothed,
    with_edges,
)
from glovecal_models.colour_glove.pictures.white_balance import Gains, blind_gains, white_gains
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.errors import BadInput

SKIN = hand_skin()
PATTERN = glove_pattern(SKIN)
CAMERA = Camera(distortion=(-0.12, 0.05, 0.0005, -0.0004, 0.0))
OTHER = other_hand(SKIN, 40)


@pytest.fixture(scope="module")
def table() -> ColourTable:
    examples = labelled_photographs(SKIN, PATTERN, CAMERA)
    return ColourTable.trained([e.picture for e in examples], [e.labels for e in examples])


def photographs(count: int, **look) -> list[Photograph]:
    states = hand_motion(OTHER, 2.0 * count, 0.5, seed=41)[:count]
    return [
        Photographer(OTHER, PATTERN, CAMERA, Photography(**look), 900 + index).photograph(state)
        for index, state in enumerate(states)
    ]


def right(table: ColourTable, found: list[Photograph], gains: Gains | None = None) -> float:
    """Mean share of glove pixels with their true colour."""
    shares = []
    for photograph in found:
        labels = table.labels((gains or Gains()).corrected(photograph.picture))
        glove = photograph.labels > 0
        shares.append((labels[glove] == photograph.labels[glove]).mean())
    return float(np.mean(shares))


def test_colours_of_hands_not_seen_before(table):
    assert right(table, photographs(4)) > 0.92
    wrong = [(table.labels(f.picture)[f.labels == 0] > 0).mean() for f in photographs(4)]
    assert np.mean(wrong) < 0.02


def test_a_cast_is_corrected_by_white_and_blindly(table, database: PoseDatabase):
    found = photographs(4, gains=(1.7, 1.0, 0.5))
    uncorrected = right(table, found)
    assert uncorrected < 0.7
    # A white card in the same light.
    light = linear_light(np.full((60, 60, 3), 150)) * np.array([0.5, 1.0, 1.7], np.float32)
    white = white_gains(encoded_light(light), np.ones((60, 60), bool))
    assert white.red == pytest.approx(1 / 1.7, rel=0.03)
    assert white.blue == pytest.approx(1 / 0.5, rel=0.03)
    assert right(table, found, white) > uncorrected + 0.1
    lookup = PoseLookup(database, pca_code(database.transforms))
    blind, left, before = blind_gains([f.picture for f in found], table, lookup)
    assert left < before
    assert right(table, found, blind) > uncorrected + 0.1


def test_a_table_learned_in_the_light_knows_what_is_cut_off(table):
    """Red that is over-exposed: no gain brings yellow and violet back."""
    found = photographs(4, gains=(2.2, 1.0, 0.6))
    white = Gains(1 / 2.2, 1.0, 1 / 0.6)
    cast = (1 / white.red, 1 / white.green, 1 / white.blue)
    own = drawn_colours(SKIN, PATTERN, gains=cast)
    assert right(own, found) > right(table, found, white) + 0.01


def test_mixtures_are_scikit_learns():
    rng = np.random.default_rng(5)
    points = np.concatenate([rng.normal(m, s, (400, 3)) for m, s in ((0.0, 0.5), (4.0, 1.0), (-3.0, 0.3))])
    ours = _Mixture.fitted(points, 3, np.random.default_rng(1))
    theirs = GaussianMixture(3, random_state=1, n_init=3).fit(points)
    density, _ = ours.log_density(points)
    assert density.mean() == pytest.approx(theirs.score(points), abs=0.02)
    means = np.asarray(theirs.means_)
    assert np.allclose(sorted(ours.means[:, 0]), sorted(means[:, 0]), atol=0.1)


def test_things_of_one_colour_are_no_glove():
    labels = np.zeros((100, 120), np.uint8)
    labels[10:40, 10:40] = 3
    labels[60:90, 60:70], labels[60:90, 70:80], labels[60:90, 80:90] = 1, 2, 3
    kept = many_coloured(labels)
    assert not kept[:50].any()
    assert np.array_equal(kept[60:90, 60:90], labels[60:90, 60:90])


def test_a_photograph_is_the_same_twice_and_knows_its_truth():
    state = hand_motion(SKIN, 1.0, 1.0, seed=3)[0]
    plain = Photography(noise=0.0, weave=0.0, folds=0.0, blur_px=0.0, clutter=False, face=False, arm="none")
    first, again = (Photographer(SKIN, PATTERN, CAMERA, plain, 7).photograph(state) for _ in range(2))
    assert np.array_equal(first.picture, again.picture)
    assert np.array_equal(np.unique(first.labels)[0], 0)
    moved = state.moved(np.concatenate([np.zeros(23), [12.0, 0.0, 0.0]]))
    smeared = Photographer(SKIN, PATTERN, CAMERA, plain, 7).photograph(state, moved)
    still = Photographer(SKIN, PATTERN, CAMERA, plain, 7).photograph(
        state.moved((moved.step_from(state)) / 2)
    )
    assert np.array_equal(smeared.labels, still.labels)
    assert np.abs(smeared.picture.astype(int) - still.picture).max() > 40
    dark = Photographer(SKIN, PATTERN, CAMERA, replace(plain, exposure=0.3), 7).photograph(state)
    assert dark.picture.mean() < 0.7 * first.picture.mean()
    with pytest.raises(BadInput, match="gains and exposure above 0"):
        Photography(gains=(0.0, 1.0, 1.0))
    with pytest.raises(BadInput, match="no negative amount"):
        Photography(noise=-1.0)
    with pytest.raises(BadInput, match="'wooden'"):
        Photography(arm="wooden")


def test_light_is_coded_and_back():
    values = np.arange(256)
    assert np.array_equal(encoded_light(linear_light(values)), values)


def test_what_is_no_picture_or_table_is_refused(table, tmp_path: Path):
    picture, labels = np.zeros((40, 50, 3), np.uint8), np.zeros((40, 50), np.uint8)
    for wrong in (picture[..., 0], picture.astype(float)):
        with pytest.raises(BadInput, match="a picture is"):
            table.labels(wrong)
    with pytest.raises(BadInput, match="0 pictures"):
        ColourTable.trained([], [])
    with pytest.raises(BadInput, match="labels"):
        ColourTable.trained([picture], [labels[:20]])
    few = labels.copy()
    few[20, 20:24] = 1
    with pytest.raises(BadInput, match="of colour 1"):
        ColourTable.trained([picture], [few])
    table.save(tmp_path / "table.npz")
    assert np.array_equal(ColourTable.load(tmp_path / "table.npz").labels_of, table.labels_of)
    (tmp_path / "words.npz").write_text("red")
    with pytest.raises(BadInput, match="holds no table"):
        ColourTable.load(tmp_path / "words.npz")
    np.savez(tmp_path / "other.npz", labels_of=np.zeros(5))
    with pytest.raises(BadInput, match="not 64 x 64"):
        ColourTable.load(tmp_path / "other.npz")


def test_what_is_no_white_is_refused():
    everything = np.ones((30, 30), bool)
    for level, message in ((20, "change the exposure"), (255, "change the exposure")):
        with pytest.raises(BadInput, match=message):
            white_gains(np.full((30, 30, 3), level, np.uint8), everything)
    uneven = np.full((30, 30, 3), 80, np.uint8)
    uneven[:, 15:] = 200
    with pytest.raises(BadInput, match="one brightness"):
        white_gains(uneven, everything)
    with pytest.raises(BadInput, match="at least 20"):
        white_gains(uneven, np.zeros((30, 30), bool))
    with pytest.raises(BadInput, match="each must be"):
        Gains(9.0, 1.0, 1.0)


def test_mixed_pixels_of_edges_take_a_side():
    """Stripes as wide as fingers, seen through a lens and JPEG: mixtures are no third colour, and no hole."""
    truth = np.zeros((120, 200), np.uint8)
    for stripe, (low, high) in enumerate(((3, 7), (1, 5), (8, 2), (6, 10))):
        truth[20 + 24 * stripe : 36 + 24 * stripe, 20:100] = low
        truth[20 + 24 * stripe : 36 + 24 * stripe, 100:180] = high
    colours = np.vstack([[150, 150, 145], np.asarray(PRINTED_SRGB)])[:, ::-1].astype(np.uint8)
    seen = cv2.GaussianBlur(colours[truth], (0, 0), 0.8)
    _, packed = cv2.imencode(".jpg", seen, [cv2.IMWRITE_JPEG_QUALITY, 88])
    picture = smoothed(np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR)))
    apart = np.linalg.norm(picture[..., None, :].astype(float) - colours, axis=-1)
    rough = np.where(apart.min(axis=-1) < 30.0, apart.argmin(axis=-1), 0).astype(np.uint8)
    edges = cv2.dilate(truth, np.ones((5, 5), np.uint8)) != cv2.erode(truth, np.ones((5, 5), np.uint8))
    found = with_edges(picture, rough)
    before, after = (float((labels[edges] == truth[edges]).mean()) for labels in (rough, found))
    assert before < 0.9, before
    assert after > 0.99, after
    np.testing.assert_array_equal(found[~edges], truth[~edges])
