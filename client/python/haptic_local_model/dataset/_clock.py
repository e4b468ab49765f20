"""The server's clock against the session's, from when each update was sampled, when it was taken, and how old it was then."""

from __future__ import annotations

import dataclasses
from typing import Any, Sequence

import numpy as np

from haptic_local_model import HapticError

_LARGEST_JUMP = 0.02  # s
_UPDATES = 15  # over which a jump is looked for
_PART, _PARTS = 10.0, 3  # s, of which each tells the difference; and how many tell how fast that changes


@dataclasses.dataclass
class Clock:
    """server = session + offset + rate (session - origin), s. error: how far single updates are from that, s. has_age: whether the server
    attributed an age to any; otherwise the network's delay is in the offset."""
    offset: float = 0.0
    rate: float = 0.0
    origin: float = 0.0
    error: float = 0.0
    has_age: bool = False

    def to_server(self, times: Any) -> Any:
        return times + self.offset + self.rate * (times - self.origin)


def clock_of(ways: Sequence[tuple[float, float, float]], finds_jumps: bool = False) -> Clock:
    """ways: of updates, s, by the session's clock, the server's, and as the server attributes it: until it knows the round trip, two of
    these after a session begins, that is 0. The fastest updates tell the difference: the network held them up least, and the
    age that is attributed has the least of it, too. Raises HapticError where a clock jumps."""
    sampled, taken, age = np.array(ways).T
    if (known := age > 0).any():
        sampled, taken, age = (each[int(np.argmax(known)):] for each in (sampled, taken, age))
    way, origin = taken - sampled, float(sampled[0])
    part = ((sampled - origin) / _PART).astype(int)
    parts = [part == number for number in np.unique(part)]
    if len(parts) >= _PARTS:
        middles, offsets = zip(*((sampled[each].mean(), way[each].min() - age[each].min()) for each in parts))
        rate, offset = np.polyfit(np.array(middles) - origin, offsets, 1)
    else:
        rate, offset = 0.0, way.min() - age.min()
    single = way - age - rate * (sampled - origin) - offset
    if finds_jumps and len(single) >= 3 * _UPDATES:
        middle = np.median(np.lib.stride_tricks.sliding_window_view(single, _UPDATES), axis=1)
        if (jump := float(np.ptp(middle))) > _LARGEST_JUMP:
            raise HapticError(f"its clock jumps against the server's, by {jump:.3f} s")
    return Clock(float(offset), float(rate), origin, float(np.median(np.abs(single))), bool(known.any()))
