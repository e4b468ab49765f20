"""The worlds of the tasks in tests/support/touch_tasks.py, for any engine: boxes on a floor at z = 0."""

from typing import NamedTuple, Optional

GRAVITY = 9.81  # m/s²


class Box(NamedTuple):
    size: tuple          # m
    centre: tuple        # m
    mass: float = 0      # kg; 0: it stands still
    friction: float = 0.7


class Scene(NamedTuple):
    tool: Box
    body: Optional[Box] = None  # what the tool can move
    walls: tuple = ()
    floor: float = 1.0          # its friction


def _tool(size, height, friction):
    return Box(size, (0, 0, height), 0.1, friction)


def scenes(friction_of_floor=1.0):
    """friction_of_floor: with which the rule of the engine makes that of the box of the two."""
    brick = Box((0.04, 0.08, 0.04), (0.08, 0, 0.02), 0.3, 0.4)
    flat = _tool((0.04, 0.04, 0.03), 0.02, 0)
    rails = tuple(Box((0.1, 0.02, 0.06), (0, y, 0.03)) for y in (-0.07, 0.07))
    jaws = tuple(Box((0.04, 0.08, 0.06), (x, 0, 0.03)) for x in (-0.0301, 0.0301))
    made = {"table": Scene(_tool((0.04, 0.04, 0.04), 0.03, 0.5)),
            "brick": Scene(flat, brick),
            "puck": Scene(flat, brick._replace(friction=0)),
            "tray": Scene(_tool((0.1, 0.1, 0.01), 0.045, 0.7), Box((0.04, 0.14, 0.04), (0, 0, 0.08), 0.3), rails),
            "hole": Scene(_tool((0.02, 0.02, 0.06), 0.1, 0), None, jaws)}
    return {name: scene._replace(floor=friction_of_floor) for name, scene in made.items()}


def play(server, seconds, frame, body, stall=0):
    """Calls frame(), in the server's virtual time, and returns body(), m, twice a second. stall: now and then nothing happens for
    so long, s."""
    track, stalls = [], 0.5
    while server.now < seconds:
        frame()
        if server.now > 0.5 * (len(track) + 1) - 1e-9:
            track.append([float(x) for x in body()])
        if stall and server.now > stalls:
            server.wait(stall)
            stalls += 0.5 + stall
    return track
