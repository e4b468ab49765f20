#!/usr/bin/python3
"""A session that finds no server starts one of its own, and takes it along when it ends, however it ends.

Usage: own_server_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER
"""

import contextlib
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest

SERVER, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
PATIENCE = 10  # s
CLIENT = """
done = False
import os, sys, time
import haptic_local_model as haptic
# The floor is 1 mm below the tool; the hand's spring of 200 N/m leads 10.5 mm into it, whose own has 4000 N/m.
with haptic.Session({arguments}tool=haptic.box(mass=0.3, size=(0.04,) * 3)) as touch:
    print(touch.message, flush=True)
    while touch.poll():
        touch.hold((0, 0, -0.0115))
        touch.sample(touch.q, touch.v, 1 / 60)
        near = haptic.contacts(1)
        near["point"], near["normal"], near["separation"] = (0, 0, -0.021), (0, 0, 1), touch.q[2] + 0.001
        touch.send(touch.track(near[near["separation"] < 0.005]))
        print(touch.server_state, touch.force[2], flush=True)
        time.sleep(1 / 60)
        {at_last}
"""


def free_address():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return "127.0.0.1:%d" % probe.getsockname()[1]


def runs(process):
    try:
        return pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


@contextlib.contextmanager
def client(arguments="", at_last="", address=None, **variables):
    program = CLIENT.format(arguments=arguments, at_last=at_last)
    environment = {**os.environ, "HAPTIC_SERVER": address or free_address(), "HAPTIC_LIBRARY": str(LIBRARY), "PYTHONPATH": str(PACKAGE), **variables}
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=PATIENCE)


class Started(unittest.TestCase):
    def started(self, process):
        """Number of the server, once force is on. It listens at self.address."""
        said = process.stderr.readline()
        words = re.fullmatch(r"haptic: no server listens at \S+: started \S+/haptic_server at (\S+) with a simulated device, "
                             r"until this session ends or: kill (\d+)\n", said)
        self.assertTrue(words, said)
        self.address, number = words.groups()
        self.wait_for(process, lambda state, force: state == "active")
        return int(number)

    def wait_for(self, process, holds):
        process.stdout.readline()
        end = time.monotonic() + PATIENCE
        for line in process.stdout:
            state, force = line.split()
            if holds(state, float(force)):
                return
            self.assertLess(time.monotonic(), end, line)
        self.fail("the client ended")

    def assert_ends(self, server):
        end = time.monotonic() + 1  # s
        while runs(server):
            if time.monotonic() > end:
                os.kill(server, signal.SIGKILL)
                self.fail("a server is left")
            time.sleep(0.01)

    def test_its_hand_presses_with_what_its_spring_gives(self):
        with client() as process:
            self.started(process)
            self.wait_for(process, lambda state, force: abs(force - 2) < 0.002)  # N

    def test_it_ends_with_the_session(self):
        with client(at_last='if touch.server_state == "active": break') as process:
            self.assert_ends(self.started(process))
            self.assertEqual(process.wait(PATIENCE), 0)

    def test_it_records_where_it_is_told_to(self):
        with tempfile.TemporaryDirectory() as folder:
            recording = pathlib.Path(folder) / "run.pcap"
            with client(at_last='if touch.server_state == "active": break', HAPTIC_RECORD=str(recording)) as process:
                self.started(process)
                self.assertEqual(process.wait(PATIENCE), 0)
            replay = subprocess.run([SERVER.parent / "haptic_replay", recording, "--offline"], stdout=subprocess.PIPE, text=True,
                                    timeout=PATIENCE)
        self.assertRegex(replay.stdout, r"(\d+) of \1 acknowledged states equal bit for bit")
        self.assertEqual(replay.returncode, 0)

    def test_it_ends_with_an_exception(self):
        with client(at_last='if touch.server_state == "active": raise RuntimeError') as process:
            self.assert_ends(self.started(process))
            self.assertEqual(process.wait(PATIENCE), 1)

    def test_it_ends_when_its_program_is_interrupted_or_killed(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            with self.subTest(signal=number.name), client() as process:
                server = self.started(process)
                process.send_signal(number)
                self.assert_ends(server)

    def test_a_child_that_was_forked_ends_without_it(self):
        forks = 'if touch.server_state == "active" and not done:\n            done = True\n            os.fork() or sys.exit(0)'
        with client(at_last=forks) as process:
            server = self.started(process)
            states = [process.stdout.readline().split()[0] for _ in range(60)]  # 1 s
            self.assertEqual(set(states), {"active"})
            self.assertTrue(runs(server))

    def test_two_programs_have_one_each_and_leave_the_usual_port_free(self):
        address = free_address()
        with client(address=address) as one, client(address=address) as other:
            self.assertNotEqual(self.started(one), self.started(other))
            usual = subprocess.run([SERVER, "--listen", address, "--duration", "0.1", "--status", "false"],
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=PATIENCE)
            self.assertEqual(usual.returncode, 0, usual.stderr)
            for program in (one, other):
                self.wait_for(program, lambda state, force: state == "active")

    def test_that_it_has_ended_is_the_session_s_message(self):
        with client(at_last='if touch.message: sys.exit(touch.message)') as process:
            os.kill(self.started(process), signal.SIGTERM)
            self.assertIn("the server that this session started has ended, with status 0",
                          process.communicate(timeout=PATIENCE)[1])

    def test_that_it_has_ended_is_no_message_once_another_serves(self):
        with client(at_last='if touch.connected and touch.message: sys.exit(touch.message)') as process:
            os.kill(self.started(process), signal.SIGTERM)
            self.wait_for(process, lambda state, force: state == "off")
            with subprocess.Popen([SERVER, "--listen", self.address, "--device-option", "freedom=spatial",
                                   "--status", "false"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as other:
                try:
                    for _ in range(2):
                        self.wait_for(process, lambda state, force: state == "active")
                finally:
                    other.terminate()


    def test_a_variable_that_is_empty_is_none(self):
        with client(HAPTIC_SERVER_PROGRAM="", PATH="") as process:
            self.started(process)

    def test_without_standard_error_nothing_is_said(self):
        program = CLIENT.format(arguments="", at_last="break")
        done = subprocess.run(["/bin/sh", "-c", 'exec "$@" 2>&-', "sh", sys.executable, "-c", program],
                              stdout=subprocess.PIPE, text=True, timeout=PATIENCE,
                              env={**os.environ, "HAPTIC_SERVER": free_address(), "HAPTIC_LIBRARY": str(LIBRARY),
                                   "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(done.returncode, 0)
        self.assertEqual(done.stdout, "\noff 0.0\n")


class NotStarted(unittest.TestCase):
    def says(self, *arguments, **variables):
        """What is said on standard error in the first steps."""
        with client(*arguments, at_last="break", **variables) as process:
            return process.communicate(timeout=PATIENCE)[1]

    def test_none_is_started_where_one_listens(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
            server.bind(("127.0.0.1", 0))
            self.assertEqual(self.says(address="127.0.0.1:%d" % server.getsockname()[1]), "")

    def test_none_is_started_where_one_is_named_or_it_is_forbidden(self):
        self.assertEqual(self.says('"127.0.0.1:9", '), "")
        self.assertEqual(self.says("start_server=False, "), "")

    def test_where_there_is_no_program_the_places_are_listed(self):
        with tempfile.TemporaryDirectory() as folder:
            beside = pathlib.Path(folder) / "build/client/libhaptic.so"
            beside.parent.mkdir(parents=True)
            beside.write_bytes(LIBRARY.read_bytes())
            error = self.says(HAPTIC_LIBRARY=str(beside), PATH=folder)
            self.assertIn(f"there is no haptic_server to start: looked for {folder}/build/bin/haptic_server, ", error)
            self.assertIn(", PATH. Install it, set HAPTIC_SERVER_PROGRAM to its file", error)
        self.assertIn("looked for /nowhere/server. ", self.says(HAPTIC_SERVER_PROGRAM="/nowhere/server"))

    def test_a_server_serves_no_parent_but_its_own(self):
        done = subprocess.run([SERVER, "--listen", free_address(), "--parent", "1"], stderr=subprocess.PIPE, text=True,
                              timeout=PATIENCE)
        self.assertEqual(done.returncode, 2)
        self.assertIn(f"--parent 1 must be the process that started the server: {os.getpid()}", done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
