#!/usr/bin/env python3
"""What a session endures of its machine: clocks that are set, disks that are full.

Usage: machine_test.py HAPTIC_SERVER VE_CLIENT WORLDS PROTOCOL.md [unittest arguments]

Real programs on loopback. The clock is that of the programs alone, the disk that of a mount namespace.
"""

import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import attacks_test
from attacks_test import LIMIT, PATIENT, Client, ForceTest, Server, drawn_to, goes_on
from machine import SteppedClock, on_small_disk

CLIENT, WORLD = None, None
STEPS = (3600, -3600, 0.3, -0.3, 1e8, 0)  # s
WALL = 0.124  # m, where the peg touches the bottom wall


class ClockSteps(ForceTest):
    def test_a_clock_that_is_set_neither_ends_a_session_nor_touches_its_force(self):
        folder = self.enterContext(tempfile.TemporaryDirectory())
        clock = SteppedClock(folder)
        server = self.enterContext(Server(
            *PATIENT, "--record", pathlib.Path(folder) / "run.pcap", "--recordings", folder,
            hand_script=drawn_to(-0.05, WALL + 0.05, 1), environment=clock.environment))
        client = subprocess.Popen(
            [CLIENT, "--server", "%s:%d" % server.address, "--world", WORLD, "--rate", "60"],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=clock.environment)
        time.sleep(4)
        for step in STEPS:
            clock.set(step)
            os.kill(server.process.pid, signal.SIGUSR1)
            time.sleep(0.7)
        client.terminate()
        said = client.communicate(timeout=10)[1]
        ticks = server.ticks()
        years = {path.name[7:11] for path in pathlib.Path(folder).glob("flight-*")}
        self.assertGreater(len(years), 1)  # the server did see its clock set
        in_session = [row for row in ticks if row["server_state"] not in ("off", "fading")]
        self.assertIsNotNone(goes_on(in_session))
        self.assertEqual({row["fault"] for row in ticks}, {"none"})
        self.assertNotIn("lost", said)
        pressed = [row for row in in_session if row["time"] > in_session[0]["time"] + 3]
        self.assertGreater(len(pressed), 1000)
        self.assertGreater(min(row["force"] for row in pressed), LIMIT - 0.5)
        self.assertLess(max(float(row["age_s"]) for row in pressed), 0.5)
        self.check_force(ticks)


class FullDisk(unittest.TestCase):
    def test_a_disk_that_fills_up_is_reported_and_the_session_goes_on(self):
        disk = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        if on_small_disk(disk, ["true"]) is None:
            self.skipTest("mount namespaces are not allowed here")
        server = self.enterContext(Server(
            *PATIENT, "--log", disk / "ticks.csv", "--record", disk / "run.pcap", "--recordings", disk,
            wrap=lambda command: on_small_disk(disk, command)))
        said = []
        reader = threading.Thread(target=lambda: said.extend(iter(server.process.stderr.readline, "")))
        reader.start()
        client = Client(server)
        client.begin()
        client.press(4)
        os.kill(server.process.pid, signal.SIGUSR1)
        client.press(2)
        steps = client.state["step"]
        client.press(0.5)
        self.assertGreater(client.state["step"], steps)
        self.assertEqual((client.state["server"], client.state["fault"]), (1, 0))
        self.assertLess(client.state["F_command"][0], -LIMIT + 0.1)
        server.process.terminate()
        self.assertEqual(server.process.wait(timeout=10), 1)
        reader.join()
        for file in ("ticks.csv", "run.pcap", "flight-"):
            self.assertTrue(any(file in line and "the session goes on" in line for line in said), (file, said))


if __name__ == "__main__":
    attacks_test.SERVER, CLIENT = sys.argv[1:3]
    WORLD = pathlib.Path(sys.argv[3]) / "testbed.sdf"
    attacks_test.DOC = attacks_test.Document(sys.argv[4])
    unittest.main(argv=[sys.argv[0], *sys.argv[5:]], verbosity=2)
