#!/usr/bin/python3
"""The MuJoCo example: a ball pressed on a table, then against a brick that gives way.

Usage: mujoco_test.py HAPTIC_SERVER EXAMPLE SCENE
"""

import csv
import pathlib
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import unittest

SERVER, EXAMPLE, SCENE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
HAND_STIFFNESS, CONTACT_STIFFNESS = 400, 4000  # N/m
GRAVITY = 9.81  # m/s²
FRICTION = 0.4 * 0.3 * GRAVITY  # N, of the brick on the table
GRIP = f"""after = "hold"
[grip]
stiffness = {HAND_STIFFNESS}
damping = 30
angular_stiffness = 2.0
angular_damping = 0.08
max_force = 30
max_torque = 0.3
"""


def reach(seconds, x, z):
    return f"[[segment]]\nduration = {seconds}\nmove_to = {{ position = [{x}, 0, {z}], rotation = [0, 0, 0] }}\n"


def play(seconds, script):
    """Runs server and example. Returns the ticks with force on, and what the example printed."""
    with tempfile.TemporaryDirectory() as folder:
        log, hand = pathlib.Path(folder) / "ticks.csv", pathlib.Path(folder) / "hand.toml"
        hand.write_text(GRIP + script)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % probe.getsockname()[1]
        server = subprocess.Popen([SERVER, "--listen", address, "--hand", hand, "--log", log, "--status", "false",
                                   "--device-option", "freedom=spatial", "--device-option", "friction=0"],
                                  stderr=subprocess.DEVNULL)
        try:
            printed = subprocess.run([EXAMPLE, SCENE, address, str(seconds)], stdout=subprocess.PIPE, text=True,
                                     check=True, timeout=60).stdout
        finally:
            server.terminate()
            server.wait(timeout=10)
        with log.open() as file:
            return [row for row in csv.DictReader(file) if row["server_state"] == "active"], printed


def mean(ticks, column, begin, end):
    """Over the seconds from `begin` to `end` of the session."""
    start = float(ticks[0]["time_s"])
    chosen = [float(row[column]) for row in ticks if begin <= float(row["time_s"]) - start < end]
    return statistics.mean(chosen), statistics.pstdev(chosen)


class Touch(unittest.TestCase):
    def test_the_table_bears_the_push_of_the_hand_at_the_depth_of_its_spring(self):
        ticks, _ = play(3, reach(0.5, 0, 0.015))
        force, deviation = mean(ticks, "command_force_z_N", 1.5, 2.5)
        # Hand and contact are springs in a row, 5 mm together.
        due = 0.005 * HAND_STIFFNESS * CONTACT_STIFFNESS / (HAND_STIFFNESS + CONTACT_STIFFNESS)
        self.assertAlmostEqual(force, due, delta=0.01)  # N
        self.assertLess(deviation, 0.01)                # N
        proxy, _ = mean(ticks, "proxy_z_m", 1.5, 2.5)
        self.assertAlmostEqual(0.02 - proxy, due / CONTACT_STIFFNESS, delta=1e-5)  # m

    def test_the_brick_gives_way_at_its_friction(self):
        ticks, printed = play(6, reach(0.5, 0, 0.025) + reach(4, 0.15, 0.025))
        # MuJoCo's friction creeps below its limit, so the brick moves at less than that.
        force, deviation = mean(ticks, "command_force_x_N", 3, 4.2)
        self.assertGreater(-force, 0.75 * FRICTION)
        self.assertLess(-force, 1.1 * FRICTION)
        self.assertLess(deviation, 0.2)  # N
        last = re.search(r"brick (\S+) contacts \d+\n$", printed)
        self.assertAlmostEqual(float(last.group(1)), 0.15 + 0.02 + 0.02, delta=0.005)  # m


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
