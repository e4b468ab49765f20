#!/usr/bin/python3
"""A PyBullet world in the hand: a box that presses on a floor, and then pushes a brick along.

    touch.py [SECONDS]

Needs PyBullet (pip install pybullet) and the package haptic. Without a device a server with a simulated one is started, and
hold() is the hand.
"""

import sys
import time

import haptic_local_model as haptic
import pybullet

PERIOD = 1 / 60  # s, of a frame
SECONDS = float(sys.argv[1]) if len(sys.argv) > 1 else 6

client = pybullet.connect(pybullet.DIRECT)  # or pybullet.GUI
pybullet.setGravity(0, 0, -9.81)
pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE))
cube = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=(0.02, 0.02, 0.02))
tool = pybullet.createMultiBody(0.1, cube, basePosition=(0, 0, 0.03))
brick = pybullet.createMultiBody(0.3, cube, basePosition=(0.08, 0, 0.02))

with haptic.pybullet.Session(client, tool=tool, period=PERIOD) as touch:
    start, time_of_hand = time.monotonic(), 0.0
    for frame in range(round(SECONDS / PERIOD)):
        along = max(0, time_of_hand - 2)                      # s: it presses for two, then it pushes
        touch.hold((min(0.05 * along, 0.15), 0, 0.012 if along == 0 else 0.022))
        for _ in range(touch.drive()):                        # as many steps as bring PyBullet's time up to the hand's
            touch.push()
            pybullet.stepSimulation()
        touch.send()
        if frame % 30 == 29:
            x, y, z = touch.touch.force[:3]
            print(f"{touch.touch.server_state}: {x:5.2f} {y:5.2f} {z:5.2f} N, brick at "
                  f"{pybullet.getBasePositionAndOrientation(brick)[0][0]:.3f} m", flush=True)
        time_of_hand = time.monotonic() - start
        time.sleep(max(0, (frame + 1) * PERIOD - time_of_hand))
