"""Takes of a home-made flex glove whose sensors answer in ways that no calibration was told of.

Five fingers, each with one joint and one sensor, and a thumb read by two sensors whose product matters.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from glovecal_models.layout import Layout
from glovecal_models.takes.take import Take

LAYOUT = Layout.from_toml("""
name = "flex-glove"
sensors = ["T", "T2", "I", "M", "R", "P"]
[rotations]
T_MCP = ["T", "T2"]
I_PIP = ["I"]
M_PIP = ["M"]
R_PIP = ["R"]
P_PIP = ["P"]
""")
ROTATIONS = LAYOUT.rotations
Response = Callable[[np.ndarray], np.ndarray]
"""Share of the bend (0 to 1) to share of the supply voltage (0 to 1), both of any shape."""


def inverted(polynomial: Response) -> Response:
    """The sensor whose angle is a rising ``polynomial`` of its reading."""
    grid = np.linspace(-0.2, 1.2, 4001)
    return lambda bend: np.interp(bend, polynomial(grid), grid)


def sigmoid(steepness: float) -> Response:
    """A sensor that answers mostly in the middle of its range, as conductive foam does."""
    return lambda bend: 1 / (1 + np.exp(-steepness * (bend - 0.5)))


def stepped(width: float) -> Response:
    """A line with a sudden rise in its middle, as a cracked track has; the fall of the angle is a step."""
    return lambda bend: 0.35 * bend + 0.3 * (1 + np.tanh((bend - 0.45) / width)) / 2 + 0.1


def cracked(smooth: Response) -> Response:
    """A ``smooth`` answer with a narrow step in it: two lengths at once."""
    return lambda bend: 0.1 + 0.6 * smooth(bend) + 0.06 * np.tanh((bend - 0.6) / 0.015)


def linear(bend: np.ndarray) -> np.ndarray:
    return 0.1 + 0.7 * bend


SQUARE = inverted(lambda reading: 0.35 * reading + 0.65 * reading**2)
CUBIC = inverted(lambda reading: reading + 2.4 * reading * (reading - 0.5) * (reading - 1.0))
POLYNOMIAL_GLOVE = (SQUARE, CUBIC, SQUARE, CUBIC)
UNKNOWN_GLOVE = (sigmoid(7.0), stepped(0.02), cracked(SQUARE), sigmoid(11.0))
LINEAR_GLOVE = (linear,) * 4


def flex_takes(
    responses: tuple[Response, ...],
    seed: int,
    takes: int = 6,
    frames: int = 150,
    *,
    product: float = 0.0,
    noise_deg: float = 1.0,
) -> list[Take]:
    """Free motion at 20 Hz, 10-bit readings, reference noise in degrees.

    ``responses`` are those of the four fingers. The thumb's angle is the sum of its two sensors' bends, plus
    ``product`` times their product.
    """
    return [_take(responses, seed, number, frames, product, noise_deg) for number in range(takes)]


def _take(
    responses: tuple[Response, ...], seed: int, number: int, frames: int, product: float, noise_deg: float
) -> Take:
    random = np.random.default_rng([seed, number])
    time = np.arange(frames) / 20
    speed, phase = random.uniform(0.15, 0.6, (2, 6)), random.uniform(0, 2 * np.pi, (2, 6))
    wave = np.sin(2 * np.pi * time[:, None, None] * speed + phase).mean(axis=1)
    bend = np.clip(0.5 + 0.55 * wave, 0, 1)
    thumb = 40 * bend[:, 0] + 25 * bend[:, 1] + product * 60 * (bend[:, 0] - 0.5) * (bend[:, 1] - 0.5)
    angles = np.column_stack([thumb, 95 * bend[:, 2:]])
    volts = [linear(bend[:, 0]), linear(bend[:, 1])]
    volts += [response(bend[:, 2 + finger]) for finger, response in enumerate(responses)]
    readings = np.column_stack(volts) + random.normal(scale=0.003, size=(frames, 6))
    return Take(
        name=f"free-{number}",
        wearing="first",
        sensors=LAYOUT.sensors,
        time_s=time,
        readings=np.round(1023 * readings).clip(0, 1023),
        rotations=ROTATIONS,
        reference_time_s=time,
        reference=angles + random.normal(scale=noise_deg, size=angles.shape),
        simulated=True,
    )


SLEEVE = Layout.from_toml("""
name = "sleeve"
sensors = ["A", "B", "C", "D"]
[rotations]
BEND = ["A", "B", "C", "D"]
""")


def sleeve_takes(seed: int, takes: int = 6, frames: int = 80, *, noise_deg: float = 1.0) -> list[Take]:
    """An elbow sleeve of four stretch sensors that pull at each other: the angle is quadratic in all four."""
    return [_sleeve_take(seed, number, frames, noise_deg) for number in range(takes)]


def _sleeve_take(seed: int, number: int, frames: int, noise_deg: float) -> Take:
    random = np.random.default_rng([seed, number, 7])
    time = np.arange(frames) / 20
    speed, phase = random.uniform(0.15, 0.6, (2, 4)), random.uniform(0, 2 * np.pi, (2, 4))
    wave = np.sin(2 * np.pi * time[:, None, None] * speed + phase).mean(axis=1)
    a, b, c, d = np.clip(0.5 + 0.55 * wave, 0, 1).T
    angle = 40 * a - 25 * b + 45 * a * c + 30 * b * d - 25 * c**2 + 20 * d
    readings = 100 + 800 * np.column_stack([a, b, c, d]) + random.normal(scale=3.0, size=(frames, 4))
    return Take(
        name=f"free-{number}",
        wearing="first",
        sensors=SLEEVE.sensors,
        time_s=time,
        readings=np.round(readings).clip(0, 1023),
        rotations=SLEEVE.rotations,
        reference_time_s=time,
        reference=(angle + random.normal(scale=noise_deg, size=frames))[:, None],
        simulated=True,
    )
