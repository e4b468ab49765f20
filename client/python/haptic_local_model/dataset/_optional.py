"""Packages that only some of the formats need."""

from __future__ import annotations

import importlib
from typing import Any

from haptic_local_model import HapticError


def require(module: str, form: str) -> Any:
    """Raises HapticError where it is not installed."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package = "haptic-local-model[dataset]" if form != "lerobot" else "lerobot"
        raise HapticError(f"--to {form} needs the package {module.split('.', maxsplit=1)[0]}: pip install '{package}' ({error})") from None
