"""One hand from the pose stream, complete: every rotation of the skeleton, whatever the glove measures.

A data glove gives some rotations, a camera others, each with a standard deviation. What a glove does not
measure follows the rules of the product's hand, with a deviation that says how little is known.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import zenoh

from glovecal_client import DEFAULT_ENDPOINT, NoAnswer, PoseSubscriber
from glovecal_models.hand.rotations import HAND_ROTATIONS, RULES, completed

BY_RULE_SD_DEG = 12.0
"""Of a rotation that follows another: last joints bend by about two thirds of the middle ones, roughly."""
NOT_MEASURED_SD_DEG = 30.0
"""Of a rotation that nothing is known about."""


@dataclass(frozen=True)
class Hand:
    seconds: float
    """When the hand was so, by the capture computer's monotonic clock."""
    angles_deg: np.ndarray
    """(R,), in the order of HAND_ROTATIONS."""
    deviations_deg: np.ndarray
    """(R,), one standard deviation each."""
    measured: np.ndarray
    """(R,) bool: by the glove, not by a rule."""
    simulated: bool = False


class HandStream:
    """Hands of one glove, always the newest; poses that are stale or uncalibrated are left out."""

    def __init__(self, session: zenoh.Session, site: str, glove: str) -> None:
        """Raises BadName for a site or glove that cannot be."""
        self._poses = PoseSubscriber(session, site, glove)

    def wait(self, timeout_s: float) -> Hand | None:
        """The newest hand not yet given; None if there was none in time."""
        pose = self._poses.wait(timeout_s)
        if pose is None or pose.stale or pose.uncalibrated:
            return None
        try:
            names = self._poses.rotations(pose)
        except NoAnswer:
            return None
        angles = dict(zip(names, pose.degrees.tolist(), strict=True))
        deviations = dict(zip(names, pose.deviations.tolist(), strict=True))
        return complete_hand(pose.monotonic_ns / 1e9, angles, deviations, pose.simulated)

    def __iter__(self) -> Iterator[Hand | None]:
        """Hands as they come; None after half a second of silence, so that a program can say so."""
        while True:
            yield self.wait(0.5)

    def close(self) -> None:
        self._poses.close()

    def __enter__(self) -> HandStream:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def complete_hand(
    seconds: float, angles_deg: Mapping[str, float], deviations_deg: Mapping[str, float], simulated: bool
) -> Hand:
    """The hand from the rotations that were measured, by name, in degrees. Others are left out."""
    angles = completed(list(angles_deg), np.array([list(angles_deg.values())]))[0]
    deviations = [
        deviations_deg.get(name, BY_RULE_SD_DEG if name in RULES else NOT_MEASURED_SD_DEG)
        for name in HAND_ROTATIONS
    ]
    measured = np.array([name in angles_deg for name in HAND_ROTATIONS])
    return Hand(seconds, angles, np.array(deviations), measured, simulated)


class Glove(NamedTuple):
    endpoint: str
    site: str
    name: str


def add_glove_options(parser: argparse.ArgumentParser) -> None:
    """The options that say whose poses are used; ``glove_of`` reads them."""
    parser.add_argument("--glove", default="right", help="name of the glove (right)")
    parser.add_argument("--site", default="lab", help="name of the site (lab)")
    parser.add_argument("--endpoint", default=DEFAULT_ENDPOINT, help=f"zenoh router ({DEFAULT_ENDPOINT})")
    parser.add_argument(
        "--simulated", action="store_true", help="no glove at hand: a simulated hand publishes the poses"
    )


def glove_of(options: argparse.Namespace) -> Glove:
    return Glove(options.endpoint, options.site, options.glove)
