#!/usr/bin/python3
"""haptic.newton: a box presses, slides, pushes, lifts and enters a hole, with SolverXPBD on the CPU.

Usage: newton_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import unittest

from given import last_line_of, main

import haptic_local_model as haptic
import haptic_local_model.newton
import virtual_hand
import newton
import numpy as np
import warp
from scenes import GRAVITY, play, scenes
from touch_tasks import TouchTasks

STEP = 1 / 120  # s: a step takes the CPU some milliseconds
warp.config.quiet = True


class World:
    def __init__(self, scene=None, step=STEP):
        self.builder, self.step = newton.ModelBuilder(gravity=(0, 0, -GRAVITY)), step
        if scene is not None:
            self.builder.add_ground_plane(cfg=newton.ModelBuilder.ShapeConfig(mu=scene.floor))
            self.tool, self.body = self.box(scene.tool), None if scene.body is None else self.box(scene.body)
            for wall in scene.walls:
                self.box(wall)
            self.finish()

    def finish(self):
        self.model = self.builder.finalize(device="cpu")
        self.state, self.after = self.model.state(), self.model.state()
        self.pipeline = newton.CollisionPipeline(self.model)
        self.contacts, self.control = self.pipeline.contacts(), self.model.control()

    def box(self, box):
        cfg = newton.ModelBuilder.ShapeConfig(density=0, mu=box.friction)
        place = warp.transform(box.centre, warp.quat_identity())
        x, y, z = (edge * edge * box.mass / 12 for edge in box.size)
        body = -1 if box.mass == 0 else self.builder.add_body(
            xform=place, mass=box.mass, inertia=warp.mat33(*np.diag((y + z, z + x, x + y)).ravel().tolist()))
        self.builder.add_shape_box(body, xform=place if body < 0 else None, cfg=cfg,
                                   **dict(zip(("hx", "hy", "hz"), (edge / 2 for edge in box.size))))
        return body

    def advance(self, solver, push=lambda state: None):
        self.state.clear_forces()
        push(self.state)
        self.pipeline.collide(self.state, self.contacts)
        solver.step(self.state, self.after, self.control, self.contacts, self.step)
        self.state, self.after = self.after, self.state

    def play(self, server, seconds, rate, stall=0):
        """Returns where the body was."""
        with haptic.newton.Session(self.model, self.state, self.tool, step=self.step, period=1 / rate, gravity=(0, 0, 0)) as touch:
            solver = newton.solvers.SolverXPBD(self.model, iterations=10)
            start = [array.numpy().copy() for array in (self.state.body_q, self.state.body_qd)]
            self.advance(solver)  # It is compiled now.
            for array, kept in zip((self.state.body_q, self.state.body_qd), start):
                array.assign(kept)

            def frame():
                for _ in range(touch.drive(self.state)):
                    self.advance(solver, touch.push)
                touch.send(self.state, self.contacts)
            return play(server, seconds, frame, lambda: self.state.body_q.numpy()[self.body or 0][:3], stall)


class Touch(TouchTasks, unittest.TestCase):
    rates = (30, 60)
    stalls = (0.03, 0.1)  # s: to make up for 0.3 s takes it as long, and the load is felt as half of it meanwhile

    @staticmethod
    def play(scene, seconds, hand, *options, rate=60, stall=0):
        # SolverXPBD takes the average of two coefficients: that of the box with the floor is 0.4, 0.5 or, of the puck, 0.
        made = scenes()[scene]
        floor = 0 if scene == "puck" else made.body.friction if made.body else 0.5
        world = World(made._replace(floor=floor), min(STEP, 1 / rate))
        return virtual_hand.play(hand, options, lambda server: world.play(server, seconds, rate, stall))


class Example(unittest.TestCase):
    def test_it_presses_and_pushes(self):
        self.assertRegex(last_line_of("newton/touch.py"), r" N, brick at 0\.1\d\d m$")


if __name__ == "__main__":
    main()
