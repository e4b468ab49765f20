"""Where shapes are that an adapter gives to the server."""

import haptic_local_model as haptic
import haptic_local_model.shapes
import numpy as np


def lowest(shape, at, R):
    """The lowest point of a shape, in z, at this position, m, and rotation."""
    size, z = np.array(shape.size), np.asarray(R)[2]
    below = {"sphere": lambda: size[0], "box": lambda: 0.5 * np.abs(z) @ size,
             "capsule": lambda: size[0] + 0.5 * size[1] * abs(z[2]),
             "cylinder": lambda: size[0] * np.hypot(z[0], z[1]) + 0.5 * size[1] * abs(z[2]),
             "ellipsoid": lambda: np.linalg.norm(size * z), "hull": lambda: -np.min(shape.kept @ z)}
    kinds = {number: name for name, number in haptic.shapes.KINDS.items()}
    return at[2] - below[kinds[shape.kind]]()
