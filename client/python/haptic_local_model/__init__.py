"""Touch a simulated world with a haptic device.

    import haptic_local_model as haptic

    with haptic.Session(tool=haptic.box(mass=0.1, size=(0.04, 0.04, 0.04))) as touch:
        while touch.poll():                        # False once the program is to end
            q, v = touch.q, touch.v                # of the proxy: move the tool there
            step(period)                           # your engine
            touch.sample(q, v, period)             # where the tool is now
            contacts = haptic.contacts(4)          # a numpy array of records, see CONTACT
            contacts["point"], contacts["normal"], contacts["separation"] = ...
            touch.send(touch.track(contacts))

SI units, world axes. No call waits for the network; there are no threads. Needs numpy and the
library libhaptic.so, which is found next to this package, where HAPTIC_LIBRARY names it, or where the
system keeps its libraries. A session is used by one thread at a time, in the process that made it. What is given wrongly
raises HapticError, whose text is one line that names it, its value and what is allowed.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import sys
import types
from typing import Any, Mapping, NoReturn, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

from haptic_local_model import _arguments, _interrupt
from haptic_local_model._arguments import HapticError
from haptic_local_model._episodes import Episode, open_episode
from haptic_local_model._frame import frame_of
from haptic_local_model._library import (ABI, MAX_BODIES, MAX_CONFIGURATION, MAX_CONTACTS, MAX_DOF, MAX_POSES, NO_LIMIT, Curve, Drive,
                             Impulse, Link, Options, Shape, State, load, load_virtual)

__all__ = ["BODY", "CONTACT", "Curve", "DYNAMICS", "Drive", "Episode", "FRICTION_RULES", "HELD", "HapticError", "JOINTS", "Link", "MAX_BODIES", "MAX_CONTACTS", "MAX_POSES", "MOVABLE_BODY", "NO_BODY", "NO_LIMIT", "POSE", "NOT_ROUND", "ROUND_ABOUT_AXIS",
           "SERVER_STATES", "SPHERE", "Session", "TOOL_LINK", "WORLD", "bodies", "box", "contacts", "dynamics", "poses", "sphere"]

__version__ = "0.4.0"
_MODULES = ("dataset", "demo", "drake", "isaacteleop", "mujoco", "newton", "pybullet", "robosuite", "shapes", "studio", "virtual")
WORLD, TOOL_LINK, MOVABLE_BODY = 0, 1, 2
NO_BODY = 2**32 - 1  #: The parent of what hangs on the world.
NOT_ROUND, ROUND_ABOUT_AXIS, SPHERE = 0, 1, 2
JOINTS = {"fixed": 0, "revolute": 1, "prismatic": 2, "planar": 3, "free": 4, "guided": 5, "following": 6}
#: The mean of two coefficients (as Rapier, PhysX), the smaller, their product (Bullet), the larger one (MuJoCo).
FRICTION_RULES = ("average", "minimum", "product", "maximum")
_MATERIAL = np.dtype([("friction", "f8"), ("rule", "i4"), ("priority", "i4")])
SERVER_STATES = ("off", "active", "fading", "fault", "arming", "ramping")


def __getattr__(name: str) -> types.ModuleType:
    """haptic.shapes, haptic.mujoco and the like are imported when they are first used."""
    if name in _MODULES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")


#: A contact: from side b to side a, which is the tool if that takes part.
CONTACT = np.dtype([
    ("identity", "u8"),     # the same from frame to frame; Session.track() sets it
    ("pair", "u4"),         # which two convex pieces, 0 if the engine does not say
    ("axis", "u2"),
    ("a_kind", "u1"), ("b_kind", "u1"),     # WORLD, TOOL_LINK or MOVABLE_BODY
    ("a_index", "u4"), ("b_index", "u4"),   # of the link; of a body, your own number for it
    ("point", "f8", 3),     # on the surface of b, m
    ("normal", "f8", 3),    # unit, from b to a
    ("separation", "f8"),   # true distance, m; negative: they overlap
    ("velocity", "f8", 3),  # of b's point, m/s
    ("friction", "f8"),     # above 10 as 10; negative: the server's own
    ("load", "f8"),         # normal force of a contact without the tool, N
    ("plane", "u4"),        # 1: a flat face of a on a corner or an edge of b; 0: a face of b, or of neither
], align=True)

#: A body that the tool can push.
BODY = np.dtype([
    ("id", "u4"),
    ("round", "u4"),                     # NOT_ROUND, or ROUND_ABOUT_AXIS, SPHERE: of the shape
    ("centre", "f8", 3),                 # of mass, m
    ("velocity", "f8", 6),               # linear, angular
    ("inverse_inertia", "f8", (6, 6)),   # about the centre of mass, what the joints leave
    ("acceleration", "f8", 6),           # by all forces except contacts
    ("axis", "f8", 3),                   # of a body that is round about it: unit, through its centre
], align=True)


#: Where a body is whose shapes were offered: its frame, and that frame's velocity.
POSE = np.dtype([
    ("body", "u4"),
    ("kept", "u4"),          # 1: nobody else may move it, as when it was reset: the hand lets go of it
    ("position", "f8", 3),   # m
    ("rotation", "f8", 4),   # w, x, y, z
    ("velocity", "f8", 6),   # linear, angular, world axes
], align=True)

#: Where the server has a body: its frame, and that frame's velocity.
HELD = np.dtype([
    ("body", "u4"),
    ("let_go", "u4"),        # 1: for the last time
    ("position", "f8", 3),
    ("rotation", "f8", 4),
    ("velocity", "f8", 6),
    ("q", "f8"), ("v", "f8"),   # of its joint, if it hangs on one
], align=True)

#: What the server must know of a body to move it while the hand holds it: its inertia, and the joint that it hangs on, if any.
DYNAMICS = np.dtype([
    ("body", "u4"),
    ("joint", "i4"),              # of JOINTS: "free", or "revolute" or "prismatic" with what follows below `angular_damping`
    ("mass", "f8"),               # kg
    ("centre", "f8", 3),          # of mass, in the body's frame, m
    ("inertia", "f8", (3, 3)),    # about the centre of mass, body's axes, kg m²
    ("gravity", "f8", 3),         # what its weight accelerates it by, world axes, m/s²
    ("damping", "f8"),            # of its velocity, 1/s,
    ("angular_damping", "f8"),    # and of its angular velocity; of a free body without others on it
    ("parent", "u4"),             # the body that it hangs on, also one of these; NO_BODY: the world
    ("reserved", "u4"),
    ("place_in_parent", "f8", 3), ("turn_in_parent", "f8", 4),  # the joint's frame in the parent's, or in the world,
    ("place_in_body", "f8", 3), ("turn_in_body", "f8", 4),      # and in the body's; q is 0 where both lie on each other
    ("axis", "f8", 3),            # of growing q, unit, in the joint's frame
    ("lower", "f8"), ("upper", "f8"),  # limits of q, rad or m; NO_LIMIT: none
    ("stiffness", "f8"),          # of a spring, N/m or N m/rad,
    ("reference", "f8"),          # which is at rest at this q
    ("joint_damping", "f8"),      # N s/m or N m s/rad
    ("friction", "f8"),           # largest dry friction, N or N m
    ("armature", "f8"),           # inertia of a motor in it, kg or kg m²
], align=True)


def contacts(count: int) -> np.ndarray:
    """`count` contacts of the tool's first link with the world, all else zero, friction the server's."""
    made = np.zeros(_arguments.integer(count, "count"), CONTACT)
    made["a_kind"] = TOOL_LINK
    made["friction"] = -1
    return made


def bodies(count: int) -> np.ndarray:
    """`count` bodies, all zero: fill in the fields of BODY. id: as in contacts, shapes and poses."""
    return np.zeros(_arguments.integer(count, "count"), BODY)


def dynamics(count: int) -> np.ndarray:
    """`count` free bodies of no mass yet: fill in the fields of DYNAMICS."""
    made = np.zeros(_arguments.integer(count, "count"), DYNAMICS)
    made["joint"], made["parent"] = JOINTS["free"], NO_BODY
    made["turn_in_parent"][:, 0] = made["turn_in_body"][:, 0] = made["axis"][:, 2] = 1
    made["lower"], made["upper"] = -NO_LIMIT, NO_LIMIT
    return made


def poses(count: int) -> np.ndarray:
    """`count` poses at the origin."""
    made = np.zeros(_arguments.integer(count, "count"), POSE)
    made["rotation"][:, 0] = 1
    return made


def _link(mass: float, inertia: Sequence[float], joint: str) -> Link:
    link = Link(parent=-1, joint=JOINTS[_arguments.choice(joint, JOINTS, "joint")], mass=mass, lower=-NO_LIMIT, upper=NO_LIMIT)
    link.rotation[0] = link.axis[2] = 1
    for i, value in enumerate(inertia):
        link.inertia[4 * i] = value
    return link


def box(mass: float = 1, size: Sequence[float] = (0.1, 0.1, 0.1), joint: str = "free") -> Link:
    """A solid box (kg, edge lengths in m) about its centre, as the root of a tool."""
    mass = _arguments.number(mass, "mass")
    edges = [_arguments.number(edge, "edge", 0, unit="m") for edge in _arguments.array(size, (3,), "size")]
    x, y, z = (edge * edge * mass / 12 for edge in edges)
    return _link(mass, (y + z, z + x, x + y), joint)


def sphere(mass: float = 1, radius: float = 0.05, joint: str = "free") -> Link:
    """A solid sphere (kg, m) about its centre, as the root of a tool."""
    mass, radius = _arguments.number(mass, "mass"), _arguments.number(radius, "radius", 0, unit="m")
    return _link(mass, (0.4 * mass * radius * radius,) * 3, joint)


def _coordinates(links: Sequence[Link]) -> int:
    """Length of q. The library names a joint that there is not, and links that are too many."""
    count = sum({1: 1, 2: 1, 3: 3, 4: 7, 5: 1}.get(link.joint, 0) for link in links[:MAX_DOF]) if links else 7
    return min(count, MAX_CONFIGURATION)


class Session:
    """One client of a haptic server. It keeps asking until a server answers, and after one is gone.

    server: "HOST:PORT". Without it, what HAPTIC_SERVER names or 127.0.0.1:47800; and where none listens there and
    start_server allows it, one with a simulated device is started at a free port, for this session alone. It ends with the
    session, with the program, or with the thread that made the session, which should last. hold() is its hand. It records to the file
    that HAPTIC_RECORD names, if it does.

    tool: the root link, or all links, parents before children. curves: of its guided and following links. q: where the tool is now (default: all
    zero, quaternion w = 1). rate: of your steps, Hz. epsilon: contacts are sent from this separation
    on, m, 0 to 1. In a `with` statement Ctrl-C sets `running` to False; the second one raises KeyboardInterrupt. Raises HapticError where something cannot be used or there is no haptic_server to
    start, OSError where there is no library.
    """

    def __init__(self, server: Optional[str] = None, tool: Link | Sequence[Link] | None = None, *, curves: Sequence[Curve] = (),
                 q: Optional[ArrayLike] = None, key_file: Optional[str] = None, rate: float = 60,
                 epsilon: float = 0.005, length: Optional[float] = None,
                 gravity: Sequence[float] = (0, 0, 0), hand_link: int = 0, clears_fault: bool = True,
                 start_server: bool = True):
        self._session: Optional[ctypes.c_void_p] = None
        self.current_episode: Optional[Episode] = None            #: The episode that is open.
        named = os.environ.get("HAPTIC_SERVER") if server is None else server
        self._library = load_virtual() if str(named).startswith("virtual:") else load()
        options = self._library.haptic_default_options()
        links = [tool] if isinstance(tool, Link) else _arguments.items(() if tool is None else tool, Link, "link")
        if tool is not None:
            kept = (Link * len(links))(*links)
            options.links, options.link_count = kept, len(links)
        guides = _arguments.items(curves, Curve, "curve")
        kept_curves = (Curve * len(guides))(*guides)
        options.curves, options.curve_count = kept_curves, len(guides)
        count = _coordinates(links)
        start = np.zeros(count)
        if not links or links[0].joint == JOINTS["free"]:
            start[3] = 1
        if q is not None:
            start = _arguments.array(q, (count,), "q").copy()
        options.q[:count] = start
        if server is None and not start_server:
            server = os.environ.get("HAPTIC_SERVER") or "127.0.0.1:47800"
        options.server = _arguments.text(server, "server") if server is not None else None
        options.key_file = _arguments.text(key_file, "key_file") if key_file is not None else None
        options.rate, options.epsilon = _arguments.number(rate, "rate"), _arguments.number(epsilon, "epsilon")
        options.gravity[:] = _arguments.array(gravity, (3,), "gravity")
        options.hand_link = _arguments.integer(hand_link, "hand_link", 0, MAX_DOF)
        options.clears_fault = bool(clears_fault)
        if length is not None:
            options.length = _arguments.number(length, "length")
        error = ctypes.create_string_buffer(512)
        self._process = os.getpid()
        self._session = self._library.haptic_open(ctypes.byref(options), error, len(error))
        if not self._session:
            raise HapticError(_text(error.value))
        if started := self._library.haptic_own_server(self._session):
            _tell("haptic: " + _text(started))
        self._state = State()
        self._q_now = np.frombuffer(self._state.q)[:count]
        self._address = ctypes.addressof(self._state)
        self._impulses = (Impulse * MAX_BODIES)()
        self._held = np.zeros(MAX_POSES, HELD)
        v_count = count - 1 if count and (not links or links[0].joint == JOINTS["free"]) else count
        self._v_now = np.frombuffer(self._state.v)[:v_count]
        self._q_shape, self._v_shape = self._q_now.shape, self._v_now.shape
        self.q: np.ndarray = start                         #: Of the proxy: move the tool there.
        self.v: np.ndarray = np.zeros(v_count)             #: Its velocity.
        self.running = True                                #: Set to False to end `while touch.poll()`.

    def __enter__(self) -> "Session":
        _interrupt.watch(self)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a session cannot be copied")

    def close(self) -> None:
        """Says goodbye, and ends a server that the session started. What follows raises HapticError."""
        _interrupt.forget(self)
        if self.current_episode is not None:
            self.current_episode.close()
        if self._session:
            self._library.haptic_close(self._session)
        self._session = None
        self.running = False

    def show(self, port: int = 0, open_browser: bool = True) -> str:
        """Serves the page of this session to browsers of this machine, with the shapes that were offered, contacts, forces
        and charts; the mouse is the hand of a simulated device. It ends with the session. port: 0 is any free one. Returns
        its address, which is also said on standard error; a second call says it again. With a key the page asks for a token,
        which that address has: no browser is opened, and whoever reads it can move the tool. Raises HapticError where there
        can be none."""
        port = _arguments.integer(port, "port", 0, 65535)
        address = self._library.haptic_show(self._open(), port, bool(open_browser))
        if address is None:
            self._fail()
        _tell("haptic: the page of this session is " + _text(address))
        return _text(address)

    def _repr_html_(self) -> Optional[str]:
        """The page of the session, where it is the last line of a notebook's cell."""
        return frame_of(self.show(open_browser=False)) if self._session else None

    def offer(self, shapes: Sequence[Shape], positions: Optional[ArrayLike] = None,
              rotations: Optional[ArrayLike] = None, friction: Optional[ArrayLike] = None,
              rule: str = "minimum", priority: Optional[ArrayLike] = None,
              excluded: ArrayLike = (), dynamics: Optional[np.ndarray] = None) -> None:
        """Gives the server the shapes (haptic.shapes) of the world, the tool and bodies: it then finds their contacts itself,
        at every step of the hand, and send() needs none of them: see has_scene. Best before the first poll(). Where shapes
        come, go or change, all are offered again: those before stay until the server has these.

        positions (n, 3), m, and rotations (n, 4): of each shape in the frame of its link or body, of the world's in the world;
        default: there. friction: of each; negative: that of the other, of two such the server's own. rule: what two
        coefficients make of a contact, one of FRICTION_RULES. priority: of each, 0 to 255: of two the higher one's friction counts alone. excluded: pairs that never touch, by their places.

        dynamics: records of DYNAMICS of bodies that the tool can push. With them the server moves what the hand holds: see
        held().
        Raises HapticError that names the shape."""
        listed = _arguments.items(shapes, Shape, "shape")
        count = len(listed)
        at = np.zeros((count, 7))
        at[:, 3] = 1
        for given, name, columns in ((positions, "positions", slice(0, 3)), (rotations, "rotations", slice(3, 7))):
            if given is not None:
                at[:, columns] = _arguments.array(given, (count, columns.stop - columns.start), name)
        materials = np.zeros(count, _MATERIAL)
        materials["friction"] = -1 if friction is None else _arguments.array(friction, (count,), "friction")
        materials["rule"] = FRICTION_RULES.index(_arguments.choice(rule, FRICTION_RULES, "rule"))
        materials["priority"] = 0 if priority is None else _arguments.array(priority, (count,), "priority", np.uint8)
        pairs = _arguments.array(excluded, (None, 2), "excluded", np.uint32)
        if self._library.haptic_offer(self._open(), (Shape * count)(*listed), at.ctypes.data,
                                      materials.ctypes.data, count, pairs.ctypes.data, len(pairs),
                                      *_arguments.records(dynamics, DYNAMICS, "dynamics")) != 0:
            self._fail()

    @property
    def has_scene(self) -> bool:
        """Whether the server finds the contacts of the shapes that offer() gave it. Until then, and where it never does, as
        `message` says, send() needs contacts."""
        return bool(self._state.scene)

    @property
    def holds(self) -> bool:
        """Whether the server moves what the hand holds, or will as soon as it has the shapes: of the bodies that were offered with
        their dynamics. send() needs those alone that touch, themselves or by others, one without."""
        return bool(self._state.holds)

    @property
    def tool_pushes(self) -> bool:
        """Whether the tool itself pushes what it touches in the engine during this frame, after steps(), as what lies on it when a
        session begins: until the impulses cover whole frames and, where `holds` and send() had no bodies, while the hand holds
        none."""
        return bool(self._library.haptic_tool_pushes(self._open()))

    def held(self) -> np.ndarray:
        """Before each step, as records of HELD: the bodies that the hand holds, to be put there as the tool is, and moved by
        nothing else during the step; and once more each that it has let go of, which is the engine's from here on."""
        count = self._library.haptic_take_held(self._open(), self._held.ctypes.data)
        return self._held[:count].copy()

    def poll(self) -> bool:
        """Takes what arrived. Once per step, before it. Returns `running`."""
        if not self.running:
            return False
        if os.getpid() != self._process:
            raise HapticError("the session is of the process that was forked: open another here")
        self._library.haptic_poll(self._open(), self._address)
        if self._state.fresh:
            self.q = self._q_now.copy()
            self.v = self._v_now.copy()
        return True

    @property
    def now(self) -> float:
        """The time of the session's clock, s, of any steady origin: the machine's, or that of a server in virtual time."""
        return float(self._library.haptic_now(self._open()))

    @property
    def connected(self) -> bool:
        """Whether a server has answered and the session goes on."""
        return bool(self._state.connected)

    @property
    def server_state(self) -> str:
        """One of SERVER_STATES; force is on in "ramping" and "active"."""
        return SERVER_STATES[self._state.server] if 0 <= self._state.server < len(SERVER_STATES) else "unknown"

    @property
    def state(self) -> State:
        """The latest news of the server; its fields are those of haptic_state in haptic.h."""
        return self._state

    @property
    def force(self) -> np.ndarray:
        """What the device was given after limits: force (N) and torque (N m). That of the contacts alone, with which a due
        force is compared, is state.contact_wrench: while it moves the hand also feels the coupling's damping."""
        return np.array(self._state.command)

    @property
    def message(self) -> str:
        """Why the server refused a session, an update or a contact last, what a body does otherwise than it was reported to, or
        that a server of the session's own has ended; empty when a session begins."""
        return _text(self._state.message)

    def hold(self, position: ArrayLike, rotation: ArrayLike = (1, 0, 0, 0)) -> None:
        """Where the device is a simulated one, its hand draws the handle there (m; w, x, y, z) with 200 N/m, 1 N m/rad
        and at most 10 N, from the next send() on and until release()."""
        p, R = _arguments.array(position, (3,), "position"), _arguments.array(rotation, (4,), "rotation")
        if self._library.haptic_hold(self._open(), p.ctypes.data, R.ctypes.data) != 0:
            self._fail()

    def release(self) -> None:
        """The hand of hold() lets go."""
        self._library.haptic_release(self._open())

    def steps(self, step: float) -> int:
        """How many steps, of `step` seconds, an engine in real time has to take in the frame that begins. After
        poll(), once per frame. It makes up for a frame that came late. With 0 there is nothing to do in this one."""
        count = self._library.haptic_take_steps(self._open(), _arguments.number(step, "step"))
        if count < 0:
            self._fail()
        return int(count)

    def impulses(self, period: float) -> dict[int, np.ndarray]:
        """The tool's impulses on bodies for a step that begins, by their numbers, linear then angular: apply each / period
        as a wrench at the body's centre of mass during it, again before each part of it where the engine clears forces.
        The next send() says that its bodies contain them."""
        period = _arguments.number(period, "period")
        if not 0 < period < 1e6:
            raise HapticError(f"period {period:g} s must be above 0")
        count = self._library.haptic_take_impulses(self._open(), period, self._impulses)
        return {each.body: np.array(each.impulse) for each in self._impulses[:count]}

    def sample(self, q: ArrayLike, v: ArrayLike, period: float) -> None:
        """After a step of `period` seconds: where the tool is, for which contacts are found. Before the first send()."""
        q_now, v_now = _arguments.array(q, self._q_shape, "q"), _arguments.array(v, self._v_shape, "v")
        period = _arguments.number(period, "period")
        if self._library.haptic_sample(self._open(), q_now.ctypes.data, v_now.ctypes.data, period) != 0:
            self._fail()
        if self.current_episode is not None:
            self.current_episode.sampled()

    def track(self, contacts: np.ndarray, bodies: Optional[np.ndarray] = None) -> np.ndarray:
        """Sets lasting identities, by pair, place on side a and normal, for an engine that has none.
        After sample(), once per step. Returns the same array."""
        at, count = _arguments.records(contacts, CONTACT, "contacts")
        self._library.haptic_track(self._open(), at, count, *_arguments.records(bodies, BODY, "bodies"))
        return contacts

    def external_wrench(self, wrench: ArrayLike, link: int = 0) -> None:
        """What else than contacts and its weight pushes the tool: a weld, a tendon, a payload, drag, or what a force sensor
        reads; force (N) and torque (N m) about the origin of the link's frame, world axes. After sample(), for the next send():
        without this there is none. The server finds how it depends on the tool's motion, so that the hand feels a load, a
        spring or a wall between frames, too. Several on one link add up. Raises HapticError where it cannot be used."""
        given = _arguments.array(wrench, (6,), "wrench")
        link = _arguments.integer(link, "link", -1)
        if self._library.haptic_external_wrench(self._open(), link, given.ctypes.data) != 0:
            self._fail()

    def drive_joints(self, drives: Sequence[Drive]) -> None:
        """What drives the tool's joints, at most one of each, from the next send() on until the next call."""
        given = _arguments.items(drives, Drive, "drive")
        if self._library.haptic_drive_joints(self._open(), (Drive * len(given))(*given), len(given)) != 0:
            self._fail()

    def send(self, contacts: Optional[np.ndarray] = None, bodies: Optional[np.ndarray] = None,
             poses: Optional[np.ndarray] = None) -> int:
        """Sends what is near; poses: of the bodies whose shapes were offered, those near the tool, at most MAX_POSES. Returns
        the update's sequence, 0 without a session. Raises HapticError where something is wrong with a contact, a body or a
        pose; nothing is sent then."""
        if poses is not None and self._library.haptic_place(self._open(), *_arguments.records(poses, POSE, "poses")) != 0:
            self._fail()
        sequence = self._library.haptic_send(self._open(), *_arguments.records(contacts, CONTACT, "contacts"),
                                             *_arguments.records(bodies, BODY, "bodies"))
        if sequence < 0:
            self._fail()
        if self.current_episode is not None:
            self.current_episode.sent(self._library.haptic_session_id(self._open()), sequence)
        return int(sequence)

    def episode(self, task: str, folder: str | os.PathLike[str] = "demonstrations", *, buttons: Optional[Mapping[int, str]] = None,
                **about: Any) -> Episode:
        """Begins an attempt at a task, whose marks and log() are kept in a folder of its own in `folder`: haptic.dataset makes a data set
        of it and of the server's recording. buttons: what the device's buttons mark, by number: "success", "failure" or "discard".
        about: what else is to be known of it, as JSON. Raises HapticError where it cannot be kept."""
        return open_episode(self, task, folder, buttons, about)

    def log(self, **values: Any) -> None:
        """As Episode.log() of the episode that is open; without one nothing is kept."""
        if self.current_episode is not None:
            self.current_episode.log(**values)

    def _open(self) -> ctypes.c_void_p:
        if not self._session:
            raise HapticError("the session is closed")
        return self._session

    def _fail(self) -> NoReturn:
        raise HapticError(_text(self._library.haptic_error(self._open())))


def _text(given: bytes) -> str:
    """What may hold a name that is no UTF-8, or be cut within a character."""
    return given.decode(errors="replace")


def _tell(sentence: str) -> None:
    """On standard error, where there is one."""
    with contextlib.suppress(OSError, ValueError):
        if sys.stderr is not None:
            print(sentence, file=sys.stderr, flush=True)
