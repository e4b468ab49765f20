"""Which geoms of a MuJoCo model touch each other, and with which friction."""

from __future__ import annotations

from typing import Any, Collection, NamedTuple

import numpy as np

import haptic_local_model as haptic

_EXCLUDED_FROM_0 = (3, 0)  # The version from which on bodies of excluded pairs are counted from 0, before from 1.
_TOOL = 2  # The rank of the tool's geoms, before that of what moves and of what does not.
_ALL_BITS = 2**32 - 1
_OF_PAIR = 255  # The priority of what a <pair> says; that of a geom is less.


class Shaped(NamedTuple):
    """What is offered of the geoms. One that a <pair> names is there once more, for what it touches by that pair: with the pair's
    friction, whatever masks, excludes and the geoms themselves say."""
    geoms: np.ndarray
    groups: np.ndarray
    masks: np.ndarray
    friction: np.ndarray
    priority: np.ndarray
    apart: list[tuple[int, int]]  #: places in `geoms`


class Pairs:
    """Of one model, as it is now. carrier: of each geom what moves it; 0: nothing. tool: the bodies of its links."""

    def __init__(self, binding: Any, model: Any, carrier: np.ndarray, tool: Collection[int], version: tuple[int, ...]):
        self._binding, self._model, self._version = binding, model, version
        self._rank = np.where(np.isin(carrier, [*tool]), _TOOL, carrier != 0)
        touches = not (self.is_disabled("CONTACT") or self.is_disabled("CONSTRAINT"))
        groups, masks = (np.asarray(each).astype(np.int64) & _ALL_BITS for each in (model.geom_contype, model.geom_conaffinity))
        used = int(np.bitwise_or.reduce(groups, initial=0) & np.bitwise_or.reduce(masks, initial=0)) * touches
        self._groups, self._masks, self._used = groups & used, masks & used, used
        #: Of each geom whether it can touch something, by masks, and
        self.by_masks = (self._groups | self._masks) != 0
        self.touches = self.by_masks.copy()  #: by masks or by a <pair>.
        friction = self._friction(model.pair_friction, model.pair_dim)
        pairs = zip(np.asarray(model.pair_geom1).tolist(), np.asarray(model.pair_geom2).tolist(), friction.tolist())
        self._listed = [pair for pair in pairs if touches and self._rank[list(pair[:2])].any()]
        for one, other, _ in self._listed:
            self.touches[[one, other]] = True

    def is_disabled(self, flag: str) -> bool:
        """By the model's flags. Which there are depends on MuJoCo's version."""
        return has_flag(self._binding.mjtDisableBit, "mjDSBL_" + flag, self._model.opt.disableflags)

    def shaped(self, chosen: np.ndarray) -> Shaped:
        """chosen: of each geom whether it has a shape."""
        model, listed = self._model, [pair for pair in self._listed if chosen[list(pair[:2])].all()]
        copies, bit = self._copies(listed), self._free_bit(bool(listed))
        partners = set().union(*copies.values())
        masks = self._masks.copy()
        masks[list(partners)] |= bit
        copied = np.array([geom for geom, _ in copies], int)
        kept, of_tool = chosen & ((self._groups | masks) != 0), chosen & (self._rank == _TOOL)
        if not kept[of_tool].any() and not of_tool[copied].any():
            kept |= of_tool  # It touches nothing, but a scene has a tool.
        own = np.flatnonzero(kept)
        place = {int(geom): i for i, geom in enumerate(own)}
        apart = self._excluded(own)
        apart |= {(place[one], place[other]) for one, other, _ in listed if one in place and other in place}
        apart |= {(len(own) + i, place[other]) for i, met in enumerate(copies.values()) for other in partners - met}
        _, priority = np.unique(np.asarray(model.geom_priority)[own], return_inverse=True)
        friction = self._friction(model.geom_friction, model.geom_condim)
        return Shaped(geoms=np.append(own, copied), groups=np.append(self._groups[own], np.full(len(copied), bit)),
                      masks=np.append(masks[own], np.zeros(len(copied), int)),
                      friction=np.append(friction[own], [each for _, each in copies]),
                      priority=np.append(np.minimum(priority, _OF_PAIR - 1), np.full(len(copied), _OF_PAIR)),
                      apart=sorted((max(pair), min(pair)) for pair in apart))

    def _copies(self, listed: list[tuple[int, int, float]]) -> dict[tuple[int, float], set[int]]:
        """Of pairs: each geom that is there once more, with its friction there, and what it touches so."""
        copies: dict[tuple[int, float], set[int]] = {}
        for one, other, friction in listed:
            copied, partner = (one, other) if self._rank[one] >= self._rank[other] else (other, one)
            copies.setdefault((copied, friction), set()).add(partner)
        return copies

    def _free_bit(self, is_needed: bool) -> int:
        """One by which no two geoms touch."""
        free = [1 << bit for bit in range(32) if not self._used >> bit & 1]
        if is_needed and not free:
            raise haptic.HapticError("contype and conaffinity must leave one of 32 bits for what <pair> says")
        return free[0] if free else 0

    def _friction(self, coefficients: Any, dimensions: Any) -> np.ndarray:
        """Along the surface. None for a dimension of 1; the same for all where the model overrides it."""
        option = self._model.opt
        along: Any = np.asarray(coefficients)[:, 0]
        if has_flag(self._binding.mjtEnableBit, "mjENBL_OVERRIDE", option.enableflags):
            along = float(option.o_friction[0])
        return np.where(np.asarray(dimensions) > 1, along, 0)

    def _excluded(self, geoms: np.ndarray) -> set[tuple[int, int]]:
        """Bodies and their parents, and what the model excludes, which it names by the bodies before welding; places in
        `geoms`."""
        model, welded = self._model, np.asarray(self._model.body_weldid)
        own = np.asarray(model.geom_bodyid)[geoms]
        body = welded[own]
        moving = np.flatnonzero(body)
        parent = welded[np.asarray(model.body_parentid)[body]]
        children = np.argwhere(body[moving, None] == parent[None, moving])
        found = set() if self.is_disabled("FILTERPARENT") else {(int(moving[a]), int(moving[b])) for a, b in children}
        first, second = np.divmod(np.asarray(model.exclude_signature, dtype=np.int64), 1 << 16)
        base = 0 if self._version >= _EXCLUDED_FROM_0 else 1
        for p, q in zip(first - base, second - base):
            found |= {(int(i), int(j)) for i in np.flatnonzero(own == p) for j in np.flatnonzero(own == q)}
        return found


def has_flag(flags: Any, name: str, value: Any) -> bool:
    bit = getattr(flags, name, None)
    return bit is not None and bool(int(value) & int(bit))
