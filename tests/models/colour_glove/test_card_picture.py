"""The printed colour card is found in pictures, and a table made by it reads another printer's colours."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import pytest

from glovecal_models.colour_glove.camera_model import Camera
from glovecal_models.colour_glove.pattern import PRINTED_SRGB, encoded_light, linear_light, printed_pattern
from glovecal_models.colour_glove.photograph import (
    Photographer,
    Photography,
    hand_motion,
    labelled_photographs,
)
from glovecal_models.colour_glove.pictures.classify import ColourTable
from glovecal_models.colour_glove.pictures.white_balance import card_colours, page_corners
from glovecal_models.colour_glove.sheets.calibration_board import colour_card
from glovecal_models.colour_glove.sheets.sheet import write_sheets
from glovecal_models.colour_glove.skin import hand_skin
from glovecal_models.errors import BadInput

INK = np.array([[0.86, 0.08, 0.02], [0.05, 0.80, 0.09], [0.04, 0.10, 0.74]]) * 0.85 + 0.02
"""What another printer makes of linear light: paler, darker, each colour a little of the others."""
LIGHT = (1.25, 1.0, 0.7)
CORNERS = np.array([(150.0, 60.0), (455.0, 90.0), (430.0, 440.0), (120.0, 420.0)])


def printed(light: np.ndarray) -> np.ndarray:
    """Linear light (N, 3) as the other printer prints it; paper stays white."""
    return np.where(light.min(axis=-1, keepdims=True) > 0.9, light, light @ INK.T)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """The card's PDF as the other printer prints it: linear light, red, green, blue."""
    file = write_sheets(tmp_path_factory.mktemp("card"), "card", [colour_card("a4")])[0]
    document = pypdfium2.PdfDocument(io.BytesIO(Path(file).read_bytes()))
    pixels = np.asarray(document[0].render(scale=2).to_pil().convert("RGB"))
    document.close()
    return printed(linear_light(pixels))


def photographed(
    page: np.ndarray, corners: np.ndarray, light: tuple[float, float, float] = LIGHT
) -> np.ndarray:
    """A picture (480, 640, 3) of the page on a table: light, blur, noise, eight bits."""
    rng, (height, width) = np.random.default_rng(1), page.shape[:2]
    ends = np.array([(0, 0), (width, 0), (width, height), (0, height)], dtype=np.float32)
    turn = cv2.getPerspectiveTransform(ends, corners.astype(np.float32))
    table = np.tile(np.array([0.09, 0.06, 0.04]), (480, 640, 1))
    seen = cv2.warpPerspective(page.astype(np.float32), turn, (640, 480))
    there = cv2.warpPerspective(np.ones((height, width), np.float32), turn, (640, 480))[..., None]
    shaded = 0.6 * np.linspace(0.9, 1.0, 640)[None, :, None]
    light_there = (seen + (1 - there) * table) * np.array(light) * shaded
    blurred = cv2.GaussianBlur(light_there, (0, 0), 0.8)
    noisy = blurred + np.sqrt(np.maximum(blurred, 0) * 4e-4 + 4e-6) * rng.standard_normal(blurred.shape)
    return np.ascontiguousarray(encoded_light(noisy)[..., ::-1])


def test_the_page_is_found_and_its_colours_and_the_light_are_told(page: np.ndarray) -> None:
    true = printed(linear_light(PRINTED_SRGB))
    for turn in range(4):
        corners = np.roll(CORNERS, turn, axis=0)
        found = card_colours([photographed(page, corners)])
        assert found.corners_px == pytest.approx(corners, abs=3.0)
        assert 1 / found.gains.red == pytest.approx(1.25, rel=0.05)
        assert 1 / found.gains.blue == pytest.approx(0.7, rel=0.05)
        apart = encoded_light(found.inks).astype(float) - encoded_light(true)
        assert np.sqrt((apart**2).mean()) < 8.0
    given = card_colours([photographed(page, CORNERS)], corners_px=np.roll(CORNERS, 2, axis=0))
    assert given.corners_px == pytest.approx(CORNERS)


def test_what_is_no_card_is_said(page: np.ndarray) -> None:
    with pytest.raises(BadInput, match="page is not found"):
        page_corners(np.full((480, 640, 3), 90, np.uint8))
    with pytest.raises(BadInput, match="does not look like the colour card"):
        card_colours([photographed(np.ones_like(page), CORNERS)])
    with pytest.raises(BadInput, match=r"white reference has levels .* change the exposure"):
        card_colours([photographed(page, CORNERS, (2.6, 2.6, 2.6))])
    with pytest.raises(BadInput, match="only one where corners are given"):
        card_colours([photographed(page, CORNERS)] * 2, corners_px=CORNERS)
    alike, orange = page.copy(), printed(linear_light(PRINTED_SRGB[1]))
    nearly_red = linear_light(PRINTED_SRGB[0] + np.array([14, 10, 4], np.uint8))
    alike[np.abs(page - orange).max(axis=2) < 0.02] = printed(nearly_red)
    with pytest.raises(BadInput, match="look alike"):
        card_colours([photographed(alike, CORNERS)])


def test_a_table_by_the_card_reads_another_printers_colours_in_another_light(page: np.ndarray) -> None:
    skin, pattern, camera = hand_skin(), printed_pattern(), Camera()
    card = card_colours([photographed(page, CORNERS)])
    gains = (1 / card.gains.red, 1.0, 1 / card.gains.blue)
    inks, look = printed(linear_light(PRINTED_SRGB)), Photography(gains=LIGHT)
    learned = labelled_photographs(skin, pattern, camera, inks=card.inks, gains=gains)
    table = ColourTable.trained([each.picture for each in learned], [each.labels for each in learned])
    right = []
    for index, state in enumerate(hand_motion(skin, 6.0, 0.5, seed=43)):
        seen = Photographer(skin, pattern, camera, look, 700 + index, inks).photograph(state)
        glove = seen.labels > 0
        right.append((table.labels(seen.picture)[glove] == seen.labels[glove]).mean())
    assert np.mean(right) > 0.93
