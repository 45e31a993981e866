"""A sound of SMPTE linear time code, written bit by bit from the standard's table of the 80 bits."""

from __future__ import annotations

import wave
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np

FIELDS = {  # first bit: (which number, its decimal digit, bits)
    0: ("frame", 0, 4), 8: ("frame", 1, 2), 16: ("second", 0, 4), 24: ("second", 1, 3),
    32: ("minute", 0, 4), 40: ("minute", 1, 3), 48: ("hour", 0, 4), 56: ("hour", 1, 2),
}  # fmt: skip
DROP_BIT, CORRECTION_BIT = 10, 27
SYNC = "0011111111111101"


def frame_bits(hour: int, minute: int, second: int, frame: int, *, drop: bool = False) -> list[int]:
    numbers = {"hour": hour, "minute": minute, "second": second, "frame": frame}
    bits = [0] * 64 + [int(bit) for bit in SYNC]
    for first, (name, digit, size) in FIELDS.items():
        value = numbers[name] // 10**digit % 10
        for place in range(size):
            bits[first + place] = value >> place & 1
    bits[DROP_BIT] = int(drop)
    bits[CORRECTION_BIT] = sum(bits) % 2  # an even number of ones keeps the polarity at 24 and 30
    return bits


def ltc_sound(
    labels: list[tuple[int, int, int, int]],
    frames_per_s: float,
    samples_per_s: int = 48_000,
    *,
    begin_s: float = 0.1,
    drop: bool = False,
    oversampling: int = 20,
) -> np.ndarray:
    """(N,) samples: silence for ``begin_s``, then a frame for each label; edges rise within a sample."""
    bits = [bit for label in labels for bit in frame_bits(*label, drop=drop)]
    bit_s, level, times, levels = 1 / frames_per_s / 80, 1.0, [0.0], [0.0]
    for number, bit in enumerate(bits):
        level = -level  # an edge at the begin of each bit, and in the middle of a 1
        times.append(begin_s + number * bit_s)
        levels.append(level)
        if bit:
            level = -level
            times.append(begin_s + (number + 0.5) * bit_s)
            levels.append(level)
    end_s = begin_s + len(bits) * bit_s
    times.append(end_s)
    levels.append(0.0)
    samples = round((end_s + 0.05) * samples_per_s) * oversampling
    fine = (
        (np.arange(samples) - oversampling / 2 + 0.5) / samples_per_s / oversampling
    )  # a sample's middle is its time
    square = np.array(levels)[np.searchsorted(times, fine, side="right") - 1]
    return square.reshape(-1, oversampling).mean(axis=1)


def endless_ltc(first: int, samples_per_s: int) -> Iterator[np.ndarray]:
    """Seconds of sound of 25 frames a second, frame ``first`` of the day at its beginning. Each frame has an
    even number of edges, so that seconds fit together."""
    for second in count(first // 25):
        hour, minute = second // 3600 % 24, second // 60 % 60
        labels = [(hour, minute, second % 60, frame) for frame in range(25)]
        yield ltc_sound(labels, 25.0, samples_per_s, begin_s=0.0)[:samples_per_s]


def pcm(channels: np.ndarray, width: int = 2) -> bytes:
    """(N, channels), full scale 1, as samples of ``width`` bytes."""
    top = 2 ** (8 * width - 1) - 1
    whole = np.round(np.clip(channels, -1, 1) * top).astype("<i8")
    if width == 1:
        return (whole + 128).astype(np.uint8).tobytes()
    return whole.reshape(-1).view(np.uint8).reshape(-1, 8)[:, :width].tobytes()


def write_wav(path: Path, channels: np.ndarray, samples_per_s: int = 48_000, width: int = 2) -> Path:
    """(N, channels), full scale 1, as PCM of ``width`` bytes."""
    with wave.open(str(path), "wb") as sound:
        sound.setnchannels(channels.shape[1])
        sound.setsampwidth(width)
        sound.setframerate(samples_per_s)
        sound.writeframes(pcm(channels, width))
    return path
