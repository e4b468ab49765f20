"""Whether a MuJoCo model has changed in what decides what is felt."""

from __future__ import annotations

from typing import Any

import numpy as np

_OF_MODEL = (
    "geom_type geom_contype geom_conaffinity geom_condim geom_priority geom_friction geom_dataid geom_size geom_pos geom_quat "
    "body_ipos body_iquat body_mass body_inertia body_gravcomp "
    "jnt_pos jnt_axis jnt_range jnt_limited jnt_stiffness qpos0 qpos_spring dof_damping dof_frictionloss "
    "pair_dim pair_friction eq_active").split()  # The last one is of the model before 3.0.
_NUMBERS = ("disableflags", "enableflags", "density", "viscosity")  # of its options
_LEAST_INTERVAL, _MOST_INTERVAL, _SHARE = 0.1, 0.4, 10  # s, s: between two offers, and so many times as long as one took


class Watch:
    """Compares bytes: 10 µs for a model of a hundred geoms."""

    def __init__(self, model: Any, data: Any):
        self._option = model.opt
        self._arrays = [getattr(model, name) for name in _OF_MODEL if hasattr(model, name)]
        self._arrays += [model.opt.gravity, model.opt.o_friction]
        self._model, self._still = model, np.arange(model.nbody)
        self._known = self._content(data)
        self._offered, self._next = self._known, -np.inf  # s

    def is_new(self, data: Any) -> bool:
        """Whether something is other than at the last call."""
        before, self._known = self._known, self._content(data)
        return self._known != before

    def is_due(self, now: float) -> bool:
        """Whether something is other than it was offered, and this was some time ago. now: s, of any steady clock."""
        return self._known != self._offered and now >= self._next

    def offered(self, data: Any, was_moved: np.ndarray, begin: float, end: float) -> None:
        """What is known has been offered, from `begin` to `end`, s. was_moved: of each body whether its place is told in each frame
        from here on."""
        self._still = np.flatnonzero(~was_moved)
        self._offered = self._known = self._content(data)
        self._next = end + min(max(_LEAST_INTERVAL, _SHARE * (end - begin)), _MOST_INTERVAL)

    def _content(self, data: Any) -> list[Any]:
        content: list[Any] = [array.tobytes() for array in self._arrays]
        content += [each[self._still].tobytes() for each in (self._model.body_pos, self._model.body_quat)]
        content += [getattr(self._option, name) for name in _NUMBERS]
        if hasattr(data, "eq_active"):
            content.append(data.eq_active.tobytes())
        return content
