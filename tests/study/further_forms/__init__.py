"""Forms of causes that only the study hides, beside those of the product's own simulation.

Those in ``retired`` were set aside once and have been read since; those in ``asked_often`` were asked by many
states of the diagnosis, and are hidden by name alone; those in ``set_aside`` nobody has looked at while the
diagnosis was built.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from glovecal_models.simulation.causes.catalogue import forms
from glovecal_models.simulation.causes.form import Form


def every_form(name: str) -> tuple[Form, ...]:
    """The forms of one cause, those set aside last. Raises BadInput for another name."""
    by_name = tuple(form for folder in ("asked_often", "asked_often.unlike") for form in _in(folder, name))
    return (*forms(name), *_in("retired", name), *by_name, *_in("set_aside", name))


def dealt_forms(name: str, *, set_aside: bool) -> tuple[Form, ...]:
    """Those that the study hides in turn. Raises BadInput for another name."""
    return _in("set_aside", name) if set_aside else (*forms(name), *_in("retired", name))


def _in(folder: str, name: str) -> tuple[Form, ...]:
    """Those of one folder beside this file; none for a cause that has no file there."""
    module = f"{__name__}.{folder}.{name.replace(':', '_')}"
    return import_module(module).FORMS if find_spec(module) is not None else ()
