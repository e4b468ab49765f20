"""What a session changes in the user's model and data, and how it gives that back."""

from __future__ import annotations

from typing import Any

import numpy as np

_LISTS = ("geom_margin", "geom_gap", "pair_margin", "pair_gap", "body_margin", "dof_armature", "dof_M0", "tree_sleep_policy")
_CLOSE = 1e-3  # relative: MuJoCo itself may add to what was set, as mj_setConst() does to dof_M0
_ROUNDING = 1e-9  # N or N m, and relative: of what was added to a force and taken away again


class Changes:
    """Of a model. What somebody else has changed since stays as it is."""

    def __init__(self, model: Any):
        self._now = {name: getattr(model, name) for name in _LISTS if hasattr(model, name)}
        self._own = {name: np.array(array) for name, array in self._now.items()}
        self._set = {name: np.array(array) for name, array in self._now.items()}
        #: Whether MuJoCo has computed from what was set, as mj_setConst() does: it must once more when all is given back.
        self.was_computed_from = False

    def set(self, name: str, which: Any, values: Any) -> None:
        """name: that of a list; where this version of MuJoCo has no such list nothing is done. which: an index of numpy."""
        if name in self._now:
            self._set[name][which] = values
            self._now[name][which] = values

    def give_back(self, name: str, which: Any = slice(None)) -> None:
        if name in self._now:
            self._now[name][which] = self.own(name)[which]
            self._set[name][which] = self._own[name][which]

    def give_all_back(self) -> None:
        for name in self._now:
            self.give_back(name)

    def read(self, model: Any, name: str) -> np.ndarray:
        """Any list of the model, as own()."""
        return self.own(name) if name in self._now else np.asarray(getattr(model, name))

    def own(self, name: str) -> np.ndarray:
        """What the list is without the session; a copy."""
        now, was_set = self._now[name], self._set[name]
        ours = (was_set != self._own[name]) & np.isclose(now, was_set, rtol=_CLOSE, atol=0)
        self._own[name] = np.where(ours, self._own[name], now)
        computed = ours & (now != was_set) & (name == "dof_M0")
        if computed.any():
            self._own[name] = np.where(computed, now - was_set + self._own["dof_armature"], self._own[name])
            self.was_computed_from = True
        return self._own[name].copy()


class Pushes:
    """What the tool does to bodies from drive() to send(), in xfrc_applied beside what the user has there. Where that is cleared
    or set meanwhile, nothing of ours is left to be taken away."""

    def __init__(self) -> None:
        self._data: Any = None
        self._rows: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}  # push, row before it, row with it

    def put(self, data: Any, pushes: dict[int, np.ndarray]) -> None:
        self._data = data
        for body, push in pushes.items():
            before = np.array(data.xfrc_applied[body])
            data.xfrc_applied[body] += push
            self._rows[body] = push, before, np.array(data.xfrc_applied[body])

    def on(self, body: int) -> np.ndarray:
        """What of it acts on the body now."""
        push, _, _ = self._rows.get(body, (np.zeros(6), None, None))
        return push * self._is_there(body)

    def take_back(self) -> None:
        for body, (_, before, _) in self._rows.items():
            row = self._data.xfrc_applied[body]
            row[:] = np.where(self._is_there(body), before, row)
        self._data, self._rows = None, {}

    def _is_there(self, body: int) -> Any:
        """Of each of the six."""
        if body not in self._rows:
            return False
        with_push = self._rows[body][2]
        return np.isclose(self._data.xfrc_applied[body], with_push, rtol=_ROUNDING, atol=_ROUNDING)
