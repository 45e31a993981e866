"""The ten colours of the glove, as printed: far apart from each other and from skin in any common light."""

from __future__ import annotations

import numpy as np

COLOUR_NAMES = (
    "red", "orange", "yellow", "lime", "green", "turquoise", "sky blue", "dark blue", "violet", "pink",
)  # fmt: skip
PRINTED_SRGB = np.array(
    [
        (196, 24, 36), (244, 120, 16), (250, 222, 30), (150, 206, 52), (16, 124, 62),
        (24, 176, 160), (70, 160, 232), (24, 50, 150), (112, 46, 146), (238, 84, 160),
    ],
    dtype=np.uint8,
)  # fmt: skip
"""(10, 3) red, green, blue; of colour 1 and so on in label images."""


def linear_light(srgb: np.ndarray) -> np.ndarray:
    """Of values 0 to 255: the light they stand for, 0 to 1 (IEC 61966-2-1)."""
    share = np.asarray(srgb, dtype=np.float32) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4).astype(np.float32)


def encoded_light(light: np.ndarray) -> np.ndarray:
    """uint8 of light; the inverse of ``linear_light``, cut at white."""
    share = np.clip(light, 0.0, 1.0)
    coded = np.where(share <= 0.0031308, 12.92 * share, 1.055 * share ** (1 / 2.4) - 0.055)
    return np.rint(255.0 * coded).astype(np.uint8)
