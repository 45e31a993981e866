"""A warning of ours is an error in every test; one that another library gives in its own lines is not."""

from __future__ import annotations

import warnings

import pytest

OURS = (
    "glovecal",
    "glovecal_models.takes.table",
    "glovecal_service.serve",
    "tests.client.conftest",
    "realtime_support",
)
THEIRS = (
    "numpy",
    "skimage.measure._pnpoly",
    "/home/anna/.venv/lib/python3.14/site-packages/GPy/kern/src/add",
)


def warn(module: str, category: type[Warning] = DeprecationWarning) -> None:
    warnings.warn_explicit("setting the shape is deprecated", category, "some.py", 1, module)


@pytest.mark.parametrize("module", OURS)
def test_a_warning_of_ours_is_an_error(module: str) -> None:
    with pytest.raises(DeprecationWarning):
        warn(module)


@pytest.mark.parametrize("module", THEIRS)
def test_a_warning_of_another_library_is_none(module: str) -> None:
    with warnings.catch_warnings(record=True) as told:  # the filters stay as they are
        warn(module)
    assert len(told) == 1


@pytest.mark.parametrize("module", ["_pytest.unraisableexception", "zipfile", "numpy"])
def test_what_was_not_closed_is_an_error_wherever_it_is_noticed(module: str) -> None:
    with pytest.raises(ResourceWarning):
        warn(module, ResourceWarning)


def test_what_a_test_leaves_behind_is_an_error() -> None:
    with pytest.raises(pytest.PytestUnraisableExceptionWarning):
        warn("_pytest.unraisableexception", pytest.PytestUnraisableExceptionWarning)
