#!/usr/bin/env python3
"""The energy receipt of a recorded session: from the capture, from the tick log, and as the server said.

Usage: receipt_test.py HAPTIC_SERVER HAPTIC_REPLAY PROTOCOL.md HOSTILE_CLIENT_TEST [unittest arguments]
"""

import csv
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import attacks_test
from attacks_test import Client, Server

REPLAY = HOSTILE = None
CHECK = pathlib.Path(__file__).parents[2] / "scripts" / "energy_receipt.py"
TOLERANCE = 1e-9  # J
SLOW = ("--rate", "500")  # Hz: fewer ticks are missed than at twice that.
SESSIONS = 10  # At most, until one has no tick that the machine missed.


class Receipt(unittest.TestCase):
    def test_replay_script_and_server_agree(self):
        for attempt in range(SESSIONS):
            folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
            with Server("--record", folder / "run.pcap", *SLOW) as server:
                client = Client(server)
                client.begin()
                client.press(0.8)
                server.ticks()
                replayed = self.checked_replay(server, folder, last=attempt + 1 == SESSIONS)
            if replayed:
                break
        rows = [row for row in csv.DictReader(replayed.splitlines())
                if int(row["step"]) <= client.state["step"]]
        for name in ("given", "taken"):
            self.assertAlmostEqual(sum(float(row[name + "_J"]) for row in rows), client.state[name], delta=TOLERANCE)
        self.assertGreater(client.state["taken"], 0.1)

    def checked_replay(self, server, folder, last):
        """The receipt; None where the machine stood still, so that the log lacks ticks."""
        receipt = folder / "receipt.csv"
        replay = subprocess.run([REPLAY, folder / "run.pcap", "--receipt", "--hand", server.log.parent / "hand.toml",
                                 "--device-option", "friction=0", *SLOW], capture_output=True, text=True)
        self.assertEqual(replay.returncode, 0, replay.stderr)
        replayed = replay.stdout
        receipt.write_text(replayed)
        check = subprocess.run([sys.executable, CHECK, server.log, receipt], capture_output=True, text=True)
        if "lacks the steps" in check.stdout + check.stderr and not last:
            return None
        self.assertEqual(check.returncode, 0, check.stdout + check.stderr)
        damaged = replayed.splitlines(keepends=True)
        receipt.write_text("".join(damaged[:-20] + damaged[-19:-18] + [self.changed(damaged[-18])]))
        check = subprocess.run([sys.executable, CHECK, server.log, receipt], capture_output=True, text=True)
        self.assertEqual(check.returncode, 1)
        return replayed

    def test_the_port_gives_a_hostile_client_no_more_than_its_bound(self):
        folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        subprocess.run([HOSTILE, "A hostile client gets*"], env={**os.environ, "HLM_HOSTILE_LOG": f"{folder}/"},
                       capture_output=True, check=True)
        logs = sorted(folder.glob("*.csv"))
        self.assertEqual(len(logs), 4)
        for log in logs:
            within = subprocess.run([sys.executable, CHECK, log, "--bound", "5", "1"], capture_output=True, text=True)
            self.assertEqual(within.returncode, 0, within.stdout + within.stderr)
        # Walls that are said to move do push.
        above = subprocess.run([sys.executable, CHECK, log, "--bound", "5", "0"], capture_output=True, text=True)
        self.assertEqual(above.returncode, 1, above.stdout + above.stderr)

    @staticmethod
    def changed(line):
        fields = line.split(",")
        fields[3] = repr(float(fields[3]) + 2e-9)
        return ",".join(fields)


if __name__ == "__main__":
    attacks_test.SERVER, REPLAY = sys.argv[1:3]
    attacks_test.DOC = attacks_test.Document(sys.argv[3])
    HOSTILE = sys.argv[4]
    unittest.main(argv=[sys.argv[0], *sys.argv[5:]], verbosity=2)
