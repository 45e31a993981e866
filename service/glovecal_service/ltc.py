"""Linear time code (LTC) out of a sound: SMPTE 12M frames of 80 bits in biphase mark, with numpy."""

from __future__ import annotations

import wave
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glovecal_models.errors import BadInput
from glovecal_models.takes.time_code import RATES, Counting, TimeCode

BITS = 80
SYNC = np.array([int(bit) for bit in "0011111111111101"], np.uint8)
UNREAD = 2
"""In the place of a bit that cannot be read."""
HALF_OR_WHOLE_S = 0.34e-3
"""Between half a bit (0.21 to 0.26 ms at 30 to 23.976 frames a second) and a whole one."""
SHORTEST_S, LONGEST_BIT_S = 0.1e-3, 0.75e-3
"""Of an interval between edges: anything else is no time code, and what follows is read anew."""
LEVEL_OVER_S = 10e-3
LEAST_SAMPLES_PER_S = 8000
"""Fewer tell a half bit from a whole one no more."""
QUIET = 1e-3
"""Of full scale: below it there is no signal."""
DEAD_ZONE = 0.25
"""Of the mean level: noise within it makes no edges."""
BLOCK_OF_SOUND_S = 30.0
OVERLAP_S = 0.5
SOUND_RATES = ("23.976", "24", "25", "29.97", "30")
"""An LTC frame counts 30 at most."""
ODD_PPM = 300.0
"""Sound cards and generators are within 100 ppm; 29.97 and 30 are 1000 apart."""


@dataclass(frozen=True)
class LtcFrames:
    """Whole frames in the order in which they sound, (F,) each."""

    start_s: np.ndarray
    """Of the first edge, seconds since the sound began."""
    labels: np.ndarray
    """(F, 4): hours, minutes, seconds, number of the frame."""
    drop: np.ndarray
    """Whether the frame carries the drop-frame flag."""

    def __len__(self) -> int:
        return len(self.start_s)


@dataclass(frozen=True)
class LtcReading:
    """What a sound file's time code came to."""

    time_code: TimeCode
    """Its ``time_s`` counts from the sound's beginning."""
    frames: int
    unused: int
    """Frames that do not continue the longest stretch: the time code jumped, or stood."""
    drift_ppm: float
    """By how much the time code runs faster than its nominal rate on the sound's clock."""
    channel: int

    @property
    def sentences(self) -> list[str]:
        code = self.time_code
        lines = [
            f"Time code {code.label} at {code.time_s:.4f} s of the sound, {code.counting.named} frames a "
            f"second ({self.frames} frames, channel {self.channel})."
        ]
        if self.unused:
            lines.append(
                f"{self.unused} other frames do not follow on: the time code jumped or stood. Only the "
                "longest stretch is used."
            )
        if abs(self.drift_ppm) > ODD_PPM:
            lines.append(
                f"It runs {abs(self.drift_ppm):.0f} ppm {'faster' if self.drift_ppm > 0 else 'slower'} than "
                f"{code.rate} frames a second; check the rate."
            )
        return lines


def decode_ltc(samples: np.ndarray, samples_per_s: float) -> LtcFrames:
    """Frames in ``samples`` (N,), floats with full scale 1 or integers; all else is passed over.

    They are read in blocks that overlap by more than a frame, so that each frame is whole in its own.
    """
    starts, labels, drops = [np.zeros(0)], [np.zeros((0, 4), int)], [np.zeros(0, bool)]
    step, more = round(BLOCK_OF_SOUND_S * samples_per_s), round(OVERLAP_S * samples_per_s)
    for begin in range(0, len(samples), step):
        low = max(0, begin - more)
        block = _full_scale(samples[low : begin + step + more])
        part = _frames_of((low + _edges(block, samples_per_s)) / samples_per_s)
        own = (part.start_s >= begin / samples_per_s) & (part.start_s < (begin + step) / samples_per_s)
        starts.append(part.start_s[own])
        labels.append(part.labels[own])
        drops.append(part.drop[own])
    return LtcFrames(np.concatenate(starts), np.concatenate(labels), np.concatenate(drops))


def _full_scale(samples: np.ndarray) -> np.ndarray:
    largest = np.iinfo(samples.dtype).max if samples.dtype.kind == "i" else 1
    return samples.astype(np.float32) / largest


def _edges(samples: np.ndarray, samples_per_s: float) -> np.ndarray:
    """Where the signal changes its sign, in samples, between two of them by a straight line."""
    width = max(3, round(LEVEL_OVER_S * samples_per_s))
    if len(samples) < 2 * width:
        return np.zeros(0)
    signal = samples - _moving_mean(samples, width)
    level = _moving_mean(np.abs(signal), width)
    clear = np.flatnonzero((np.abs(signal) > DEAD_ZONE * level) & (level > QUIET))
    if len(clear) < 2:
        return np.zeros(0)
    changes = np.flatnonzero(np.diff(np.signbit(signal[clear])))
    before, after = clear[changes], clear[changes + 1]
    low, high = signal[before].astype(float), signal[after].astype(float)
    return before + (after - before) * low / (low - high)


def _moving_mean(values: np.ndarray, width: int) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)])
    at = np.arange(len(values))
    low, high = np.maximum(0, at - width // 2), np.minimum(len(values), at + width // 2 + 1)
    return (total[high] - total[low]) / (high - low)


def _frames_of(edges_s: np.ndarray) -> LtcFrames:
    bits, starts = _bits(edges_s)
    if len(bits) < BITS:
        return LtcFrames(np.zeros(0), np.zeros((0, 4), int), np.zeros(0, bool))
    windows = np.lib.stride_tricks.sliding_window_view(bits, BITS)
    begins = np.flatnonzero((windows[:, -len(SYNC) :] == SYNC).all(axis=1))
    begins = begins[(windows[begins] < UNREAD).all(axis=1)]
    frames = windows[begins]
    labels = np.stack(
        [_number(frames, units, tens) for units, tens in (((48, 4), (56, 2)), ((32, 4), (40, 3)),
         ((16, 4), (24, 3)), ((0, 4), (8, 2)))], axis=1,
    )  # fmt: skip
    is_label = (labels < [24, 60, 60, 30]).all(axis=1)
    return LtcFrames(starts[begins][is_label], labels[is_label], frames[is_label, 10].astype(bool))


def _bits(edges_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bits (0, 1, ``UNREAD``) and the edge each begins at.

    A whole interval is a 0, two halves are a 1. Halves are paired from where a run of them begins.
    """
    interval = np.diff(edges_s)
    is_half = interval < HALF_OR_WHOLE_S
    is_odd = (interval < SHORTEST_S) | (interval > LONGEST_BIT_S)
    at = np.arange(len(interval))
    begins_run = is_half & ~np.concatenate([[False], is_half[:-1]])
    run_begin = np.maximum.accumulate(np.where(begins_run, at, 0))
    is_second = is_half & ((at - run_begin) % 2 == 1)
    ends_alone = is_half & ~is_second & ~np.concatenate([is_half[1:], [False]])
    bits = np.where(is_half, 1, 0).astype(np.uint8)
    bits[is_odd | ends_alone] = UNREAD
    return bits[~is_second], edges_s[:-1][~is_second]


def _number(frames: np.ndarray, units: tuple[int, int], tens: tuple[int, int]) -> np.ndarray:
    one, ten = (
        frames[:, begin : begin + size].astype(int) @ (1 << np.arange(size)) for begin, size in (units, tens)
    )
    return np.where(one < 10, 10 * ten + one, 99)


def read_ltc(path: Path, *, rate: str | None = None, channel: int | None = None) -> LtcReading:
    """The time code of a WAV file. ``rate``: a name in ``RATES``, None to measure it; ``channel``: counted
    from 1, None for the one with most time code.

    Raises BadInput that says what is wrong with the file, OSError.
    """
    channels, samples_per_s = _channels(path)
    if channel is not None and not 1 <= channel <= channels.shape[1]:
        raise BadInput(f"{path.name} has channels 1 to {channels.shape[1]}, not {channel}")
    chosen = range(channels.shape[1]) if channel is None else [channel - 1]
    decoded = {each: decode_ltc(channels[:, each], samples_per_s) for each in chosen}
    best = max(decoded, key=lambda each: len(decoded[each]))
    frames = decoded[best]
    if len(frames) < 2:
        raise BadInput(
            f"{path.name} holds no time code (LTC) in {_channel_names(channel, channels.shape[1])}: is it "
            "the sound of the time code, recorded loud enough?"
        )
    return reading_of(frames, rate, path.name, best + 1)


def _channel_names(channel: int | None, channels: int) -> str:
    if channel is not None:
        return f"channel {channel}"
    return "its channel" if channels == 1 else f"any of its {channels} channels"


def _channels(path: Path) -> tuple[np.ndarray, int]:
    """(N, channels) integers."""
    try:
        with wave.open(str(path), "rb") as sound:
            width, count, samples_per_s = sound.getsampwidth(), sound.getnchannels(), sound.getframerate()
            there = path.stat().st_size // (width * count)  # a damaged header may promise gigabytes
            content = sound.readframes(min(sound.getnframes(), there))
    except (wave.Error, EOFError, RuntimeError):  # wave's own complaints of a damaged file
        raise BadInput(
            f"{path.name} cannot be read as WAV with PCM samples; save it as 16-bit WAV and try again"
        ) from None
    if width > 4 or samples_per_s < LEAST_SAMPLES_PER_S:
        raise BadInput(
            f"{path.name} has {8 * width}-bit samples, {samples_per_s} a second; save it with 8 to 32 bits "
            f"and {LEAST_SAMPLES_PER_S} or more a second"
        )
    return pcm_samples(
        content[: len(content) // (width * count) * width * count], width, count
    ), samples_per_s


def pcm_samples(content: bytes, width: int, channels: int) -> np.ndarray:
    """(N, channels) integers, of whole samples of ``width`` bytes as WAV has them."""
    if width == 3:  # the two upper bytes
        samples = np.frombuffer(content, np.uint8).reshape(-1, 3)[:, 1:].copy().view("<i2")[:, 0]
    elif width == 1:
        samples = (np.frombuffer(content, np.uint8).astype(np.int16) - 128) * 256
    else:
        samples = np.frombuffer(content, {2: "<i2", 4: "<i4"}[width])
    return samples.reshape(-1, channels)


def reading_of(frames: LtcFrames, rate: str | None, name: str, channel: int) -> LtcReading:
    """What frames come to. Raises BadInput where ``rate`` cannot be, or is None and cannot be measured."""
    drop = bool(np.median(frames.drop))
    counting = Counting(rate or ("29.97" if drop else _measured_rate(frames)), drop)
    per_s = float(counting.frames_per_s)
    numbers, times = _numbered(frames, counting)
    phase = times * per_s - numbers
    stretch = np.concatenate([[0], np.cumsum(np.abs(np.diff(phase)) > 0.5)])
    longest = stretch == np.bincount(stretch).argmax()
    begin_s = (times - (numbers - numbers[longest][0]) / per_s)[longest]
    slope = np.polyfit(times[longest], numbers[longest], 1)[0] if longest.sum() > 1 else per_s
    label = counting.label(int(numbers[longest][0]))
    return LtcReading(
        TimeCode(label, counting.rate, drop, float(np.median(begin_s)), f"LTC of {name}"),
        int(longest.sum()), len(frames) - int(longest.sum()), float((slope / per_s - 1) * 1e6), channel,
    )  # fmt: skip


def _numbered(frames: LtcFrames, counting: Counting) -> tuple[np.ndarray, np.ndarray]:
    """Those whose label can be counted at that rate: their numbers, unwrapped over midnight, and times."""
    numbers, times = [], []
    for label, start_s in zip(frames.labels.tolist(), frames.start_s.tolist(), strict=True):
        try:
            numbers.append(counting.frame(*label))
        except BadInput:
            continue
        times.append(start_s)
    if not numbers:
        raise BadInput(f"its time code does not count {counting.named} frames a second; give another rate")
    whole = np.unwrap(np.array(numbers, float), period=counting.frames_per_day)
    return whole, np.array(times)


def _measured_rate(frames: LtcFrames) -> str:
    """By the time between frames whose numbers follow each other within a second."""
    follows = (np.diff(frames.labels[:, 3]) == 1) & (np.diff(frames.labels[:, 2]) == 0)
    between = np.diff(frames.start_s)[follows]
    if not len(between):
        raise BadInput("too little time code to tell its frame rate; give it")
    lasts = float(between[np.abs(between / np.median(between) - 1) < 0.1].mean())
    return min(SOUND_RATES, key=lambda name: abs(lasts * float(RATES[name]) - 1))
