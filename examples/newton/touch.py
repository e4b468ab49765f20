#!/usr/bin/python3
"""A Newton world in the hand, on the CPU or a GPU: a box that presses on a floor, and then pushes a brick along.

    touch.py [SECONDS]

Needs Newton (pip install newton) and the package haptic. Without a device a server with a simulated one is started, and hold() is
the hand. The first run compiles for half a minute.
"""

import sys
import time

import haptic_local_model as haptic
import newton
import warp

PERIOD, STEP = 1 / 60, 1 / 120  # s, of a frame and of the solver
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 6

builder = newton.ModelBuilder()
builder.add_ground_plane()
for x, mass in ((0, 0.1), (0.08, 0.3)):
    body = builder.add_body(xform=warp.transform((x, 0, 0.021), warp.quat_identity()))
    builder.add_shape_box(body, hx=0.02, hy=0.02, hz=0.02, cfg=newton.ModelBuilder.ShapeConfig(density=mass / 0.04**3, mu=0.4))
tool, brick = 0, 1
model = builder.finalize()
state, after, control = model.state(), model.state(), model.control()
pipeline = newton.CollisionPipeline(model)
contacts = pipeline.contacts()

with haptic.newton.Session(model, state, tool=tool, step=STEP, period=PERIOD) as touch:
    solver = newton.solvers.SolverXPBD(model)
    start, frame = time.monotonic(), 0
    while time.monotonic() - start < SECONDS:
        along = max(0, time.monotonic() - start - 2)          # s: it presses for two, then it pushes
        touch.hold((min(0.05 * along, 0.15), 0, 0.012 if along == 0 else 0.022))
        for _ in range(touch.drive(state)):
            state.clear_forces()
            touch.push(state)
            pipeline.collide(state, contacts)
            solver.step(state, after, control, contacts, STEP)
            state, after = after, state
        touch.send(state, contacts)
        frame += 1
        if frame % 30 == 0:
            x, y, z = touch.touch.force[:3]
            print(f"{touch.touch.server_state}: {x:5.2f} {y:5.2f} {z:5.2f} N, brick at {state.body_q.numpy()[brick][0]:.3f} m",
                  flush=True)
        time.sleep(max(0, start + frame * PERIOD - time.monotonic()))
