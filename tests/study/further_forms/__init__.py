"""Forms of causes that only the study hides, beside those of the product's own simulation.

Those in ``retired`` were set aside once and have been read since; those in ``set_aside`` nobody has looked at
while the diagnosis was built.
"""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from glovecal_models.simulation.causes.catalogue import forms
from glovecal_models.simulation.causes.form import Form


def every_form(name: str) -> tuple[Form, ...]:
    """The forms of one cause, those set aside last. Raises BadInput for another name."""
    further = (_in(folder, name) for folder in ("retired", "set_aside", "set_aside.unlike"))
    return (*forms(name), *(form for found in further for form in found))


def unlike_open_forms(name: str) -> frozenset[str]:
    """Names of the forms set aside whose author knew the laws of all others and had to find other ones."""
    return frozenset(form.name for form in _in("set_aside.unlike", name))


def _in(folder: str, name: str) -> tuple[Form, ...]:
    """Those of one folder beside this file; none for a cause that has no file there."""
    module = f"{__name__}.{folder}.{name.replace(':', '_')}"
    return import_module(module).FORMS if find_spec(module) is not None else ()
