"""Roles at a site, from those who look to those who decide."""

from __future__ import annotations

from typing import Literal, get_args

Role = Literal["viewer", "operator", "trainer", "admin"]
"""A viewer looks at poses, takes and models; an operator records too; a trainer trains and activates too; an
admin does everything."""
ROLES: tuple[Role, ...] = get_args(Role)
"""Each may do what those before it may."""


def includes(role: Role, asked: Role) -> bool:
    """Whether who has ``role`` may do what ``asked`` may."""
    return ROLES.index(role) >= ROLES.index(asked)
