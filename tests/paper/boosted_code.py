"""The paper's code: bits learned by boosting so that near images differ in few of them.

Similarity-sensitive coding (Wang & Popovic 2009, section 5.2, after Shakhnarovich et al. 2003): bit n of an
image is whether one value of its distance transform, e_n, is above a threshold T_n. GentleBoost chooses both
on pairs of images: near pairs should agree in a bit, other pairs differ. A difference array over the 256
possible values scores all thresholds of a feature in one pass over the pairs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from glovecal_models.colour_glove.crop import distances
from glovecal_models.colour_glove.lookup import pca_code, smallest
from glovecal_models.errors import BadInput
from glovecal_models.progress import Cancel, Report, stop_if

BITS = 192
PAIRS = 10_000
"""Near ones; twice as many are not near."""
_NEIGHBOURS = 5
_TRIED = 2000
"""Random features in each round of boosting."""
_CANDIDATES = 300
_VALUES = 256


@dataclass(frozen=True, eq=False)
class BoostedCode:
    """N codes of B bits."""

    features: np.ndarray
    """(B,) int64: places in the flattened distance transform."""
    thresholds: np.ndarray
    """(B,) uint8."""
    codes: np.ndarray
    """(N, B / 64) uint64."""

    def nearest(self, transform: np.ndarray, count: int) -> np.ndarray:
        """The ``count`` entries with the smallest Hamming distance, nearest first."""
        return smallest(self.hamming(transform), count)

    def hamming(self, transform: np.ndarray) -> np.ndarray:
        """(N,): bits that differ from those of a distance transform."""
        return _hamming(self.codes, _packed(transform.reshape(1, -1), self.features, self.thresholds)[0])

    def shortened(self, bits: int) -> BoostedCode:
        """The first ``bits`` of each code: those boosting chose first. Raises BadInput for more."""
        if not 1 <= bits <= len(self.features):
            raise BadInput(f"{bits} bits of a code of {len(self.features)}")
        words = -(-bits // 64)
        codes = self.codes[:, :words].copy()
        if bits % 64:
            codes[:, -1] &= np.uint64((1 << (bits % 64)) - 1)
        return BoostedCode(self.features[:bits], self.thresholds[:bits], codes)


def boosted_code(
    tiny: np.ndarray,
    transforms: np.ndarray,
    bits: int = BITS,
    pairs: int = PAIRS,
    *,
    seed: int = 1,
    report: Report | None = None,
    cancelled: Cancel | None = None,
) -> BoostedCode:
    """Learn from entries' tiny images (N, 40, 40) and distance transforms (N, C, 40, 40), and code all.

    Raises BadInput for fewer than 50 entries, Cancelled.
    """
    if len(tiny) < 50 or bits < 1 or pairs < 10:
        raise BadInput(f"{bits} bits from {pairs} pairs of {len(tiny)} entries; at least 1, 10 and 50 needed")
    rng = np.random.default_rng(seed)
    near = _near_pairs(tiny, transforms, pairs, rng, report, cancelled)
    far = rng.integers(0, len(tiny), (2 * len(near), 2))
    far = far[far[:, 0] != far[:, 1]]
    both = np.concatenate([near, far])
    wanted = np.concatenate([np.ones(len(near)), -np.ones(len(far))])
    used, places = np.unique(both, return_inverse=True)
    flat = transforms.reshape(len(transforms), -1)
    values = np.ascontiguousarray(flat[used].T)
    places = np.ascontiguousarray(places.reshape(both.shape))
    weights = np.where(wanted > 0, 0.5 / len(near), 0.5 / len(far))
    features, thresholds = np.empty(bits, np.int64), np.empty(bits, np.uint8)
    for bit in range(bits):
        stop_if(cancelled, "learning codes")
        tried = rng.choice(len(values), min(_TRIED, len(values)), replace=False)
        features[bit], thresholds[bit], agree, differ = _best_stump(values, tried, places, wanted, weights)
        split = _splits(values[features[bit]], places, thresholds[bit])
        weights *= np.exp(-wanted * np.where(split, differ, agree))
        weights /= weights.sum()
        if report:
            report("boosting", 0.3 + 0.65 * bit / bits)
    parts = [_packed(flat[low : low + 1000], features, thresholds) for low in range(0, len(flat), 1000)]
    return BoostedCode(features, thresholds, np.concatenate(parts))


def _near_pairs(
    tiny: np.ndarray,
    transforms: np.ndarray,
    pairs: int,
    rng: np.random.Generator,
    report: Report | None,
    cancelled: Cancel | None,
) -> np.ndarray:
    """(P, 2): entries with each of their five nearest, which are looked for among 300 by the plain code."""
    code = pca_code(transforms, min(32, len(tiny)))
    queries = rng.permutation(len(tiny))[: max(1, pairs // _NEIGHBOURS)]
    found = []
    for done, query in enumerate(queries):
        if done % 100 == 0:
            stop_if(cancelled, "learning codes")
            if report:
                report("looking for near pairs", 0.3 * done / len(queries))
        close = code.nearest(transforms[query], _CANDIDATES)
        close = close[close != query]
        apart = distances(tiny[query], transforms[query], tiny, transforms, close)
        found += [(query, other) for other in close[np.argsort(apart, kind="stable")[:_NEIGHBOURS]]]
    return np.array(found)


@numba.njit(cache=True)
def _best_stump(values, tried, places, wanted, weights):  # type: ignore[no-untyped-def]
    """Feature, threshold, and what the regression says of pairs that agree and differ in the bit.

    Weighted least squares of ``wanted`` on the bit's agreement: the least error has the largest sum of
    (sum of w z) ** 2 / (sum of w) over the two groups.
    """
    total_weight, total = 0.0, 0.0
    for pair in range(len(places)):
        total_weight += weights[pair]
        total += weights[pair] * wanted[pair]
    best, best_feature, best_threshold, best_agree, best_differ = -1.0, 0, 0, 0.0, 0.0
    weight_of, sum_of = np.empty(_VALUES), np.empty(_VALUES)
    for feature in tried:
        row = values[feature]
        weight_of[:] = 0.0
        sum_of[:] = 0.0
        for pair in range(len(places)):
            low, high = row[places[pair, 0]], row[places[pair, 1]]
            if low == high:
                continue
            if low > high:
                low, high = high, low
            # The bit is value > threshold: it differs for thresholds from low to high - 1.
            weight_of[low] += weights[pair]
            weight_of[high] -= weights[pair]
            sum_of[low] += weights[pair] * wanted[pair]
            sum_of[high] -= weights[pair] * wanted[pair]
        weight, summed = 0.0, 0.0
        for threshold in range(_VALUES - 1):
            weight += weight_of[threshold]
            summed += sum_of[threshold]
            rest = total_weight - weight
            if weight < 1e-9 or rest < 1e-9:
                continue
            # A bit in which near pairs differ more than others would count the wrong way.
            if summed / weight > (total - summed) / rest:
                continue
            score = summed**2 / weight + (total - summed) ** 2 / rest
            if score > best:
                best, best_feature, best_threshold = score, feature, threshold
                best_agree, best_differ = (total - summed) / rest, summed / weight
    return best_feature, best_threshold, best_agree, best_differ


def _splits(row: np.ndarray, places: np.ndarray, threshold: int) -> np.ndarray:
    above = row > threshold
    return above[places[:, 0]] != above[places[:, 1]]


def _packed(flat: np.ndarray, features: np.ndarray, thresholds: np.ndarray) -> np.ndarray:
    """(N, words) uint64: bit n of a code is bit n % 64 of word n // 64."""
    bits = flat[:, features] > thresholds
    padded = np.zeros((len(bits), -(-len(features) // 64) * 64), np.uint8)
    padded[:, : bits.shape[1]] = bits
    return np.packbits(padded, axis=1, bitorder="little").view("<u8").astype(np.uint64)


@numba.njit(cache=True)
def _hamming(codes, query):  # type: ignore[no-untyped-def]
    found = np.empty(len(codes), dtype=np.int32)
    for entry in range(len(codes)):
        count = 0
        for word in range(len(query)):
            bits = codes[entry, word] ^ query[word]
            # Bits counted in pairs, in fours, in bytes, and the bytes summed by one product.
            bits = bits - ((bits >> np.uint64(1)) & np.uint64(0x5555555555555555))
            bits = (bits & np.uint64(0x3333333333333333)) + (
                (bits >> np.uint64(2)) & np.uint64(0x3333333333333333)
            )
            bits = (bits + (bits >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
            count += int((bits * np.uint64(0x0101010101010101)) >> np.uint64(56))
        found[entry] = count
    return found
