"""What is told of the same scene at other sizes, from angles that are known."""

from __future__ import annotations

import numpy as np
from picture_sizes import SENSORS, Sized, table


def test_only_what_both_accept_is_compared():
    rng, shape = np.random.default_rng(1), (len(SENSORS), 50, 20)
    truth = rng.uniform(0.0, 90.0, shape[1:])
    angles = np.tile(truth, (len(SENSORS), 1, 1))
    angles[1:, :, :10] += 0.5
    angles[1:, :, 10:] += 30.0
    accepted = np.zeros(shape, bool)
    accepted[:, :, :10] = True
    accepted[0, :, 10:] = True  # by 640 pixels alone
    right = np.linspace(0.9, 0.98, len(SENSORS))
    nothing = np.full(shape, np.nan)
    hand = Sized("soft", right, angles, nothing, accepted, np.zeros(shape, bool), truth)
    first, *others = table([hand, hand]).splitlines()[2:]
    assert "| 90.0 / 90.0 % | 100 % | 0.00, 0.00 | 0.00, 0.00 | - | 0.0 |" in first
    assert len(others) == len(SENSORS) - 1
    for line in others:
        assert "| 50 % | 0.50, 0.50 | 21.22, 15.25 | - | 0.5 |" in line
