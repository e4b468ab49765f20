"""What a caller gave, as the library takes it; or one line that names it, its value and what is allowed."""

from __future__ import annotations

import contextlib
import math
import operator
import os
from typing import Any, Collection, Iterable, Optional, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = TypeVar("Kind")
_LONGEST = 60  # of a value that is named
_U32 = 2**32 - 1


class HapticError(ValueError):
    """What was given cannot be used; the text names it, its value and what is allowed."""
    __module__ = "haptic"


def number(value: Any, name: str, least: float = -math.inf, most: float = math.inf, unit: str = "") -> float:
    """One within `least` and `most`. NaN only where there are no bounds: the library names it."""
    made = value if isinstance(value, float) else _float(value, name)
    if least <= made <= most or (least, most) == (-math.inf, math.inf):
        return made
    allowed = f"at least {least:g}" if most == math.inf else f"{least:g} to {most:g}"
    raise HapticError(f"{name} {made:g} must be {allowed} {unit}".rstrip())


def _float(value: Any, name: str) -> float:
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        if not isinstance(value, (str, bytes)):
            return float(value)
    raise HapticError(f"{name} must be a number, not {brief(value)}")


def integer(value: Any, name: str, least: int = 0, most: int = _U32) -> int:
    try:
        made = operator.index(value)
    except TypeError:
        made = least - 1
    if not least <= made <= most:
        raise HapticError(f"{name} {brief(value)} must be a whole number of {least} to {most}")
    return made


def text(value: Any, name: str) -> bytes:
    """Of a name or a path."""
    try:
        made = os.fsencode(value)
    except (TypeError, UnicodeError):
        made = b"\0"
    if b"\0" in made:
        raise HapticError(f"{name} {brief(value)} must be a text without a zero in it")
    return made


def choice(value: Any, of: Collection[str], name: str) -> str:
    if not isinstance(value, str) or value not in of:
        raise HapticError(f"{name} {brief(value)} must be one of {', '.join(of)}")
    return value


def items(values: Any, kind: type[Kind], name: str) -> list[Kind]:
    """A list of what is all of one kind."""
    wanted = f"must be a haptic.{kind.__name__}"
    if not isinstance(values, Iterable):
        raise HapticError(f"{name}s must be a list, each {wanted[8:]}, not {brief(values)}")
    made = list(values)
    for i, value in enumerate(made):
        if not isinstance(value, kind):
            raise HapticError(f"{name} {i} {wanted}, not {brief(value)}")
    return made


def array(values: ArrayLike, shape: tuple[Optional[int], ...], name: str, dtype: Any = np.float64) -> NDArray[Any]:
    """Numbers in that shape, whose None is any length; for a whole dtype without fractions, and within its range."""
    try:
        made = np.ascontiguousarray(values, dtype=dtype)
        exact = dtype is np.float64 or np.array_equal(made, np.atleast_1d(values))
    except (TypeError, ValueError, OverflowError):
        exact = False
    if exact and made.shape == shape:
        return made
    if not exact:
        numbers = "numbers" if dtype is np.float64 else f"whole numbers of 0 to {np.iinfo(dtype).max}"
        raise HapticError(f"{name} {brief(values)} must be {numbers} in the shape {_shape(shape)}")
    if shape[0] in (None, 0) and made.size == 0:
        return made.reshape(0, *shape[1:])
    if shape[0] is None and made.shape[1:] == shape[1:]:
        return made
    if len(shape) == 1:
        raise HapticError(f"{name} must have {shape[0]} numbers, not the shape {made.shape}")
    each = "" if shape[0] is None else ", one row for each shape"
    raise HapticError(f"{name}: shape {made.shape} must be {_shape(shape)}{each}")


def _shape(wanted: tuple[Optional[int], ...]) -> str:
    return str(wanted).replace("None", "n")


def records(given: Optional[np.ndarray], dtype: np.dtype, name: str) -> tuple[Optional[int], int]:
    """(address, count)"""
    if given is None:
        return None, 0
    if (not isinstance(given, np.ndarray) or given.dtype != dtype or given.ndim != 1
            or not given.flags.c_contiguous):
        raise HapticError(f"{name} must be a contiguous one-dimensional array, as haptic.{name}(count) makes it, "
                          f"not {brief(given)}")
    return given.ctypes.data, len(given)


def brief(value: Any) -> str:
    """What it is, in one short line."""
    if isinstance(value, np.ndarray):
        kind = "records" if value.dtype.names else value.dtype.name
        return f"an array of {kind} of shape {value.shape}" + ("" if value.flags.c_contiguous else " with gaps")
    line = " ".join(repr(value).split())
    return line if len(line) <= _LONGEST else line[:_LONGEST] + "…"
