#!/usr/bin/env python3
"""The real ve_client dies, or stands still, while a hand presses harder than the force limit.

Usage: client_death_test.py HAPTIC_SERVER VE_CLIENT WORLDS [unittest arguments]

What the force did is read from the server's tick log.
"""

import pathlib
import signal
import subprocess
import sys
import time
import unittest

import attacks_test
from attacks_test import LIMIT, PERIOD, SILENT, ForceTest, Server, drawn_to

CLIENT, WORLD = None, None
GONE = 0.1  # s
RISE = LIMIT / 0.1  # N/s, of the default rise time

WALL = 0.124  # m, where the peg touches the bottom wall
HAND = drawn_to(-0.05, WALL + 0.05, 1)


class ClientDeath(ForceTest):
    def setUp(self):
        self.server = self.enterContext(Server(hand_script=HAND))
        self.clients = []

    def tearDown(self):
        for client in self.clients:
            client.kill()
            client.communicate()

    def start(self):
        address = "%s:%d" % self.server.address
        self.clients.append(subprocess.Popen(
            [CLIENT, "--server", address, "--world", WORLD, "--rate", "60", "--quiet"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
        return self.clients[-1]

    def check_pauses(self, ticks, pauses):
        """Each pause of the updates ends the force within GONE, after which it comes back gently."""
        adopted = [row["time"] for row in ticks if row["adopted"] != "0"]
        ends = [b for a, b in zip(adopted, adopted[1:] + [float("inf")]) if b - a > 0.4]
        self.assertEqual(len(ends), pauses, ends)
        for end in ends:
            last = max(time for time in adopted if time < end)
            pressed = max(row["force"] for row in ticks if last - 0.1 < row["time"] <= last)
            self.assertGreater(pressed, LIMIT - 0.1)
            held = [row for row in ticks if last + GONE <= row["time"] < end]
            self.assertLess(max(row["force"] for row in held), SILENT)
            back = [row for row in ticks if end <= row["time"] < end + 0.1]
            for before, after in zip(back, back[1:]):
                periods = max(1, round((after["time"] - before["time"]) / PERIOD))
                self.assertLessEqual(after["force"] - before["force"], RISE * PERIOD * periods + 1e-6)
        self.check_force(ticks)

    def test_killed_and_started_again(self):
        self.start()
        time.sleep(4)
        self.clients[0].kill()
        time.sleep(1)
        self.start()
        time.sleep(4)
        self.clients[1].kill()
        time.sleep(0.6)
        self.check_pauses(self.server.ticks(), pauses=2)

    def test_stopped_and_continued(self):
        client = self.start()
        time.sleep(4)
        client.send_signal(signal.SIGSTOP)
        time.sleep(0.6)
        client.send_signal(signal.SIGCONT)
        time.sleep(1.5)
        client.send_signal(signal.SIGSTOP)
        time.sleep(0.6)
        self.check_pauses(self.server.ticks(), pauses=2)


if __name__ == "__main__":
    attacks_test.SERVER, CLIENT = sys.argv[1:3]
    WORLD = pathlib.Path(sys.argv[3]) / "testbed.sdf"
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]], verbosity=2)
