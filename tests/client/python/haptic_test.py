#!/usr/bin/python3
"""The Python package and the C interface below it, against the real server.

Usage: haptic_test.py HAPTIC_SERVER HAPTIC_KEYGEN LIBHAPTIC PACKAGE_FOLDER
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

SERVER, KEYGEN, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path.insert(0, str(PACKAGE))

import haptic_local_model as haptic  # noqa: E402
import haptic_local_model.shapes  # noqa: E402
import numpy as np  # noqa: E402

RATE = 60  # Hz
PERIOD = 1 / RATE
EDGE = 0.04  # m, of the tool
FLOOR = -0.025  # z, m, of the world; the tool begins 5 mm above it
PATIENCE = 10  # s

# A spring of 200 N/m that wants the tool 10 mm deep in the floor: 2 N.
TARGET = FLOOR + EDGE / 2 - 0.01  # z, m
HAND = f"""after = "hold"
[grip]
stiffness = 200
damping = 20
angular_stiffness = 2.0
angular_damping = 0.08
max_force = 30
max_torque = 0.3
[[segment]]
duration = 0.5
move_to = {{ position = [0, 0, {TARGET}], rotation = [0, 0, 0] }}
"""


@contextlib.contextmanager
def server(*options, patient=True):
    """A server with a spatial device and HAND. Yields its address."""
    with tempfile.TemporaryDirectory() as folder, \
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        address = "127.0.0.1:%d" % probe.getsockname()[1]
        probe.close()
        hand = pathlib.Path(folder) / "hand.toml"
        hand.write_text(HAND)
        # A real-time thread that fills its period, as a sanitized one does on a slow machine, stands still for 50 ms of each second.
        process = subprocess.Popen([SERVER, "--listen", address, "--hand", hand, "--status", "false",
                                    "--device-option", "freedom=spatial",
                                    "--device-option", "friction=0", "--realtime", "off", *options,
                                    *(("--silence-time", "10", "--max-gap", "60") if patient else ())],
                                   stderr=subprocess.PIPE, text=True)
        while "listening" not in (line := process.stderr.readline()):
            if not line:
                raise RuntimeError("the server did not start")
        try:
            yield address, process
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()
            process.communicate(timeout=PATIENCE)


def box():
    return haptic.box(mass=0.3, size=(EDGE,) * 3)


def corners(q):
    """The four lower corners of the tool that is at q and does not turn, and the floor below them."""
    found = haptic.contacts(4)
    for i, (x, y) in enumerate(((-1, -1), (-1, 1), (1, -1), (1, 1))):
        found["point"][i] = q[0] + x * EDGE / 2, q[1] + y * EDGE / 2, FLOOR
    found["normal"] = 0, 0, 1
    found["separation"] = q[2] - EDGE / 2 - FLOOR
    return found


def play(session, seconds, contacts=corners):
    """Steps of a world in which the tool is where the proxy is."""
    end = time.monotonic() + seconds
    while time.monotonic() < end and session.poll():
        session.sample(session.q, session.v, PERIOD)
        found = session.track(contacts(session.q))
        session.send(found[found["separation"] < 0.005])
        time.sleep(PERIOD)


def until(session, holds, contacts=corners):
    end = time.monotonic() + PATIENCE
    while not holds():
        if time.monotonic() > end:
            raise AssertionError("it took too long")
        play(session, 2 * PERIOD, contacts)


class WithServer(unittest.TestCase):
    def test_a_friction_that_no_packet_has_counts_as_the_largest(self):
        def rough(q):
            found = corners(q)
            found["friction"] = 1e5
            return found
        with server() as (address, _), haptic.Session(address, box(), rate=RATE) as touch:
            until(touch, lambda: touch.server_state == "active" and touch.state.active == 4, rough)
            self.assertEqual(touch.message, "")

    def test_a_body_is_where_its_pose_is(self):
        with server() as (address, _), haptic.Session(address, box(), rate=RATE) as touch:
            touch.offer([haptic.shapes.box((EDGE,) * 3, haptic.TOOL_LINK),
                         haptic.shapes.box((1, 1, 0.1), haptic.MOVABLE_BODY, 7)])
            block = haptic.poses(1)
            block["body"] = 7
            end = time.monotonic() + PATIENCE
            while time.monotonic() < end and not (touch.has_scene and touch.state.active == 4):
                touch.poll()
                touch.sample(touch.q, touch.v, PERIOD)
                block["position"] = 0, 0, FLOOR - 0.05 if touch.has_scene else -1
                touch.send(poses=block)
                time.sleep(PERIOD)
            self.assertEqual(touch.state.active, 4)

    def test_tracked_contacts_keep_their_identities_while_the_tool_slides(self):
        with server() as (address, _), haptic.Session(address, box(), rate=RATE) as touch:
            first = None
            for step in range(100):
                touch.poll()
                q = np.array([0.002 * step, 0.001 * step, 0, 1, 0, 0, 0])
                touch.sample(q, np.zeros(6), PERIOD)
                found = corners(q)
                order = np.roll(np.arange(4), step)  # The engine lists them as it likes.
                found = touch.track(np.ascontiguousarray(found[order]))
                identities = [found["identity"][np.flatnonzero(order == i)[0]] for i in range(4)]
                first = first or identities
                self.assertEqual(identities, first)
            self.assertEqual(len(set(first)), 4)

    def test_a_sealed_session_needs_the_key(self):
        with tempfile.TemporaryDirectory() as folder:
            key = pathlib.Path(folder) / "key"
            subprocess.run([KEYGEN, key], check=True, stdout=subprocess.DEVNULL)
            with server("--key-file", str(key)) as (address, _):
                with haptic.Session(address, box(), key_file=str(key)) as touch:
                    until(touch, lambda: touch.connected)
                with haptic.Session(address, box()) as touch:
                    play(touch, 0.5)
                    self.assertFalse(touch.connected)

    def test_nothing_waits_for_a_server_that_stands_still_which_is_a_fault_that_a_new_session_ends(self):
        with server(patient=False) as (address, process), haptic.Session(address, box(), rate=RATE) as touch:
            until(touch, lambda: touch.connected)
            process.send_signal(signal.SIGSTOP)
            begin = time.monotonic()
            for _ in range(1000):
                touch.poll()
                touch.sample(touch.q, touch.v, PERIOD)
                touch.send(touch.track(corners(touch.q)))
            self.assertLess(time.monotonic() - begin, 5)  # s: 5 ms a step, on any machine
            until(touch, lambda: not touch.connected)
            process.send_signal(signal.SIGCONT)
            until(touch, lambda: "fault" in touch.message)
            touch.close()
            process.send_signal(signal.SIGRTMIN)  # as haptic_doctor clear does at the device's machine
            with haptic.Session(address, box(), rate=RATE) as anew:
                until(anew, lambda: anew.connected)


class Silence(unittest.TestCase):
    def hear(self, session, holds):
        """The message as soon as it holds."""
        end = time.monotonic() + PATIENCE
        while not holds(session.message):
            self.assertLess(time.monotonic(), end, f"message: {session.message!r}")
            play(session, PERIOD)
        return session.message

    def test_where_nobody_answers_the_message_says_so_within_two_seconds(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as deaf:
            deaf.bind(("127.0.0.1", 0))
            address = "127.0.0.1:%d" % deaf.getsockname()[1]
            with haptic.Session(address, box()) as session:
                begin = time.monotonic()
                message = self.hear(session, bool)
                self.assertLess(time.monotonic() - begin, 2)
            self.assertIn(f"no server answers at {address}: haptic_server does not run there", message)

    def test_a_server_that_has_gone_is_missed(self):
        with server(patient=False) as (address, process), haptic.Session(address, box()) as session:
            until(session, lambda: session.connected)
            process.kill()
            message = self.hear(session, bool)
            self.assertIn(f"no server answers at {address} any more", message)
            self.assertFalse(session.connected)

    def test_another_client_is_named_as_the_reason(self):
        with server() as (address, _), haptic.Session(address, box()) as first:
            until(first, lambda: first.connected)
            with haptic.Session(address, box()) as second:
                end = time.monotonic() + PATIENCE
                while not second.message and time.monotonic() < end:
                    for session in (first, second):
                        session.poll()
                    first.sample(first.q, first.v, PERIOD)
                    first.send()
                    time.sleep(0.01)
                self.assertEqual(second.message, "the server gives no session: another session is alive")


class Interrupted(unittest.TestCase):
    PROGRAM = """
import signal, sys, time
import haptic_local_model as haptic
with haptic.Session("127.0.0.1:9", haptic.box(0.1, (0.04, 0.04, 0.04))) as first, \\
        haptic.Session("127.0.0.1:9", haptic.box(0.1, (0.04, 0.04, 0.04))) as second:
    print("begun", flush=True)
    while first.poll():
        time.sleep(0.01)
    print("ended", second.poll(), flush=True)
    if "twice" in sys.argv:
        time.sleep(60)
print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""

    def interrupted(self, *arguments):
        process = subprocess.Popen([sys.executable, "-c", self.PROGRAM, *arguments], stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(process.stdout.readline(), "begun\n")
        process.send_signal(signal.SIGINT)
        self.assertEqual(process.stdout.readline(), "ended False\n")
        if arguments:
            process.send_signal(signal.SIGINT)
        with process:
            return process.stdout.read(), process.stderr.read(), process.wait(PATIENCE)

    def test_ctrl_c_ends_the_loops_of_all_sessions_without_a_traceback(self):
        self.assertEqual(self.interrupted(), ("True\n", "", 0))

    def test_the_second_one_is_an_interrupt(self):
        _, errors, status = self.interrupted("twice")
        self.assertIn("KeyboardInterrupt", errors)
        self.assertNotEqual(status, 0)


class Mistakes(unittest.TestCase):
    def refused(self, text, **changes):
        contacts = corners([0, 0, 0.05, 1, 0, 0, 0])
        contacts["identity"] = 1, 2, 3, 4
        for name, value in changes.items():
            contacts[name] = value
        with haptic.Session("127.0.0.1:9", box()) as touch, self.assertRaises(haptic.HapticError) as caught:
            touch.sample([0, 0, 0.05, 1, 0, 0, 0], np.zeros(6), PERIOD)
            touch.send(contacts)
        self.assertIn(text, str(caught.exception))

    def test_a_normal_that_is_not_unit_is_named(self):
        self.refused("contact 0: normal (0, 0, 2) must be of length 1, not 2", normal=(0, 0, 2))

    def test_identities_that_come_twice_are_named(self):
        self.refused("contact 1: identity 5 is that of an earlier contact", identity=5)

    def test_a_link_that_the_tool_does_not_have_is_named(self):
        self.refused("side a: link 3 must be less than 1", a_index=3)

    def test_numbers_that_are_not_finite_are_named(self):
        self.refused("contact 0: separation nan m must be -10000 to 10000 m", separation=np.nan)

    def test_millimetres_are_asked_about(self):
        self.refused("are lengths in metres", point=(0, 0, 40000))

    def test_a_body_that_is_round_in_no_known_way_is_named(self):
        body = haptic.bodies(1)
        body["id"], body["round"] = 7, 300
        with haptic.Session("127.0.0.1:9", box()) as touch, self.assertRaises(haptic.HapticError) as caught:
            touch.send(haptic.contacts(0), body)
        self.assertEqual(str(caught.exception), "body 7: round 300 must be 0, 1 or 2")

    def test_a_plane_of_neither_side_is_named(self):
        self.refused("contact 0: plane 2 must be 0 or 1", plane=2)

    def test_an_external_wrench_that_cannot_be_used_is_named(self):
        for text, wrench, link in (("link 1 of an external wrench must be 0 to 0", np.zeros(6), 1),
                                   ("external wrench nan N or N·m must be -1000000 to 1000000", [0, 0, np.nan, 0, 0, 0], 0),
                                   ("wrench must have 6 numbers, not the shape (3,)", [0, 0, 1], 0)):
            with haptic.Session("127.0.0.1:9", box()) as touch, self.assertRaises(haptic.HapticError) as caught:
                touch.external_wrench(wrench, link)
            self.assertIn(text, str(caught.exception))

    def test_external_wrenches_of_one_sample_add_up(self):
        with haptic.Session("127.0.0.1:9", box()) as touch:
            for _ in range(3):
                touch.sample([0, 0, 0.05, 1, 0, 0, 0], np.zeros(6), PERIOD)
                touch.external_wrench([6e5, 0, 0, 0, 0, 0])  # Nothing is left of one that was not sent.
            with self.assertRaisesRegex(haptic.HapticError, "external wrench 1200000"):
                touch.external_wrench([6e5, 0, 0, 0, 0, 0])

    def test_a_quaternion_that_is_none_is_named(self):
        with haptic.Session("127.0.0.1:9", box()) as session:
            for q, length in ((np.zeros(7), "0"), ([0, 0, 0, 2, 0, 0, 0], "2")):
                with self.assertRaisesRegex(haptic.HapticError, f"q: its quaternion must be of length 1, not {length}"):
                    session.sample(q, np.zeros(6), PERIOD)
            session.sample([0, 0, 0, 1.0005, 0, 0, 0], np.zeros(6), PERIOD)  # What an engine's drifts by.

    def test_options_that_cannot_be_used_are_named(self):
        for text, options in (("mass", {"tool": haptic.box(mass=-1)}), ('"nowhere" must be HOST:PORT', {"server": "nowhere"}),
                              ("epsilon", {"epsilon": -1}), ("rate", {"rate": 0}),
                              ("q must have 7 numbers", {"q": [0, 0, 0]})):
            with self.assertRaises(haptic.HapticError, msg=text) as caught:
                haptic.Session(**options)
            self.assertIn(text, str(caught.exception))

    def test_arrays_of_another_kind_are_named(self):
        with haptic.Session("127.0.0.1:9", box()) as touch:
            with self.assertRaisesRegex(haptic.HapticError, "haptic.contacts"):
                touch.send(np.zeros((4, 3)))
            with self.assertRaisesRegex(haptic.HapticError, r"v must have 6 numbers, not the shape \(3,\)"):
                touch.sample([0, 0, 0, 1, 0, 0, 0], [0, 0, 0], PERIOD)

    def test_shapes_that_no_server_takes_are_named(self):
        touch = haptic.Session("127.0.0.1:9", box())
        self.addCleanup(touch.close)
        floor, ball = haptic.shapes.half_space(), haptic.shapes.sphere(0.02, haptic.TOOL_LINK)
        for reason, shapes, more in (
                ("shape 1: .*link 1 of the tool", [floor, haptic.shapes.sphere(0.02, haptic.TOOL_LINK, 1)], {}),
                ("a shape must be of the tool", [floor], {}),
                ("shape 0: .*half space", [haptic.shapes.shape("half_space", side=haptic.MOVABLE_BODY), ball], {}),
                ("shape 0: .*size 0 m must be above 0", [haptic.shapes.sphere(0), ball], {}),
                ("shape 0: .*vertices", [haptic.shapes.shape("hull"), ball], {}),
                ("shape 1: .*(finite|nan)", [floor, ball], {"positions": [[0, 0, 0], [0, 0, float("nan")]]}),
                ("rotations: shape", [ball], {"rotations": [[1, 0, 0]]}),
                ("friction must have 1", [ball], {"friction": [0, 1]}),
                ("shape 0: .*friction -11 must be", [ball], {"friction": [-11]}),
                ("rule 'least' must be one of", [ball], {"rule": "least"}),
                ("apart", [floor, ball], {"excluded": [(0, 2)]})):
            with self.subTest(reason=reason), self.assertRaisesRegex(haptic.HapticError, reason):
                touch.offer(shapes, **more)
        lost = haptic.poses(1)
        lost["position"] = float("inf")
        with self.assertRaisesRegex(haptic.HapticError, "pose of body 0: a number is not finite"):
            touch.send(poses=lost)
        touch.offer([ball, haptic.shapes.sphere(0.02, haptic.MOVABLE_BODY, 7)])
        brick, place = haptic.bodies(1), haptic.poses(1)
        with self.assertRaisesRegex(haptic.HapticError, "pose of body 0: no shape of it was offered"):
            touch.send(poses=place)
        brick["id"] = 7
        with self.assertRaisesRegex(haptic.HapticError, "body 7 must have a pose, too"):
            touch.send(bodies=brick)
        with self.assertRaisesRegex(haptic.HapticError, "65 poses must be at most 64"):
            touch.send(poses=haptic.poses(65))

    def test_arrays_that_are_refilled_do_not_change_the_shapes_that_were_made_of_them(self):
        vertices, triangles = np.eye(4, 3), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.uint32)
        made = haptic.shapes.shape("mesh", vertices=vertices, triangles=triangles)
        vertices[:], triangles[:] = 7, 0
        np.testing.assert_array_equal(made.kept, np.eye(4, 3))
        self.assertEqual(made.vertices, made.kept.ctypes.data)
        self.assertEqual(made.corners[3].tolist(), [1, 2, 3])

    def test_more_contacts_than_can_be_sent_are_refused_when_they_are_sent(self):
        contacts = haptic.contacts(haptic.MAX_CONTACTS + 1)
        contacts["normal"], contacts["identity"] = (0, 0, 1), 7
        with haptic.Session("127.0.0.1:9", box()) as touch:
            touch.track(contacts)
            self.assertEqual(contacts["identity"][-1], 7)  # as it was
            with self.assertRaisesRegex(haptic.HapticError, "193 contacts must be at most 192"):
                touch.send(contacts)

    def test_a_step_without_length_is_named(self):
        with haptic.Session("127.0.0.1:9", box()) as touch:
            touch.poll()
            for step in (0, -1, float("nan")):
                with self.assertRaisesRegex(haptic.HapticError, "step .* must be above 0"):
                    touch.steps(step)

    def test_a_place_where_no_hand_can_be_is_named(self):
        with haptic.Session("127.0.0.1:9", box()) as touch:
            with self.assertRaisesRegex(haptic.HapticError, "position of the hand nan m must be -10000 to 10000 m"):
                touch.hold((0, np.nan, 0))
            with self.assertRaisesRegex(haptic.HapticError, "rotation of the hand must be of length 1, not 0"):
                touch.hold((0, 0, 0), (0, 0, 0, 0))

    def test_a_closed_session_says_so(self):
        touch = haptic.Session("127.0.0.1:9", box())
        touch.close()
        self.assertFalse(touch.poll())
        with self.assertRaisesRegex(haptic.HapticError, "closed"):
            touch.send(haptic.contacts(0))

    def test_a_missing_library_says_where_it_was_looked_for(self):
        done = subprocess.run([sys.executable, "-c", "import haptic_local_model; haptic_local_model.Session()"], text=True,
                              stderr=subprocess.PIPE, cwd=PACKAGE,
                              env={**os.environ, "HAPTIC_LIBRARY": "/nowhere/libhaptic.so"})
        self.assertIn("set HAPTIC_LIBRARY to its file: /nowhere/libhaptic.so", done.stderr)


class Interface(unittest.TestCase):
    def test_the_libraries_show_the_functions_of_their_headers_and_no_others(self):
        header = (PACKAGE.parent / "haptic.h").read_text()
        declared = set(re.findall(r"HAPTIC_API [\w* ]+?\b(haptic_\w+)\(", header))
        printed = subprocess.run(["nm", "-D", "--defined-only", LIBRARY], text=True, check=True,
                                 stdout=subprocess.PIPE).stdout
        found = {line.split()[2].split("@")[0] for line in printed.splitlines() if line.split()[1] in "TWVu"}
        self.assertEqual(found, declared)
        listed = set(re.findall(r"\b(haptic_\w+);", (PACKAGE.parent / "haptic.map").read_text()))
        self.assertEqual(listed, declared)

    def test_records_have_the_layout_of_the_header(self):
        """A C compiler says what the header's structs are."""
        kinds = {"haptic_contact": haptic.CONTACT.itemsize, "haptic_body": haptic.BODY.itemsize}
        from haptic_local_model import _library
        import ctypes
        for name, kind in (("haptic_link", _library.Link), ("haptic_options", _library.Options),
                           ("haptic_state", _library.State), ("haptic_impulse", _library.Impulse),
                           ("haptic_shape", haptic.shapes.Shape)):
            kinds[name] = ctypes.sizeof(kind)
        offsets = {field: haptic.CONTACT.fields[field][1] for field in haptic.CONTACT.names}
        claims = [f"_Static_assert(sizeof({name}) == {size}, \"{name}\");" for name, size in kinds.items()]
        claims += [f"_Static_assert(offsetof(haptic_contact, {field}) == {offset}, \"{field}\");"
                   for field, offset in offsets.items()]
        code = '#include "haptic.h"\n' + "\n".join(claims)
        subprocess.run(["cc", "-std=c99", "-Wall", "-Wpedantic", "-Werror", "-fsyntax-only", "-x", "c",
                        f"-I{PACKAGE.parent}", "-D_Static_assert(a,b)=extern int claim[(a)?1:-1]", "-"], input=code,
                       text=True, check=True)


class OldName(unittest.TestCase):
    def test_haptic_is_the_same_package(self):
        code = ("import haptic, haptic.shapes, haptic_local_model; from haptic.shapes import box;"
                "assert haptic is haptic_local_model and haptic.shapes is haptic_local_model.shapes;"
                "assert box is haptic_local_model.shapes.box")
        done = subprocess.run([sys.executable, "-W", "always", "-c", code], text=True, stderr=subprocess.PIPE,
                              env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("write `import haptic_local_model as haptic`", done.stderr)
        run = subprocess.run([sys.executable, "-m", "haptic", "--version"], text=True, capture_output=True,
                             env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertRegex(run.stdout, r"^haptic_demo \d", run.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[5:], verbosity=2)
