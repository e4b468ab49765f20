"""Shapes of a world: for haptic.Session.offer(), with which the server finds contacts itself.

    touch.offer([haptic.shapes.box((0.04, 0.04, 0.04), haptic.TOOL_LINK), haptic.shapes.half_space()])
"""

from __future__ import annotations

from typing import Optional, Sequence

import numpy as np

import haptic_local_model as haptic
from haptic_local_model import _arguments
from haptic_local_model._library import Shape

__all__ = ["KINDS", "Shape", "box", "half_space", "shape", "sphere"]

KINDS = {"sphere": 0, "capsule": 1, "cylinder": 2, "box": 3, "ellipsoid": 4, "hull": 5, "half_space": 6,
         "mesh": 7}
_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3, "hull": 0, "half_space": 0, "mesh": 0}


def shape(kind: str, size: Sequence[float] = (), side: int = haptic.WORLD, index: int = 0, group: int = 1,
          mask: int = 1, vertices: Optional[np.ndarray] = None, triangles: Optional[np.ndarray] = None) -> Shape:
    """kind: one of KINDS. size, m: radius of a sphere; radius and length of a capsule's cylindrical part or of a
    cylinder, along z; edges of a box; semi-axes of an ellipsoid. side and index: whose it is.

    vertices: (n, 3), m, of a hull or mesh; triangles: (m, 3), vertices of a mesh, counter-clockwise seen from outside."""
    made = Shape(kind=KINDS[_arguments.choice(kind, KINDS, "kind")], side=_arguments.integer(side, "side", 0, 2),
                 index=_arguments.integer(index, "index"), group=_arguments.integer(group, "group", -2**31),
                 mask=_arguments.integer(mask, "mask", -2**31))
    made.size[:_SIZES[kind]] = _arguments.array(size, (_SIZES[kind],), f"size of a {kind}")
    if vertices is not None:
        made.kept = _arguments.array(vertices, (None, 3), "vertices").copy()
        made.vertices, made.vertex_count = made.kept.ctypes.data, len(made.kept)
    if triangles is not None:
        made.corners = _arguments.array(triangles, (None, 3), "triangles", np.uint32).copy()
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
