"""Contacts for engines whose own are late, few or nameless: shapes once, their poses in each step.

    near = haptic.proximity.Proximity([haptic.proximity.sphere(0.02, haptic.TOOL_LINK),
                                       haptic.proximity.half_space()])
    contacts = near.find(positions, rotations, epsilon=0.005)   # one row for each shape; w, x, y, z

What haptic.Session.send() takes; identities are lasting ones. Needs libhaptic_proximity.so, which is found as
libhaptic.so is; HAPTIC_PROXIMITY_LIBRARY may name it.
"""

from __future__ import annotations

import ctypes
from typing import Iterable, Optional, Sequence

import numpy as np

import haptic
from haptic._library import load_proximity

_KINDS = {"sphere": 0, "capsule": 1, "cylinder": 2, "box": 3, "ellipsoid": 4, "hull": 5, "half_space": 6,
          "mesh": 7}
_POSE = np.dtype([("position", "f8", 3), ("rotation", "f8", 4)])


class Shape(ctypes.Structure):
    """As haptic_shape in haptic_proximity.h."""
    _fields_ = [("kind", ctypes.c_int32), ("side", ctypes.c_int32), ("index", ctypes.c_uint32),
                ("group", ctypes.c_uint32), ("mask", ctypes.c_uint32), ("vertex_count", ctypes.c_uint32),
                ("size", ctypes.c_double * 3), ("vertices", ctypes.c_void_p), ("triangles", ctypes.c_void_p),
                ("triangle_count", ctypes.c_size_t)]


def shape(kind: str, size: Sequence[float] = (), side: int = haptic.WORLD, index: int = 0, group: int = 1,
          mask: int = 1, vertices: Optional[np.ndarray] = None, triangles: Optional[np.ndarray] = None) -> Shape:
    """kind: sphere, capsule, cylinder, box, ellipsoid, hull, half_space or mesh; size as haptic_proximity.h says.

    vertices: (n, 3), m, of a hull or mesh; triangles: (m, 3), vertices of a mesh, counter-clockwise seen from outside."""
    if kind not in _KINDS:
        raise haptic.HapticError(f"kind {kind!r} must be one of {', '.join(_KINDS)}")
    made = Shape(kind=_KINDS[kind], side=side, index=index, group=group, mask=mask)
    made.size[:len(size)] = tuple(size)
    if vertices is not None:
        made.kept = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
        made.vertices, made.vertex_count = made.kept.ctypes.data, len(made.kept)
    if triangles is not None:
        made.corners = np.ascontiguousarray(triangles, dtype=np.uint32).reshape(-1, 3)
        made.triangles, made.triangle_count = made.corners.ctypes.data, len(made.corners)
    return made


def sphere(radius: float, side: int = haptic.WORLD, index: int = 0) -> Shape:
    """A sphere about its centre (m), of the world, of a link of the tool or of a body."""
    return shape("sphere", (radius,), side, index)


def box(size: Sequence[float], side: int = haptic.WORLD, index: int = 0) -> Shape:
    """A box about its centre (edge lengths in m), of the world, of a link of the tool or of a body."""
    return shape("box", size, side, index)


def half_space() -> Shape:
    """Of the world: z <= 0 of its frame."""
    return shape("half_space")


class Proximity:
    """Raises haptic.HapticError where a shape cannot be used, OSError where there is no library."""

    def __init__(self, shapes: Iterable[Shape], excluded: Sequence[tuple[int, int]] = ()):
        self._proximity = None
        self._library = load_proximity(Shape)
        shapes = list(shapes)
        pairs = np.ascontiguousarray(excluded, dtype=np.uint32).reshape(-1, 2)
        error = ctypes.create_string_buffer(512)
        self._proximity = self._library.haptic_proximity_open((Shape * len(shapes))(*shapes), len(shapes),
                                                              pairs.ctypes.data, len(pairs), error, len(error))
        if not self._proximity:
            raise haptic.HapticError(error.value.decode())
        self._poses = np.zeros(len(shapes), _POSE)
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
        for name, given, width in (("positions", positions, 3), ("rotations", rotations, 4)):
            if np.shape(given) != (len(self._poses), width):
                raise haptic.HapticError(f"{name}: shape {np.shape(given)} must be {(len(self._poses), width)}, "
                                         "one row for each shape")
        self._poses["position"], self._poses["rotation"] = positions, rotations
        zero = np.flatnonzero(~self._poses["rotation"].any(axis=1))
        if zero.size:
            raise haptic.HapticError(f"the rotation of shape {zero[0]} must not be zero")
        count = self._library.haptic_proximity_find(self._proximity, self._poses.ctypes.data, epsilon,
                                                    self._contacts.ctypes.data, self._shapes.ctypes.data)
        self.shapes = self._shapes[:count].copy()
        return self._contacts[:count].copy()
