"""Guided sampling: a person is led through poses and motions whose angles are known (Wang & Neff 2013, 5)."""
