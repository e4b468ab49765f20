#!/usr/bin/python3
"""Scripted hands with seeds that take a peg with a gripper and put it into a socket, in virtual time: how many do, and with which force.

Usage: peg_hands.py LIBHAPTIC PACKAGE_FOLDER [--hands N] [--clearance MM …] [--delay MS …] [--seed N]

The peg is a cylinder of 28 mm, the socket eight walls around it, 50 mm deep, as in OpenArm's public scene, which has 6 mm to spare. A hand
takes the peg up to 2 mm beside its middle, misses the middle of the socket by up to 2/3 of what it has to spare, and pushes the peg aside by
as much once it is in. Prints, of each clearance and delay, how many pegs were in the socket for half a second, the largest force on
the hand from the rim on, and the mean of the largest.
"""

import argparse
import os
import pathlib
import sys

import numpy as np

RADIUS, DEPTH, WALL, LENGTH = 0.014, 0.05, 0.005, 0.09  # m
SOCKET = (0.0, 0.2)  # m
INSIDE, FOR = 0.03, 0.5  # m, s: a peg is in
GRIP = """after = "hold"
[grip]
stiffness = 800
damping = 40
angular_stiffness = 8.0
angular_damping = 0.2
max_force = 20
max_torque = 0.5
"""


def scene(clearance):
    walls = "".join(
        f'<geom type="box" size="{2.2 * (RADIUS + clearance) / 2} {WALL} {DEPTH / 2}" friction="0.2" '
        f'pos="{SOCKET[0] + (RADIUS + clearance + WALL) * np.cos(a)} {SOCKET[1] + (RADIUS + clearance + WALL) * np.sin(a)} {DEPTH / 2}" '
        f'euler="0 0 {a + np.pi / 2}"/>' for a in np.arange(8) * np.pi / 4)
    jaws = "".join(f'<body name="{name}" gravcomp="1"><joint name="{name}" type="slide" axis="0 {side} 0" range="0 0.04"/>'
                   f'<geom type="box" size=".012 .005 .02" pos="0 {side * 0.005} -.1" mass=".02" friction="1"/></body>'
                   for name, side in (("left", 1), ("right", -1)))
    servos = "".join(f'<position joint="{name}" kp="1000" ctrlrange="0 .04" forcerange="-20 20"/>' for name in ("left", "right"))
    return f"""<mujoco><compiler angle="radian" autolimits="true"/><option timestep="0.002"/><worldbody>
      <geom type="plane" size="2 2 .1" friction="0.5"/>{walls}
      <body name="peg" pos="0 0 {LENGTH / 2}"><freejoint/><geom type="cylinder" size="{RADIUS} {LENGTH / 2}" mass=".05" friction="0.2"/></body>
      <body name="palm" pos="0 0 .26" gravcomp="1"><freejoint/><geom type="box" size=".03 .08 .02" pos="0 0 .02" mass=".1"/>{jaws}</body>
      </worldbody><actuator>{servos}</actuator></mujoco>"""


def segment(seconds, x, y, z, opening=None):
    return (f"[[segment]]\nduration = {seconds}\nmove_to = {{ position = [{x}, {y}, {z}], rotation = [0, 0, 0] }}\n"
            + ("" if opening is None else f"opening = {opening}\n"))


def hand(random, clearance):
    """Its script, and how long that takes, s."""
    taken = random.uniform(-0.002, 0.002)  # m: along the jaws, which lie across y
    angle, miss = random.uniform(0, 2 * np.pi), np.sqrt(random.uniform()) * clearance * 2 / 3
    x, y = SOCKET[0] + miss * np.cos(angle) + taken, SOCKET[1] + miss * np.sin(angle)
    held, over, rim = LENGTH / 2 + 0.1 + 0.02, 0.26, DEPTH + LENGTH / 2 + 0.12
    steps = [(1.0, taken, 0, held, 1.0), (0.8, taken, 0, held, 0.0), (1.0, taken, 0, over, None), (1.5, x, y, over, None),
             (1.0, x, y, rim + 0.002, None), (1.0, x, y, rim - DEPTH * 0.7, None), (0.5, 2 * (SOCKET[0] + taken) - x, 2 * SOCKET[1] - y, rim - DEPTH * 0.7, None),
             (1.0, x, y, rim - DEPTH * 0.7, None)]
    return GRIP + "".join(segment(*each) for each in steps), sum(each[0] for each in steps)


def insert(haptic, mujoco, random, clearance, delay):
    """Whether the peg was in, and the largest force on the hand from its rim on, N."""
    model = mujoco.MjModel.from_xml_string(scene(clearance))
    data = mujoco.MjData(model)
    data.qpos[-2:] = 0.035
    mujoco.mj_forward(model, data)
    script, seconds = hand(random, clearance)
    peg, inside, longest = mujoco.mj_name2id(model, 1, "peg"), 0.0, 0.0
    with haptic.virtual.Server(hand=script, delay=delay, seed=int(random.integers(2**31))) as server:
        with haptic.mujoco.Session(model, data, gripper="palm", binding=mujoco, period=1 / 60) as touch:
            while server.now < seconds + 0.5:
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
                at = data.xpos[peg]
                is_in = at[2] - LENGTH / 2 < DEPTH - INSIDE and np.hypot(at[0] - SOCKET[0], at[1] - SOCKET[1]) < RADIUS
                inside = inside + 1 / 60 if is_in else 0.0
                longest = max(longest, inside)
        ticks = server.ticks
    from_rim = ticks[(ticks["server_state"] == "active") & (ticks["time_s"] > 5.3)]
    force = np.linalg.norm([from_rim[f"env_force_{axis}_N"] for axis in "xyz"], axis=0)
    return longest >= FOR, float(force.max())


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("library", type=pathlib.Path)
    parser.add_argument("package", type=pathlib.Path)
    parser.add_argument("--hands", type=int, default=100)
    parser.add_argument("--clearance", type=float, nargs="+", default=[6, 0.5], help="mm")
    parser.add_argument("--delay", type=float, nargs="+", default=[0, 20, 100, 300], help="ms each way")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    os.environ["HAPTIC_LIBRARY"] = str(given.library.resolve())
    sys.path.insert(0, str(given.package.resolve()))
    import haptic_local_model as haptic
    import haptic_local_model.mujoco
    import haptic_local_model.virtual
    import mujoco

    print(f"seed {given.seed}\nclearance  delay   in      force: largest, mean of the largest")
    missed = 0
    for clearance in given.clearance:
        for delay in given.delay:
            found = [insert(haptic, mujoco, np.random.default_rng([given.seed, i]), clearance / 1e3, delay / 1e3) for i in range(given.hands)]
            missed += sum(not ok for ok, _ in found)
            print(f"{clearance:6g} mm {delay:4g} ms  {sum(ok for ok, _ in found)}/{given.hands}  {max(f for _, f in found):6.2f} N "
                  f"{np.mean([f for _, f in found]):6.2f} N", flush=True)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
