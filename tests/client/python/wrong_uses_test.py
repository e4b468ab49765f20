#!/usr/bin/python3
"""Wrong uses of the Python package and of the C interface: each gets one clear line, and none a crash or a wait.

Usage: wrong_uses_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER

What cannot be told, and is not here:
- A unit quaternion in the order x, y, z, w: it is another rotation, as good as any.
- A normal that points the wrong way: of a tool with a hole in it either way may be right. `haptic_doctor` examines what came.
- A contact's body that is among no `bodies`: it is a wall that moves with the contact's velocity.
- Numbers in milliseconds or millimetres that metres and seconds could be, too: a step of 2, a point at 40.
- Frames in the order sample, send, poll: with another first frame it is the right one.
- Two calls of send() after one sample(): the second may bring more contacts of the same configuration.
- In C a session that was closed: its memory is another's. In Python it is told.
- In C a list that is shorter than its count: memory has no bounds.
- A hull whose points lie in a plane, to offer(): only the server makes the hull; `message` says so then.
- Port 80 without the right to it: some systems give it to all. The text is that of a port that is taken.
- Two sessions to one server: the second one's `message` says so (haptic_test.py).
"""

import contextlib
import ctypes
import dataclasses
import os
import pathlib
import re
import select
import signal
import socket
import sys
import tempfile
import threading
import time
import types
import unittest

SERVER, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
os.environ["HAPTIC_SERVER_PROGRAM"] = str(SERVER)
sys.path.insert(0, str(PACKAGE))

import haptic_local_model as haptic  # noqa: E402
import haptic_local_model.mujoco  # noqa: E402
import haptic_local_model.shapes  # noqa: E402
import haptic_local_model.shapes  # noqa: E402
import numpy as np  # noqa: E402
from haptic_local_model import _library  # noqa: E402

NOBODY = "127.0.0.1:9"
PERIOD = 1 / 60
HERE = [0, 0, 0, 1, 0, 0, 0]
STILL = np.zeros(6)
NAN, INF = float("nan"), float("inf")
PATIENCE = 10  # s, of one use
LONGEST = 400  # characters of a line
TOOL, BODY = haptic.TOOL_LINK, haptic.MOVABLE_BODY
BALL = haptic.shapes.sphere(0.02, TOOL)


def box():
    return haptic.box(0.3, (0.04,) * 3)


def session(server=NOBODY, tool=None, **options):
    return haptic.Session(server, tool or box(), **options)


def with_session(use):
    """A use of a session that is open, where nobody answers, with a tool that was sampled."""
    def run():
        touch = session()
        touch.poll()
        touch.sample(HERE, STILL, PERIOD)
        return use(touch)
    return run


def offered(shapes, *arguments, **options):
    return with_session(lambda touch: touch.offer(shapes, *arguments, **options))


def link(**fields):
    made = box()
    for name, value in fields.items():
        if isinstance(value, (tuple, list)):
            getattr(made, name)[:] = value
        else:
            setattr(made, name, value)
    return made


def sent(count=1, **fields):
    def use(touch):
        made = haptic.contacts(count)
        made["normal"], made["identity"] = (0, 0, 1), np.arange(count)
        for name, value in fields.items():
            made[name] = value
        touch.send(made)
    return with_session(use)


def sent_bodies(count=1, **fields):
    def use(touch):
        made = haptic.bodies(count)
        for name, value in fields.items():
            made[name] = value
        touch.send(None, made)
    return with_session(use)


def sent_poses(shapes, count=1, **fields):
    def use(touch):
        if shapes:
            touch.offer(shapes)
        made = haptic.poses(count)
        for name, value in fields.items():
            made[name] = value
        touch.send(poses=made)
    return with_session(use)


def with_key(content, mode=0o600):
    def use():
        with tempfile.NamedTemporaryFile() as file:
            file.write(content)
            file.flush()
            os.chmod(file.name, mode)
            session(key_file=file.name)
    return use


def in_environment(use, **variables):
    def run():
        os.environ.update(variables)
        _library.load.cache_clear()
        return use()
    return run


def closed(use):
    def run():
        touch = session()
        touch.close()
        touch.close()
        use(touch)
    return run


def after_fork(use):
    """In a child of the process that has the session: its first line is the child's."""
    def run():
        touch = session()
        inlet, outlet = os.pipe()
        if os.fork() == 0:
            os.write(outlet, error_of(lambda: use(touch)).encode())
            os._exit(0)
        os.wait()
        raise haptic.HapticError(os.read(inlet, LONGEST).decode().removeprefix("HapticError: "))
    return run


def from_two_threads():
    """Until one of them is told; both call all the time."""
    touch, told, contacts = session(), [], haptic.contacts(haptic.MAX_CONTACTS)
    contacts["normal"] = 0, 0, 1

    def use():
        try:
            while not told:
                touch.poll()
                touch.sample(HERE, STILL, PERIOD)
                touch.track(contacts)
        except haptic.HapticError as error:
            told.append(error)
    threads = [threading.Thread(target=use) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    touch.close()
    raise told[0]


def message_of_own():
    """What a session says of the server that it started."""
    touch, end = haptic.Session(), time.monotonic() + PATIENCE / 2
    while touch.poll() and not touch.message and time.monotonic() < end:
        time.sleep(0.01)
    raise haptic.HapticError(touch.message)


def on_a_taken_port():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        session().show(other.getsockname()[1], open_browser=False)


def of_mujoco(tool="peg", data=None, **options):
    """A model of the world, a brick that is welded to it, a mocap body and a peg that floats."""
    free, none = 0, -1
    model = types.SimpleNamespace(nq=7, nv=6, nbody=4, ngeom=2, body_jntadr=[none, none, none, 0], body_jntnum=[0, 0, 0, 1],
                                  jnt_type=[free], jnt_qposadr=[0], jnt_dofadr=[0])
    names = {"world": 0, "brick": 1, "mocap": 2, "peg": 3}
    binding = types.SimpleNamespace(mj_name2id=lambda _, kind, name: names.get(name, -1),
                                    mj_id2name=lambda _, kind, number: list(names)[number],
                                    mj_versionString=lambda: "4.0.0")
    fitting = types.SimpleNamespace(qpos=np.zeros(7), qvel=np.zeros(6), xpos=np.zeros((4, 3)), geom_xpos=np.zeros((2, 3)))
    return lambda: haptic.mujoco.Session(model, data or fitting, tool, binding=binding, **options)


PYTHON = [
    # The tool.
    ("a mass that is a text", lambda: haptic.box(mass="heavy"), "mass must be a number, not 'heavy'"),
    ("a mass that is none", lambda: haptic.sphere(mass=None), "mass must be a number, not None"),
    ("a negative mass", lambda: session(tool=haptic.box(mass=-1)), "link 0: mass -1 kg must be"),
    ("a mass of NaN", lambda: session(tool=haptic.box(mass=NAN)), "link 0: mass nan kg must be"),
    ("a size of one number", lambda: haptic.box(1, 0.04), r"size must have 3 numbers, not the shape \(1,\)"),
    ("a size of two numbers", lambda: haptic.box(1, (0.04, 0.04)), r"size must have 3 numbers, not the shape \(2,\)"),
    ("a negative size", lambda: haptic.box(1, (0.04, -0.04, 0.04)), "edge -0.04 must be at least 0 m"),
    ("a negative radius", lambda: haptic.sphere(1, -0.05), "radius -0.05 must be at least 0 m"),
    ("no inertia", lambda: session(tool=haptic.box(1, (0, 0, 0))), "inertia .*must be"),
    ("a joint misspelt", lambda: haptic.box(joint="hinge"), "joint 'hinge' must be one of fixed, revolute"),
    ("a joint that is a list", lambda: haptic.box(joint=["free"]), r"joint \['free'\] must be one of fixed"),
    ("a joint's number that there is not", lambda: session(tool=link(joint=9)), "link 0: joint 9 must be 0 to 6"),
    ("a parent that comes after its child", lambda: session(tool=[box(), link(parent=2, joint=1), link(parent=0, joint=1)]),
     "link 1: parent 2 must be 0 to 0"),
    ("a root with a parent", lambda: session(tool=link(parent=0)), r"root's parent must be the world \(-1\)"),
    ("a second free joint", lambda: session(tool=[box(), link(parent=0)]), "only the root may have a free joint"),
    ("a link of zeros", lambda: session(tool=haptic.Link(parent=-1, joint=4, mass=1)), "quaternion must have length 1"),
    ("no links", lambda: haptic.Session(NOBODY, []), "link_count 0 must be 1 to 16"),
    ("17 links", lambda: session(tool=[box()] + [link(parent=0, joint=0)] * 16), "link_count 17 must be 1 to 16"),
    ("a tool that is a name", lambda: session(tool="peg"), "link 0 must be a haptic.Link, not 'p'"),
    ("a tool that is a number", lambda: session(tool=5), "links must be a list, each a haptic.Link, not 5"),
    ("the hand at a link that there is not", lambda: session(hand_link=3), "hand link 3 must be"),
    ("the hand at half a link", lambda: session(hand_link=0.5), "hand_link 0.5 must be a whole number"),
    # Options of a session.
    ("q of the wrong length", lambda: session(q=[0, 0, 0]), r"q must have 7 numbers, not the shape \(3,\)"),
    ("q that is a text", lambda: session(q="home"), r"q 'home' must be numbers in the shape \(7\,\)"),
    ("q that is ragged", lambda: session(q=[[0, 0, 0], [1, 0, 0, 0]]), r"q \[\[0, 0, 0\], \[1, 0, 0, 0\]\] must be numbers"),
    ("q that is a list of lists", lambda: session(q=[HERE]), r"q must have 7 numbers, not the shape \(1, 7\)"),
    ("q of NaN", lambda: session(q=[NAN] * 7), "configuration must be finite"),
    ("a q whose quaternion is none", lambda: session(q=np.zeros(7)), "quaternion of length 1"),
    ("a rate of 0", lambda: session(rate=0), "rate 0 Hz must be above 0"),
    ("a rate that is a text", lambda: session(rate="60"), "rate must be a number, not '60'"),
    ("a negative epsilon", lambda: session(epsilon=-0.005), "epsilon -0.005 m must be 0 to 1 m"),
    ("epsilon in millimetres", lambda: session(epsilon=5), "epsilon 5 m must be 0 to 1 m"),
    ("gravity as one number", lambda: session(gravity=-9.81), r"gravity must have 3 numbers, not the shape \(1,\)"),
    ("gravity in millimetres", lambda: session(gravity=(0, 0, -9810)), "gravity must be finite and within ±100 m/s²"),
    ("a length of 0", lambda: session(length=0), "length 0 m must be"),
    # Servers.
    ("a host without a port", lambda: session("localhost"), '"localhost" must be HOST:PORT'),
    ("port 0", lambda: session("127.0.0.1:0"), 'port "0" of "127.0.0.1:0" must be a number of 1 to 65535'),
    ("port 70000", lambda: session("127.0.0.1:70000"), 'port "70000" of .* must be a number of 1 to 65535'),
    ("an address of IPv6", lambda: session("[::1]:47800"), r'"\[::1\]'),
    ("a web address", lambda: session("http://127.0.0.1:47800"), '"http://127.0.0.1'),
    ("an unknown host", lambda: session("nowhere.invalid:47800"), '"nowhere.invalid"'),
    ("a server that is a tuple", lambda: session(("127.0.0.1", 47800)), r"server \('127.0.0.1', 47800\) must be a text"),
    ("a tool in place of the server", lambda: haptic.Session(box()), "server <haptic.*Link.*> must be a text"),
    ("a server with a zero in its name", lambda: session(NOBODY + "\0"), "server .* must be a text"),
    ("a key file that is missing", lambda: session(key_file="/nowhere/key"), "key file /nowhere/key: No such file"),
    ("a key file that is a folder", lambda: session(key_file="/"), "key file /: is not a regular file"),
    ("a key file that others may read", with_key(b"", 0o644), "key file .*mode 0644.*chmod 600"),
    ("a key file that is empty", with_key(b""), "key file .* is no key: it must have"),
    ("a key file that is a number", lambda: session(key_file=5), "key_file 5 must be a text"),
    # Order.
    ("send() before sample()", lambda: session().send(haptic.contacts(0)), "before the first send there must be a sample"),
    ("sample() after close()", closed(lambda touch: touch.sample(HERE, STILL, PERIOD)), "the session is closed"),
    ("steps() after close()", closed(lambda touch: touch.steps(PERIOD)), "the session is closed"),
    ("show() after close()", closed(lambda touch: touch.show()), "the session is closed"),
    ("poll() after a fork", after_fork(lambda touch: touch.poll()), "process that was forked"),
    ("sample() after a fork", after_fork(lambda touch: touch.sample(HERE, STILL, PERIOD)), "process that was forked"),
    ("send() after a fork", after_fork(lambda touch: touch.send()), "process that was forked"),
    ("two threads at once", from_two_threads, "another thread is in a call of the session: one at a time"),
    # The loop.
    ("steps of 0", with_session(lambda touch: touch.steps(0)), "step 0 s must be above 0"),
    ("steps of a text", with_session(lambda touch: touch.steps("2 ms")), "step must be a number, not '2 ms'"),
    ("impulses of a period of 0", with_session(lambda touch: touch.impulses(0)), "period 0 s must be above 0"),
    ("impulses of None", with_session(lambda touch: touch.impulses(None)), "period must be a number, not None"),
    ("a sample of a period of NaN", with_session(lambda touch: touch.sample(HERE, STILL, NAN)), "period nan s must be above 0"),
    ("a sample whose v is as long as q", with_session(lambda touch: touch.sample(HERE, np.zeros(7), PERIOD)),
     r"v must have 6 numbers, not the shape \(7,\)"),
    ("a sample of NaN", with_session(lambda touch: touch.sample([0, 0, NAN, 1, 0, 0, 0], STILL, PERIOD)),
     r"q\[2\] nan must be finite"),
    ("a sample of None", with_session(lambda touch: touch.sample(None, STILL, PERIOD)), "q must have 7 numbers"),
    ("a wrench of a text", with_session(lambda touch: touch.external_wrench("push")), "wrench 'push' must be numbers"),
    ("a wrench on half a link", with_session(lambda touch: touch.external_wrench(STILL, 0.5)), "link 0.5 must be a whole"),
    # Contacts, bodies, poses.
    ("a negative count", lambda: haptic.contacts(-1), "count -1 must be a whole number"),
    ("half a count", lambda: haptic.bodies(0.5), "count 0.5 must be a whole number"),
    ("contacts that are a list", with_session(lambda touch: touch.send([1])), r"contacts must be a contiguous .*, not \[1\]"),
    ("contacts of 32 bit", with_session(lambda touch: touch.send(np.zeros((4, 3), "f4"))), r"not an array of float32 of shape \(4, 3\)"),
    ("contacts with gaps", with_session(lambda touch: touch.send(haptic.contacts(4)[::2])), "not an array of .* with gaps"),
    ("bodies in place of contacts", with_session(lambda touch: touch.track(haptic.bodies(1))), "contacts must be a contiguous"),
    ("too many contacts", sent(193), "193 contacts must be at most 192"),
    ("a normal of 0", sent(normal=(0, 0, 0)), "contact 0: normal .* must be of length 1"),
    ("a contact of NaN", sent(separation=NAN), "contact 0: .*nan"),
    ("a contact with the tool as side b", sent(a_kind=haptic.WORLD, b_kind=TOOL), "tool must be side a"),
    ("a contact of a link that there is not", sent(a_index=1), "side a: link 1 must be less than 1"),
    ("one identity twice", sent(2, identity=7), "contact 1: identity 7 is that of an earlier contact"),
    ("a contact in millimetres", sent(point=(0, 0, 40000)), "are lengths in metres"),
    ("too many bodies", sent_bodies(17), "17 bodies must be at most 16"),
    ("one body twice", sent_bodies(2, id=7), "body 7: its id is that of an earlier body"),
    ("a body with negative inertia", sent_bodies(inverse_inertia=-np.eye(6)), "body 0: the diagonal of its inverse inertia must be >= 0"),
    ("poses before offer()", sent_poses([]), "pose of body 0: no shape of it was offered"),
    ("a pose of a body that there is not", sent_poses([BALL], body=9), "pose of body 9: no shape of it was offered"),
    ("two poses of one body", sent_poses([BALL, haptic.shapes.sphere(1, BODY, 7)], 2, body=7),
     "pose of body 7: it has an earlier one"),
    ("a pose without a rotation", sent_poses([BALL, haptic.shapes.sphere(1, BODY, 7)], body=7, rotation=0),
     "pose of body 7: its rotation must be of length 1, not 0"),
    # Shapes.
    ("a kind misspelt", lambda: haptic.shapes.shape("cube", (1, 1, 1)), "kind 'cube' must be one of sphere, capsule"),
    ("a size too many", lambda: haptic.shapes.shape("sphere", (1, 1, 1)), r"size of a sphere must have 1 numbers, not the shape \(3,\)"),
    ("a size too few", lambda: haptic.shapes.box((1, 1)), r"size of a box must have 3 numbers, not the shape \(2,\)"),
    ("a size of 0", offered([haptic.shapes.sphere(0, TOOL)]), "shape 0: .*size 0 m must be above 0"),
    ("a negative size of a shape", offered([haptic.shapes.box((1, -1, 1), TOOL)]), "shape 0: .*size -1 m must be above 0"),
    ("a radius that is a text", lambda: haptic.shapes.sphere("big"), "size of a sphere .*'big'.* must be numbers"),
    ("a side that there is not", lambda: haptic.shapes.sphere(1, 3), "side 3 must be a whole number of 0 to 2"),
    ("a body of a negative number", lambda: haptic.shapes.sphere(1, BODY, -1), "index -1 must be a whole number of 0"),
    ("vertices in one row", lambda: haptic.shapes.shape("hull", vertices=[0, 0, 0, 1]), r"vertices: shape \(4,\) must be \(n, 3\)"),
    ("vertices of NaN", offered([haptic.shapes.shape("hull", side=TOOL, vertices=np.full((4, 3), NAN))]), "shape 0: .*nan"),
    ("a hull of 3 points", offered([haptic.shapes.shape("hull", side=TOOL, vertices=np.eye(3))]), "shape 0: .*3 points; at least 4"),
    ("a mesh without triangles", offered([BALL, haptic.shapes.shape("mesh", vertices=np.eye(3))]), "shape 1: .*triangles"),
    ("a corner that there is not", offered([BALL, haptic.shapes.shape("mesh", vertices=np.eye(3), triangles=[[1, 2, 3]])]),
     "shape 1: .*corner 3 of a triangle must be below 3"),
    ("a negative corner", lambda: haptic.shapes.shape("mesh", vertices=np.eye(3), triangles=[[0, 1, -1]]),
     r"triangles \[\[0, 1, -1\]\] must be whole numbers of 0 to"),
    ("negative corners in an array", lambda: haptic.shapes.shape("mesh", vertices=np.eye(3), triangles=np.array([[0, 1, -1]])),
     "triangles an array of int64 .* must be whole numbers of 0 to"),
    ("half a corner", lambda: haptic.shapes.shape("mesh", vertices=np.eye(3), triangles=[[0, 1, 1.5]]), "triangles .* must be whole numbers"),
    ("a tool without shapes", offered([haptic.shapes.half_space()]), "a shape must be of the tool"),
    ("no shapes", offered([]), "a shape must be of the tool"),
    ("a half-space of the tool", offered([haptic.shapes.shape("half_space", side=TOOL)]), "shape 0: .*half.space"),
    ("a shape of a link that there is not", offered([haptic.shapes.sphere(1, TOOL, 2)]), "shape 0: .*link 2"),
    ("one shape in place of a list", offered(BALL), "shapes must be a list, each a haptic.Shape, not"),
    ("shapes that are names", offered(["ball"]), "shape 0 must be a haptic.Shape, not 'ball'"),
    ("positions of another count", offered([BALL], [[0, 0, 0]] * 2), r"positions: shape \(2, 3\) must be \(1, 3\), one row for each"),
    ("a rotation that is none", offered([BALL], rotations=[[0, 0, 0, 0]]), "shape 0: .*rotation|shape 0: .*quaternion"),
    ("a friction that is a text", offered([BALL], friction=["ice"]), r"friction \['ice'\] must be numbers"),
    ("a friction of NaN", offered([BALL], friction=[NAN]), "shape 0: .*friction nan must be"),
    ("half a priority", offered([BALL], priority=[0.5]), r"priority \[0.5\] must be whole numbers of 0 to 255"),
    ("a priority of 300", offered([BALL], priority=[300]), r"priority \[300\] must be whole numbers of 0 to 255"),
    ("a rule that there is not", offered([BALL], rule=3), "rule 3 must be one of average, minimum"),
    ("an excluded pair of one", offered([BALL], excluded=[(0,)]), r"excluded: shape \(1, 1\) must be \(n, 2\)"),
    ("an excluded shape that there is not", offered([BALL], excluded=[(0, 5)]), "apart.*5|5.*apart"),
    ("a negative excluded shape", offered([BALL], excluded=[(0, -1)]), r"excluded \[\(0, -1\)\] must be whole numbers"),
    # The hand and the page.
    ("hold() at infinity", with_session(lambda touch: touch.hold((INF, 0, 0))), "position of the hand inf m must be"),
    ("hold() at a text", with_session(lambda touch: touch.hold("up")), "position 'up' must be numbers"),
    ("hold() without a rotation", with_session(lambda touch: touch.hold((0, 0, 0), (0, 0, 0, 0))), "rotation of the hand must be of length 1"),
    ("show() at a port that is taken", on_a_taken_port, "no page: .*in use"),
    ("show() at port 70000", with_session(lambda touch: touch.show(70000)), "port 70000 must be a whole number of 0 to 65535"),
    ("show() at port -1", with_session(lambda touch: touch.show(-1)), "port -1 must be a whole number"),
    ("show() at a text", with_session(lambda touch: touch.show("8080")), "port '8080' must be a whole number"),
    # The environment.
    ("HAPTIC_LIBRARY is a folder", in_environment(session, HAPTIC_LIBRARY="/tmp"), "libhaptic is not found; .*HAPTIC_LIBRARY.*/tmp"),
    ("HAPTIC_LIBRARY is another library", in_environment(session, HAPTIC_LIBRARY="libm.so.6"),
     r"libm.so.6 has no haptic_abi\(\): it is another library, or older"),
    ("HAPTIC_SERVER_PROGRAM is a folder", in_environment(
        lambda: haptic.Session(), HAPTIC_SERVER=NOBODY, HAPTIC_SERVER_PROGRAM="/tmp"),
     "there is no haptic_server to start: looked for /tmp"),
    ("HAPTIC_SERVER_PROGRAM is another program", in_environment(
        message_of_own, HAPTIC_SERVER=NOBODY, HAPTIC_SERVER_PROGRAM="/bin/false"),
     "the server that this session started has ended, with status 1: its reason, if it gave one, is on standard error"),
    ("HAPTIC_PAGE_PROGRAM is a folder", in_environment(lambda: session().show(), HAPTIC_PAGE_PROGRAM="/tmp"),
     "there is no haptic_page to start: looked for /tmp"),
    ("HAPTIC_PAGE_PROGRAM is another program", in_environment(lambda: session().show(), HAPTIC_PAGE_PROGRAM="/bin/true"),
     "no page: haptic_page has ended"),
    ("HAPTIC_SERVER is none", in_environment(lambda: haptic.Session(), HAPTIC_SERVER="here"), '"here" must be HOST:PORT'),
    # MuJoCo.
    ("a tool by a number that there is not", of_mujoco(99), "tool 99 must be the name of a body, or a number from 1 to"),
    ("a body that there is not", of_mujoco("pge"), "the model has no body 'pge'"),
    ("a tool without a free joint", of_mujoco("brick"), "body 'brick' must have a free joint"),
    ("a mocap body as tool", of_mujoco("mocap"), "body 'mocap' must have a free joint"),
    ("contacts misspelt", of_mujoco(contacts="shape"), "contacts 'shape' must be 'engine' or 'shapes'"),
    ("a period of 0", of_mujoco(period=0), "period 0 must be 1e-05 to 100 s"),
    ("MuJoCo's epsilon in millimetres", of_mujoco(epsilon=5), "epsilon 5 must be 0 to 1 m"),
    ("a model in place of data", of_mujoco(data=types.SimpleNamespace(nq=7)), "data must be of this model: it has 0 rows in qpos"),
    ("data of another model", of_mujoco(data=types.SimpleNamespace(qpos=np.zeros(14))),
     "data must be of this model: it has 14 rows in qpos, not the model's nq, 7"),
]


class C:
    """The C interface as C sees it: no types are checked."""

    def __init__(self):
        self.library = ctypes.CDLL(str(LIBRARY))
        for library, function, result in (
                (self.library, "default_options", _library.Options), (self.library, "open", ctypes.c_void_p),
                (self.library, "show", ctypes.c_char_p), (self.library, "own_server", ctypes.c_char_p),
                (self.library, "send", ctypes.c_int64), (self.library, "take_impulses", ctypes.c_size_t),
                (self.library, "error", ctypes.c_char_p), (self.library, "box", haptic.Link)):
            getattr(library, "haptic_" + function).restype = result
        self.session = None

    def __getattr__(self, name):
        return getattr(self.library, "haptic_" + name)

    def opened(self, **options):
        """Why a session with such options is not opened."""
        given, error = self.default_options(), ctypes.create_string_buffer(512)
        given.server = NOBODY.encode()
        for name, value in options.items():
            setattr(given, name, value)
        self.session = ctypes.c_void_p(self.open(ctypes.byref(given), error, ctypes.c_size_t(len(error))))
        return error.value.decode()

    def told(self, result, refusal=-1):
        """What haptic_error() says of a call that returned that."""
        assert result == refusal, f"it returned {result}, not {refusal}"
        return self.error(self.session).decode()


def in_c(use):
    """A use of a session that is open, or what it says."""
    def run():
        c = C()
        c.opened()
        raise haptic.HapticError(use(c))
    return run


def of_null(use, refusal=-1):
    """A use of no session."""
    def run():
        c = C()
        raise haptic.HapticError(c.told(use(c), refusal))
    return run


def called(use, refusal=-1):
    return in_c(lambda c: c.told(use(c), refusal))


def quietly(use):
    """What returns nothing, and shall not crash."""
    def run():
        c = C()
        c.opened()
        use(c)
        raise haptic.HapticError("nothing")
    return run


def polled(c):
    state = _library.State()
    c.poll(None, ctypes.byref(state))
    return state.message.decode()


SIX, SEVEN, NULL = (ctypes.c_double * 6)(), (ctypes.c_double * 7)(), None
STEP, NO_STEP = ctypes.c_double(PERIOD), ctypes.c_double(0)
MANY, TWO, NONE = ctypes.c_size_t(2**63), ctypes.c_size_t(2), ctypes.c_size_t(0)
RECORDS = ctypes.create_string_buffer(4096)
SHAPES = (haptic.shapes.Shape * 2)(BALL, BALL)
NO_SESSION = "session must not be NULL"

def open_without(options, size):
    """What is written where the room for an error is `size`."""
    def run():
        c = C()
        error = ctypes.create_string_buffer(b"untouched")
        assert c.open(options, error, ctypes.c_size_t(size)) is None
        raise haptic.HapticError(error.value.decode() or "nothing")
    return run


IN_C = [
    ("options NULL", open_without(NULL, 10), "options m"),
    ("options NULL and no room for an error", open_without(NULL, 0), "untouched"),
    ("options NULL and room for no letter", open_without(NULL, 1), "nothing"),
    ("options NULL and an error NULL", quietly(lambda c: c.open(NULL, NULL, MANY)), "nothing"),
    ("links NULL", in_c(lambda c: c.opened(links=None)), "links must not be NULL"),
    ("too many links", in_c(lambda c: c.opened(link_count=2**63)), "link_count 9223372036854775808 must be 1 to 16"),
    ("an epsilon of NaN", in_c(lambda c: c.opened(epsilon=NAN)), "epsilon nan m must be 0 to 1 m"),
    ("a box without a size", in_c(lambda c: c.opened(links=ctypes.pointer(c.box(ctypes.c_double(1), NULL)))), "inertia"),
    ("a poll of no session", lambda: (_ for _ in ()).throw(haptic.HapticError(polled(C()))), NO_SESSION),
    ("a poll to nowhere", called(lambda c: c.poll(c.session, NULL) and 0, 0), "state must not be NULL"),
    ("steps of no session", of_null(lambda c: c.take_steps(NULL, STEP)), NO_SESSION),
    ("a sample of no session", of_null(lambda c: c.sample(NULL, SEVEN, SIX, STEP)), NO_SESSION),
    ("sending without a session", of_null(lambda c: c.send(NULL, NULL, NONE, NULL, NONE)), NO_SESSION),
    ("an offer without a session", of_null(lambda c: c.offer(NULL, NULL, NULL, NULL, NONE, NULL, NONE, NULL, NONE)), NO_SESSION),
    ("a place without a session", of_null(lambda c: c.place(NULL, NULL, NONE)), NO_SESSION),
    ("a wrench without a session", of_null(lambda c: c.external_wrench(NULL, 0, SIX)), NO_SESSION),
    ("a hold without a session", of_null(lambda c: c.hold(NULL, SIX, SIX)), NO_SESSION),
    ("impulses without a session", of_null(lambda c: c.take_impulses(NULL, STEP, RECORDS), 0), NO_SESSION),
    ("a page without a session", of_null(lambda c: c.show(NULL, 0, 0), None), NO_SESSION),
    ("a server without a session", of_null(lambda c: c.own_server(NULL), b""), NO_SESSION),
    ("what returns nothing without a session",
     quietly(lambda c: (c.track(NULL, NULL, TWO, NULL, TWO), c.release(NULL), c.close(NULL), c.poll(NULL, NULL))), "nothing"),
    ("q NULL", called(lambda c: c.sample(c.session, NULL, SIX, STEP)), "q must not be NULL"),
    ("v NULL", called(lambda c: c.sample(c.session, SEVEN, NULL, STEP)), "v must not be NULL"),
    ("contacts NULL", called(lambda c: c.send(c.session, NULL, TWO, NULL, NONE)), "2 contacts must not be NULL"),
    ("bodies NULL", called(lambda c: c.send(c.session, NULL, NONE, NULL, TWO)), "2 bodies must not be NULL"),
    ("a count of contacts too large", called(lambda c: c.send(c.session, RECORDS, MANY, NULL, NONE)),
     "9223372036854775808 contacts must be at most 192"),
    ("tracked contacts NULL", called(lambda c: c.track(c.session, NULL, TWO, NULL, NONE) and 0, 0), "2 contacts must not be NULL"),
    ("a count of bodies too large", called(lambda c: c.track(c.session, NULL, NONE, RECORDS, MANY) and 0, 0), "bodies must be at most 16"),
    ("poses NULL", called(lambda c: c.place(c.session, NULL, TWO)), "2 poses must not be NULL"),
    ("a count of poses too large", called(lambda c: c.place(c.session, RECORDS, MANY)), "poses must be at most 64"),
    ("shapes NULL", called(lambda c: c.offer(c.session, NULL, RECORDS, NULL, TWO, NULL, NONE, NULL, NONE)), "2 shapes must not be NULL"),
    ("poses of shapes NULL", called(lambda c: c.offer(c.session, SHAPES, NULL, NULL, TWO, NULL, NONE, NULL, NONE)), "2 poses of shapes must not be NULL"),
    ("excluded pairs NULL", called(lambda c: c.offer(c.session, SHAPES, RECORDS, NULL, TWO, NULL, TWO, NULL, NONE)), "2 excluded pairs must not be NULL"),
    ("dynamics NULL", called(lambda c: c.offer(c.session, SHAPES, RECORDS, NULL, NONE, NULL, NONE, NULL, TWO)), "2 dynamics of bodies must not be NULL"),
    ("held bodies NULL", called(lambda c: c.take_held(c.session, NULL), 0), "bodies must not be NULL"),
    ("held bodies without a session", of_null(lambda c: c.take_held(NULL, RECORDS), 0), NO_SESSION),
    ("a count of shapes too large", called(lambda c: c.offer(c.session, SHAPES, RECORDS, NULL, MANY, NULL, NONE, NULL, NONE)), "shapes must be at most 20000"),
    ("a count of vertices too large", called(lambda c: c.offer(
        c.session, ctypes.byref(haptic.shapes.Shape(kind=5, side=1, vertex_count=2**32 - 1, vertices=ctypes.addressof(RECORDS))),
        RECORDS, NULL, ctypes.c_size_t(1), NULL, NONE, NULL, NONE)), "shape 0: 4294967295 vertices must be at most 50000"),
    ("a kind of shape that there is not", called(lambda c: c.offer(
        c.session, ctypes.byref(haptic.shapes.Shape(kind=8)), RECORDS, NULL, ctypes.c_size_t(1), NULL, NONE, NULL, NONE)), "shape 0: kind 8 must be 0 to 7"),
    ("a wrench NULL", called(lambda c: c.external_wrench(c.session, 0, NULL)), "wrench must not be NULL"),
    ("a position NULL", called(lambda c: c.hold(c.session, NULL, SIX)), "position of the hand must not be NULL"),
    ("impulses NULL", called(lambda c: c.take_impulses(c.session, STEP, NULL), 0), "impulses must not be NULL"),
    ("impulses of no time", called(lambda c: c.take_impulses(c.session, NO_STEP, RECORDS), 0), "period 0 s must be above 0"),
]


def error_of(use):
    """The one line, with the kind of what was raised."""
    try:
        use()
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return "nothing was said"


def end_of(use):
    """error_of() in a process of its own, as it may crash or wait."""
    inlet, outlet = os.pipe()
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        os.write(outlet, error_of(use).encode())
        os._exit(0)
    os.close(outlet)
    with open(inlet, encoding="utf-8") as pipe:
        said = pipe.read() if select.select([pipe], [], [], PATIENCE)[0] else "it waits"
    if said == "it waits":
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return said or f"it ended with status {status}"


class WrongUses(unittest.TestCase):
    def refuse(self, table):
        for what, use, expected in table:
            with self.subTest(what):
                said = end_of(use)
                self.assertRegex(said, f"^(HapticError|OSError): .*({expected})")
                self.assertNotIn("\n", said)
                self.assertLess(len(said), LONGEST)

    def test_each_in_python_gets_one_clear_line(self):
        self.refuse(PYTHON)

    def test_each_in_c_gets_one_clear_line(self):
        self.refuse(IN_C)

    def test_a_field_of_a_link_that_is_misspelt_is_an_error(self):
        with self.assertRaisesRegex(AttributeError, "masss"):
            box().masss = 1

    def test_no_row_is_there_twice(self):
        names = [what for what, _, _ in PYTHON + IN_C]
        self.assertEqual(len(set(names)), len(names))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
