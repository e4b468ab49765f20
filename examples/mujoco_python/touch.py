#!/usr/bin/python3
"""A MuJoCo world in the hand. Without a device the mouse is the hand: double-click the green ball, then hold Ctrl and
drag it with the right button, or turn it with the left one.

Needs MuJoCo's official binding (pip install mujoco) and the package haptic. Ends with its window.
"""

import pathlib
import time

import haptic_local_model as haptic
import mujoco
import mujoco.viewer

PERIOD = 1 / 60  # s, of a frame

model = mujoco.MjModel.from_xml_path(str(pathlib.Path(__file__).with_name("scene.xml")))
data = mujoco.MjData(model)
with haptic.mujoco.Session(model, data, tool="tool", period=PERIOD) as touch, \
        mujoco.viewer.launch_passive(model, data) as viewer:
    frame, start = 0, time.monotonic()
    while viewer.is_running():
        touch.hold(data.mocap_pos[0], data.mocap_quat[0])
        for _ in range(touch.drive(data)):
            mujoco.mj_step(model, data)
        touch.send(data)
        viewer.sync()
        frame += 1
        if frame % 30 == 0:
            x, y, z = touch.touch.force[:3]
            print(f"{touch.touch.server_state}: {x:6.2f} {y:6.2f} {z:6.2f} N", flush=True)
        time.sleep(max(0, start + frame * PERIOD - time.monotonic()))
