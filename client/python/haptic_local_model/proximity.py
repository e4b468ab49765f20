"""Contacts for engines whose own are late, few or nameless: shapes once, their poses in each step.

    near = haptic.proximity.Proximity([haptic.proximity.sphere(0.02, haptic.TOOL_LINK),
                                       haptic.proximity.half_space()])
    contacts = near.find(positions, rotations, epsilon=0.005)   # one row for each shape; w, x, y, z

What haptic.Session.send() takes; identities are lasting ones. Needs libhaptic_proximity.so, which is found as
libhaptic.so is; HAPTIC_PROXIMITY_LIBRARY may name it.
"""

from __future__ import annotations

import ctypes
from typing import Iterable, Sequence

import numpy as np

import haptic_local_model as haptic
from haptic_local_model import _arguments
from haptic_local_model._library import load_proximity
from haptic_local_model.shapes import Shape, box, half_space, shape, sphere

__all__ = ["Proximity", "Shape", "box", "half_space", "shape", "sphere"]

_POSE = np.dtype([("position", "f8", 3), ("rotation", "f8", 4)])


class Proximity:
    """Raises haptic.HapticError where a shape cannot be used, OSError where there is no library."""

    def __init__(self, shapes: Iterable[Shape], excluded: Sequence[tuple[int, int]] = ()):
        self._proximity = None
        self._library = load_proximity()
        listed = _arguments.items(shapes, Shape, "shape")
        pairs = _arguments.array(excluded, (None, 2), "excluded", np.uint32)
        error = ctypes.create_string_buffer(512)
        self._proximity = self._library.haptic_proximity_open((Shape * len(listed))(*listed), len(listed),
                                                              pairs.ctypes.data, len(pairs), error, len(error))
        if not self._proximity:
            raise haptic.HapticError(error.value.decode())
        self._poses = np.zeros(len(listed), _POSE)
        self._contacts = haptic.contacts(haptic.MAX_CONTACTS)
        self._shapes = np.zeros((haptic.MAX_CONTACTS, 2), np.uint32)
        self.shapes = self._shapes[:0]
        """Places of both shapes of each contact of the latest find(): a, b."""

    def __del__(self) -> None:
        if self._proximity:
            self._library.haptic_proximity_close(self._proximity)

    def find(self, positions: np.ndarray, rotations: np.ndarray, epsilon: float) -> np.ndarray:
        """Contacts within epsilon (m): of the tool, of the bodies near it, and of those that these touch.

        Raises haptic.HapticError where there is not one position and one rotation for each shape, or a rotation is zero.
        """
        for name, given, width in (("position", positions, 3), ("rotation", rotations, 4)):
            self._poses[name] = _arguments.array(given, (len(self._poses), width), name + "s")
        epsilon = _arguments.number(epsilon, "epsilon", 0, 1, "m")
        zero = np.flatnonzero(~self._poses["rotation"].any(axis=1))
        if zero.size:
            raise haptic.HapticError(f"the rotation of shape {zero[0]} must not be zero")
        count = self._library.haptic_proximity_find(self._proximity, self._poses.ctypes.data, epsilon,
                                                    self._contacts.ctypes.data, self._shapes.ctypes.data)
        self.shapes = self._shapes[:count].copy()
        return self._contacts[:count].copy()
