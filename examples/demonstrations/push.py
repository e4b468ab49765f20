#!/usr/bin/python3
"""Ten demonstrations with the forces in them: a hand pushes a brick over a table, and a data set of HDF5 is made of that.

Usage: push.py FOLDER

Needs MuJoCo's official binding and the package haptic-local-model with what data sets need: pip install mujoco
'haptic-local-model[dataset]'. Here the hand is a script and time is virtual, which takes some seconds; with a device haptic_server --record
run.pcap is the server, and a person the hand.
"""

import pathlib
import random
import sys

import haptic_local_model as haptic
import haptic_local_model.dataset
import haptic_local_model.virtual
import mujoco
import numpy as np

SCENE = pathlib.Path(__file__).parents[1] / "mujoco_python/scene.xml"
PERIOD = 1 / 60  # s
ABOVE, DOWN, THROUGH = (0.0, 0.04), (0.0, 0.022), (0.12, 0.022)  # m: x and z of the tool
DUE = 0.03  # m, that the brick is to move


def demonstrate(server, folder, chance):
    """One attempt. The hand misses the middle of the brick, and is not always fast enough."""
    model = mujoco.MjModel.from_xml_path(str(SCENE))
    data = mujoco.MjData(model)
    beside, pace = chance.uniform(-0.03, 0.03), chance.uniform(0.6, 1.4)  # m, 1
    with haptic.mujoco.Session(model, data, tool="tool", period=PERIOD) as touch:
        begin = data.body("brick").xpos.copy()
        with touch.episode("push the brick", folder, beside=beside) as episode:
            start = server.now
            while server.now < start + 4:
                x, z = (np.interp(pace * (server.now - start), (0, 1, 4), each) for each in zip(ABOVE, DOWN, THROUGH))
                touch.hold((x, beside, z))
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                touch.send(data)
                touch.log(qpos=data.qpos, brick=data.body("brick").xpos)
            moved = float(np.linalg.norm(data.body("brick").xpos - begin))
            if moved > DUE:
                episode.success()
            else:
                episode.failure()
    return moved


def main(folder):
    chance = random.Random(1)
    recording, episodes, made = folder / "run.pcap", folder / "demonstrations", folder / "push.hdf5"
    folder.mkdir(parents=True)
    with haptic.virtual.Server("--record", str(recording)) as server:
        for number in range(10):
            print(f"{number}: the brick moved by {1e3 * demonstrate(server, episodes, chance):.0f} mm", flush=True)
    haptic.dataset.convert([recording], [episodes], "hdf5", made, fps=30)
    print(*haptic.dataset.check(made), sep="\n")
    print(f"{made}: {made.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(pathlib.Path(sys.argv[1]))
