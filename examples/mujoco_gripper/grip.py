#!/usr/bin/python3
"""A robot's gripper in the hand: it comes down on a cube, closes, and lifts it. With a device you do that yourself.

Usage: grip.py [MODEL.xml], by default linkage.xml beside it. The model has a body "palm" with a site "pinch" between its jaws, and a
body "cube"; it begins as its first keyframe has it.

Needs MuJoCo's official binding (pip install mujoco) and the package haptic-local-model. Without a server it has one of its own, with a
simulated device; the page that it names shows it all.
"""

import pathlib
import sys
import time

import haptic_local_model as haptic
import mujoco
import numpy as np

PERIOD = 1 / 60  # s, of a frame
DOWN, CLOSED, UP, END = 2.0, 3.0, 5.0, 7.0  # s: until then
HEIGHT = 0.06  # m

path = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).with_name("linkage.xml"))
model = mujoco.MjModel.from_xml_path(str(path))
data = mujoco.MjData(model)
mujoco.mj_resetDataKeyframe(model, data, 0)
mujoco.mj_forward(model, data)

with haptic.mujoco.Session(model, data, gripper="palm", period=PERIOD) as touch:
    touch.show()
    begin, turn = data.body("palm").xpos.copy(), data.body("palm").xquat.copy()
    around = begin + data.body("cube").xpos - data.site("pinch").xpos  # where the cube is between the jaws
    start = time.monotonic()
    for frame in range(10**9):
        t = min(time.monotonic() - start, END)
        up = HEIGHT * np.clip((t - CLOSED) / (UP - CLOSED), 0, 1)
        touch.hold(begin + np.clip(t / DOWN, 0, 1) * (around - begin) + (0, 0, up), turn)
        touch.move_jaws(1.0 if t < DOWN else 0.0)
        for _ in range(touch.drive(data)):
            mujoco.mj_step(model, data)
        touch.send(data)
        if frame % 30 == 0:
            print(f"open {100 * touch.opening:3.0f} %, grip {touch.grip:5.1f} N, up {touch.touch.state.contact_wrench[2]:6.2f} N, "
                  f"cube at {1e3 * data.body('cube').xpos[2]:4.0f} mm, arm {1e3 * touch.follow_error:.1f} mm behind", flush=True)
        if t == END or not touch.running:
            break
        time.sleep(max(0, start + frame * PERIOD - time.monotonic()))
