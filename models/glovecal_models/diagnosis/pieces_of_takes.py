"""Mean errors of pieces of takes beside the means of a column that changes between takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glovecal_models.diagnosis.forward_design import ForwardDesign


@dataclass(frozen=True)
class Pieces:
    """Mean errors of one joint."""

    error: np.ndarray
    """(T, P), degrees; of rows that count by their weights as ``Rows.rooted``."""
    column: np.ndarray
    """(T, P), evenly spread and scaled to 0..1."""
    piece: tuple[np.ndarray, ...]
    """For each unit (N,): the piece of each of its rows, counted through all takes."""
    low: float = 0.0
    span: float = 1.0
    """Of the column as it was recorded."""


@dataclass(frozen=True)
class _Cut:
    """One joint's rows in pieces, whatever the column."""

    error: np.ndarray
    """(T, P), degrees."""
    piece: tuple[np.ndarray, ...]
    """For each unit (N,)."""
    rows: tuple[tuple[bytes, tuple[np.ndarray, ...]], ...]
    """For each take a key of its rows, and those of each piece."""

    @classmethod
    def of(cls, design: ForwardDesign, joint: int, pieces: int) -> _Cut | None:
        """None where a take has no error of the joint."""
        takes = len(design.signals)
        rows_of: list[list[np.ndarray]] = [[] for _ in range(takes)]
        for take, rows in design.units(joint):
            rows_of[take].append(rows)
        found, piece = [], []
        for parts in rows_of:
            rows = np.sort(np.concatenate(parts)) if parts else np.empty(0, dtype=int)
            if len(rows) < pieces:
                return None
            found.append((rows.tobytes(), tuple(np.array_split(rows, pieces))))
        error, count = np.zeros((takes, pieces)), np.zeros((takes, pieces))
        edges = [np.array([part[0] for part in cut[1:]]) for _, cut in found]
        for (take, rows), residual in zip(design.units(joint), design.products[joint].residual, strict=True):
            at = np.searchsorted(edges[take], rows, side="right")
            error[take] += np.bincount(at, residual, pieces)
            count[take] += np.bincount(at, minlength=pieces)
            piece.append(take * pieces + at)
        return cls(error / np.maximum(count, 1.0), tuple(piece), tuple(found))


def pieces_of(design: ForwardDesign, columns: Sequence[np.ndarray], pieces: int) -> list[Pieces] | None:
    """So many of each take, for each joint; ``columns`` (N,) of each take. None where a take has no error of
    a joint, or the column never changes."""
    joints = range(len(design.rotations))
    cuts = design.once(f"{pieces} pieces", lambda: [_Cut.of(design, joint, pieces) for joint in joints])
    means: dict[tuple[int, bytes], list[float]] = {}
    found = []
    for cut in cuts:
        if cut is None:
            return None
        for take, (key, parts) in enumerate(cut.rows):
            if (take, key) not in means:
                means[take, key] = [float(np.mean(columns[take][part])) for part in parts]
        column = np.array([means[take, key] for take, (key, _) in enumerate(cut.rows)])
        span = float(np.ptp(column))
        if span <= 0 or not np.isfinite(span):
            return None
        low = float(column.min())
        found.append(Pieces(cut.error, (column - low) / span, cut.piece, low, span))
    return found
