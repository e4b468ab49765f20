#!/usr/bin/python3
"""What a frame of haptic.mujoco costs beside MuJoCo's steps: the example's cube, pressed on its table beside a brick, with the server's
contacts; and the same with 20 more bricks around.

Usage: mujoco_loop.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER SCENE.xml, with a Python that has mujoco
"""

import os
import pathlib
import statistics
import sys
import time

SERVER, LIBRARY, PACKAGE, SCENE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
os.environ["HAPTIC_SERVER_PROGRAM"] = str(SERVER)
sys.path.insert(0, str(PACKAGE))

import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402

PERIOD = 1 / 60  # s
BRICKS = "".join(f'''<body pos="{0.1 * (i % 5 - 2)} {0.15 + 0.1 * (i // 5)} 0.02"><freejoint/>
<geom type="box" size="0.02 0.04 0.02" mass="0.3"/></body>''' for i in range(20))


def measure(name, xml):
    """Prints medians of the processor's time, which others on the machine disturb least."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    costs, forward = [], 0.0
    with haptic.mujoco.Session(model, data, tool="tool", period=PERIOD) as touch:
        end = time.perf_counter()
        for _ in range(400):
            touch.hold((0, 0, 0.012))
            times = [time.thread_time()]
            steps = touch.drive(data)
            times.append(time.thread_time())
            for _ in range(steps):
                mujoco.mj_step(model, data)
            times.append(time.thread_time())
            mujoco.mj_forward(model, data)  # As send() does: MuJoCo's own part of it.
            times.append(time.thread_time())
            touch.send(data)
            times.append(time.thread_time())
            drive, _, forward, send = (1e3 * (after - before) for before, after in zip(times, times[1:]))
            if touch.touch.has_scene and steps:
                costs.append((drive, send - forward))
            end += PERIOD
            while time.perf_counter() < end:  # Sleep would give the core to others.
                pass
        drive, send = (statistics.median(column) for column in zip(*costs))
        print(f"{name}: {len(costs)} frames, ms: {drive + send:.3f} (drive {drive:.3f}, send {send:.3f} without mj_forward), "
              f"force {touch.touch.force[2]:.2f} N; medians of processor time")


scene = SCENE.read_text()
measure("one brick", scene)
measure("21 bricks", scene.replace("</worldbody>", BRICKS + "</worldbody>"))
