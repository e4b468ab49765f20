"""What --again may change of a recording, as haptic_replay takes it."""

from __future__ import annotations

import itertools
from typing import Iterator, Mapping, Sequence

from haptic_local_model import HapticError

#: haptic_replay's options, by name.
_CHANGES = {
    "delay": ("late",), "friction": ("static-friction", "kinetic-friction"),
    **{name: (name,) for name in (
        "update-rule", "stiffness", "damping", "restitution", "static-friction", "kinetic-friction", "release-step", "healing-speed",
        "controller", "coupling-stiffness", "coupling-damping", "coupling-angular-stiffness", "coupling-angular-damping")}}


def combinations(changes: Mapping[str, Sequence[str]]) -> Iterator[dict[str, str]]:
    """Raises HapticError where a name or a value cannot be one."""
    for name, values in changes.items():
        if name not in _CHANGES:
            raise HapticError(f"--again {name} must be one of {', '.join(_CHANGES)}")
        for value in values:
            if "/" in value or list(values).count(value) > 1:
                raise HapticError(f"--again {name}={value} must be a value, once")
    for chosen in itertools.product(*changes.values()):
        yield dict(zip(changes, chosen))


def arguments_of(changed: Mapping[str, str]) -> list[str]:
    return [part for name, value in changed.items() for option in _CHANGES[name] for part in (f"--{option}", value)]
