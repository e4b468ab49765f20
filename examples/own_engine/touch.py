#!/usr/bin/python3
"""An engine of your own in the hand, here one of a page: cubes that fall, and lie on a floor or on each other. A tray lifts them.

    touch.py [SECONDS]

Needs the package haptic. Without a device a server with a simulated one is started, and hold() is the hand: it pulls
with up to 10 N.
"""

import sys
import time

import numpy as np

import haptic_local_model as haptic
from haptic_local_model import shapes

PERIOD, STEP = 1 / 60, 1 / 240  # s, of a frame and of a step of the engine
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 6
EDGE, MASS, GRAVITY = 0.04, 0.3, np.array((0, 0, -9.81))  # m, kg, m/s²
TRAY = np.array((0.1, 0.1, 0.01))  # m


class Engine:
    """Cubes that do not turn."""

    def __init__(self, heights):
        self.p = np.array([(0, 0, height) for height in heights], dtype=float)  # m
        self.turn = np.tile((1.0, 0, 0, 0), (len(heights), 1))
        self.v = np.zeros((len(heights), 6))  # m/s, rad/s

    def step(self, dt, held, tray):
        """held: cubes that somebody else moves. tray: the height of its upper side, or None if it pushes nothing here."""
        self.v[:, :3] += np.where(held[:, None], 0, dt * GRAVITY)
        self.p += dt * self.v[:, :3]
        for cube in np.flatnonzero(~held):
            under = [0.0] + [self.p[other, 2] + EDGE / 2 for other in range(len(self.p))
                             if self.p[other, 2] < self.p[cube, 2] and (abs(self.p[other] - self.p[cube])[:2] < EDGE).all()]
            if tray is not None and tray < self.p[cube, 2] and (abs(self.p[cube, :2]) < TRAY[:2] / 2).all():
                under.append(tray)
            if self.p[cube, 2] <= max(under) + EDGE / 2:
                self.p[cube, 2], self.v[cube] = max(under) + EDGE / 2, 0


engine = Engine([0.055 + EDGE / 2 + EDGE * i for i in range(2)])
count = len(engine.p)
with haptic.Session(tool=haptic.box(mass=0.2, size=TRAY), q=(0, 0, 0.05, 1, 0, 0, 0), rate=1 / PERIOD) as touch:
    dynamics = haptic.dynamics(count)  # what the server must know to move them while the hand holds them
    dynamics["body"], dynamics["mass"], dynamics["gravity"] = range(1, count + 1), MASS, GRAVITY
    dynamics["inertia"] = MASS * EDGE**2 / 6 * np.eye(3)
    touch.offer([shapes.half_space(), shapes.box(TRAY, haptic.TOOL_LINK)] +
                [shapes.box([EDGE] * 3, haptic.MOVABLE_BODY, body) for body in dynamics["body"].tolist()],
                friction=[0.5] * (2 + count), dynamics=dynamics)
    start = last = touch.now
    while touch.poll() and last - start < SECONDS:
        touch.hold((0, 0, 0.05 + 0.1 * min(max((last - start) / 2 - 0.5, 0), 1)))
        held = np.zeros(count, bool)
        for body, let_go, position, turn, velocity, *_ in touch.held().tolist():
            engine.p[body - 1], engine.turn[body - 1], engine.v[body - 1] = position, turn, velocity
            held[body - 1] = not let_go
        steps = touch.steps(STEP)  # as many as bring the engine's time up to the hand's
        for _ in range(steps):
            engine.step(STEP, held, touch.q[2] + TRAY[2] / 2 if touch.tool_pushes else None)
        if steps > 0:
            touch.sample(touch.q, touch.v, steps * STEP)
            poses = haptic.poses(count)
            poses["body"], poses["position"], poses["rotation"], poses["velocity"] = dynamics["body"], engine.p, engine.turn, engine.v
            touch.send(None, None, poses)
        now = touch.now
        if int(2 * (now - start)) > int(2 * (last - start)):
            print(f"{touch.server_state}: {touch.force[2]:6.3f} N, cubes at {engine.p[:, 2].round(3).tolist()} m", flush=True)
        last = now
        time.sleep(PERIOD)
