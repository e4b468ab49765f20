#!/usr/bin/python3
"""haptic.mujoco in the life of a model: it is given back as it was, may be reset, and may change while it is felt.

Usage: mujoco_life_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …], as mujoco_python_test.py
"""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import mujoco_python_test as session  # noqa: E402  (finds the library and the package)
import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from hand_session import mean, reach  # noqa: E402
from haptic_local_model._world import rotation  # noqa: E402

BALL = 'name="ball" type="sphere" size="0.02" margin="0.001" gap="0.0005"'
BOX = 'type="box" size="0.02 0.02 0.02"'
OWN = (0, 0.25, 0.1, 0, 0, 0)  # N: a force of the user's
PUSH = np.array((1.1, 0.3, -0.7, 0.01, 0, 0))  # N, N m: what the hand did to the brick, /s


def scene(tool=BALL, bodies=session.BRICK, height=0.03, rest="", option=""):
    text = session.SCENE.format(step=0.002, height=height, tool=tool, bodies=bodies).replace("</worldbody>", "</worldbody>" + rest)
    return session.loaded(text.replace("<option ", f"<option {option} "))


def alone(model, data, **options):
    """A session that no server answers."""
    return haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, server="127.0.0.1:9", **options)


def contents(model):
    """Every array and number of a model and of its options, as bytes."""
    return {(part is model, name): np.asarray(getattr(part, name)).tobytes() for part in (model, model.opt) for name in dir(part)
            if not name.startswith("_") and isinstance(getattr(part, name), (np.ndarray, int, float))}


def play(seconds, model, data, hand, each=lambda model, data, t: None, **options):
    """The ticks of the server; each(): before send(), t s after force was on."""
    with virtual_hand.server(hand) as server:
        with haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, contacts="shapes", **options) as touch:
            active = None
            while server.now < seconds:
                for _ in range(touch.drive(data)):
                    mujoco.mj_step(model, data)
                active = active or (touch.touch.server_state == "active" and server.now)
                each(model, data, server.now - active if active else 0)
                touch.send(data)
        return virtual_hand.active(server)


class GivenBack(unittest.TestCase):
    PAIR = '<contact><pair geom1="ball" geom2="table" margin="0.002" gap="0.001"/></contact>'

    def test_after_a_session_every_byte_of_the_model_is_as_it_was(self):
        for contacts in ("engine", "shapes"):
            for end in ("close", "with"):
                with self.subTest(contacts=contacts, end=end):
                    model, data = scene(rest=self.PAIR)
                    before = contents(model)
                    touch = alone(model, data, contacts=contacts)
                    if end == "with":
                        touch.__enter__()
                    for has_force in (False, True, False):
                        touch._listing.set_force(has_force)
                        touch._listing.list_early(np.ones(model.ngeom, bool))
                    touch._placed.keep(2)
                    self.assertNotEqual(contents(model), before)
                    touch.close() if end == "close" else touch.__exit__(None, None, None)
                    after = contents(model)
                    self.assertEqual([name for name in before if after[name] != before[name]], [])

    def test_what_the_user_changed_meanwhile_stays(self):
        model, data = scene()
        with alone(model, data, contacts="engine") as touch:
            model.dof_armature[6:9], model.geom_margin[2] = 0.5, 0.003
            touch._listing.set_force(False)
        np.testing.assert_array_equal(model.dof_armature, [0] * 6 + [0.5] * 3 + [0] * 3)
        np.testing.assert_array_equal(model.geom_margin, (0, 0.001, 0.003))

    def test_what_mujoco_derives_of_a_mass_that_the_user_changed_holds_no_body(self):
        model, data = scene()
        with alone(model, data):
            model.body_mass[1] *= 2
            mujoco.mj_setConst(model, mujoco.MjData(model))
        np.testing.assert_array_equal(model.dof_armature, 0)
        self.assertLess(model.dof_M0.max(), 1)  # kg

    def test_a_session_that_cannot_be_changes_nothing(self):
        model, data = scene()
        before = contents(model)
        for wrong in ({"rate": "fast"}, {"gravity": (1, 2)}, {"epsilon": -1}):
            with self.assertRaises(haptic.HapticError):
                alone(model, data, **wrong)
        self.assertEqual(contents(model), before)


class Pushed(unittest.TestCase):
    """What the tool did to the brick is in xfrc_applied from drive() to send(), and then it is not, whatever happened."""

    def left(self, meanwhile, own=OWN):
        """xfrc_applied of the brick after three frames in which it is pushed; meanwhile(model, data): between drive() and
        send(), may return other data."""
        model, data = scene()
        data.xfrc_applied[2] = own
        with alone(model, data, contacts="engine") as touch:
            for _ in range(3):
                touch.touch.impulses = lambda length: {2: PUSH * length}
                steps = touch.drive(data)
                np.testing.assert_allclose(data.xfrc_applied[2], own + PUSH)
                mujoco.mj_step(model, data, steps)
                other = meanwhile(model, data)
                touch.send(data if other is None else other)
                left = np.array(data.xfrc_applied[2])
                data.xfrc_applied[2] = own
                touch._frames._touch.steps = lambda step: 8
        return left

    def test_nothing_is_left_of_it(self):
        def wind(model, data):  # which is there for a while
            data.xfrc_applied[2] += 0.1
            data.xfrc_applied[2] -= 0.1
        cases = {"nothing": (lambda model, data: None, OWN), "a wind": (wind, OWN),
                 "mj_resetData": (mujoco.mj_resetData, np.zeros(6)),
                 "a keyframe": (lambda model, data: mujoco.mj_resetDataKeyframe(model, data, 0), np.zeros(6)),
                 "new data": (lambda model, data: mujoco.MjData(model), OWN),
                 "an environment that clears": (lambda model, data: data.xfrc_applied.fill(0), np.zeros(6)),
                 "a user who sets": (lambda model, data: data.xfrc_applied.__setitem__(2, 0.4), np.full(6, 0.4))}
        for name, (meanwhile, due) in cases.items():
            with self.subTest(name):
                np.testing.assert_allclose(self.left(meanwhile), due, atol=1e-12)

    def test_where_it_was_cleared_the_brick_s_acceleration_is_without_it(self):
        model, data = scene()
        with alone(model, data, contacts="engine") as touch:
            touch.touch.impulses = lambda length: {2: PUSH * length}
            for cleared in (False, True):
                touch.drive(data)
                if cleared:
                    data.xfrc_applied[:] = 0
                mujoco.mj_forward(model, data)
                np.testing.assert_allclose(touch._bodies(data, [2])["acceleration"][0][:3], (0, 0, -session.GRAVITY), atol=1e-5)


class Changed(unittest.TestCase):
    """What decides contacts or weights is changed one second after force is on, and felt half a second later."""

    TABLE = ('<body name="stand"><geom name="top" type="box" size="0.2 0.2 0.05" pos="0 0 -0.05" friction="0.5 0 0" priority="1"/>'
             '</body>')

    def felt(self, change, hand, column="env_force_z_N", **parts):
        """Means of the last half second before the change, and of that beyond half a second after it."""
        model, data = scene(**{"tool": BOX, "bodies": self.TABLE, "height": 0.022, **parts})
        model.geom_contype[0] = model.geom_conaffinity[0] = 0  # The plane is not meant.
        changed = []

        def each(model, data, t):
            if t > 1 and not changed:
                changed.append(change(model, data))
        ticks = play(2.6, model, data, hand, each)
        return mean(ticks, column, 0.5, 0.9)[0], mean(ticks, column, 1.5, 2)[0]

    def test_what_was_moved_or_has_grown_is_where_it_is_when_the_hand_comes_again(self):
        """By 10 mm, while the hand is away."""
        def moved(model, data):
            model.body("stand").pos[2] = 0.01

        def grown(model, data):
            model.geom("top").size[2] = 0.06

        for change in (moved, grown):
            with self.subTest(change.__name__):
                hand = reach(0.3, 0, 0.018) + reach(0.9, 0, 0.018) + reach(0.1, 0, 0.05) + reach(0.2, 0, 0.028)
                before, after = self.felt(change, hand, "proxy_z_m")
                self.assertAlmostEqual(before, 0.02, delta=2e-4)  # m
                self.assertAlmostEqual(after, 0.03, delta=2e-4)

    def test_what_is_put_elsewhere_in_the_tool_pushes_it(self):
        """By 10 mm: the hand holds at 19 mm with 400 N/m what is on the table at 30 mm then."""
        def moved(model, data):
            model.body("stand").pos[2] = 0.01

        before, after = self.felt(moved, reach(0.2, 0, 0.019), "proxy_z_m")
        self.assertAlmostEqual(before, 0.02, delta=2e-4)  # m
        self.assertAlmostEqual(after, 0.03, delta=8e-4)

    def test_what_is_moved_from_frame_to_frame_lifts_the_tool(self):
        """By 20 mm at 20 mm/s."""
        model, data = scene(BOX, self.TABLE, height=0.022)

        def rise(model, data, t):
            model.body("stand").pos[2] = 0.02 * min(max(t - 1, 0), 1)
        ticks = play(3.2, model, data, reach(0.2, 0, 0.019), rise)
        height, deviation = mean(ticks, "proxy_z_m", 2.2, 2.6)
        self.assertAlmostEqual(height, 0.04, delta=1.5e-3)  # m: the first 0.2 s are made up for at once
        self.assertLess(deviation, 1e-4)

    def test_masks_and_flags(self):
        def mask(model, data):
            model.geom("top").contype[0] = model.geom("top").conaffinity[0] = 0

        def disabled(model, data):
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)

        for change in (mask, disabled):
            with self.subTest(change.__name__):
                before, after = self.felt(change, reach(0.2, 0, 0.019))
                self.assertGreater(before, 0.3)  # N
                self.assertAlmostEqual(after, -0.1 * session.GRAVITY, delta=0.001)

    def test_friction(self):
        def friction(model, data):
            model.geom("top").friction[0] = 0.1

        before, after = self.felt(friction, reach(0.2, 0, 0.018) + reach(3, 0.1, 0.018), "env_force_x_N")
        self.assertLess(before, -0.5)  # N
        self.assertAlmostEqual(after, before / 5, delta=0.02 * abs(before))

    def test_what_is_carried_and_the_tool_weigh_what_they_weigh_now(self):
        tray, cube = 'type="box" size="0.05 0.05 0.005"', (
            '<body name="cube" pos="0 0 0.0851"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>')

        def cube_of_half_a_kilogram(model, data):
            model.body("cube").mass[0] = 0.5

        def tool_of_half_a_kilogram(model, data):
            model.body("tool").mass[0] = 0.5

        def moon(model, data):
            model.opt.gravity[2] = -1.62

        def no_gravity(model, data):
            model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)

        def smaller_steps(model, data):
            model.opt.timestep = 0.001

        def nothing_that_matters(model, data):
            model.geom("table").pos[0] = 0.1

        for change, due in ((cube_of_half_a_kilogram, 0.6 * session.GRAVITY), (tool_of_half_a_kilogram, 0.8 * session.GRAVITY),
                            (moon, 0.4 * 1.62), (no_gravity, 0), (smaller_steps, 0.4 * session.GRAVITY),
                            (nothing_that_matters, 0.4 * session.GRAVITY)):
            with self.subTest(change.__name__):
                before, after = self.felt(change, reach(0.4, 0, 0.1), "command_force_z_N", tool=tray, bodies=self.TABLE + cube,
                                          height=0.06)
                self.assertAlmostEqual(before, -0.4 * session.GRAVITY, delta=0.04)  # N
                self.assertAlmostEqual(after, -due, delta=0.04)

class Walls(unittest.TestCase):
    """Mocap bodies, whose velocity MuJoCo does not know."""

    def velocity(self, model, data, place):
        """What is told of mocap body 2 in a frame in which it goes from `place` to the next."""
        data.mocap_pos[0], data.mocap_quat[0] = place
        mujoco.mj_forward(model, data)
        return self.touch._shapes.poses(data, [2], self.touch.touch.now, 0.02)["velocity"][0]

    def test_they_move_as_the_difference_of_two_frames_says(self):
        wall = '<body name="wall" mocap="true" pos="0.2 0 0"><body><geom size="0.02" pos="0 0 0.1"/></body></body>'
        model, data = scene(bodies=wall)
        still, none = ((0.2, 0, 0), (1, 0, 0, 0)), np.zeros(6)
        with alone(model, data) as self.touch:
            self.assertIn(2, self.touch._shapes.bodies)
            np.testing.assert_array_equal(self.velocity(model, data, still), none)
            turned = np.cos(0.01), 0, 0, -np.sin(0.01)
            np.testing.assert_allclose(self.velocity(model, data, ((0.2, 0.01, 0), turned)), (0, 0.5, 0, 0, 0, -1), atol=1e-9)
            np.testing.assert_array_equal(self.velocity(model, data, ((5, 0, 0), turned)), none)  # It was put there.
            self.touch._shapes.forget_motion()
            np.testing.assert_array_equal(self.velocity(model, data, still), none)


class Rules(unittest.TestCase):
    """Which geoms touch, and with which friction, as MuJoCo has it."""

    TABLE = '<body name="stand"><geom name="top" type="box" size="0.2 0.2 0.05" pos="0 0 -0.05" {}/></body>'
    PAIR = '<contact><pair geom1="top" geom2="cube" condim="{}" friction="{} {} 0.005 0.0001 0.0001"/></contact>'

    def slide(self, tool="", table="", rest="", option="", flag=""):
        """The load that the hand presses with, and its friction over that."""
        text = f"""<mujoco><option timestep="0.002" {option}>{flag}</option><worldbody>{self.TABLE.format(table)}
            <body name="tool" pos="0 0 0.022"><freejoint/><geom name="cube" {BOX} mass="0.1" {tool}/></body></worldbody>{rest}
            </mujoco>"""
        ticks = play(2, *session.loaded(text), reach(0.2, 0, 0.018) + reach(3, 0.1, 0.018))
        along, load = (mean(ticks, f"env_force_{axis}_N", 1, 1.5)[0] for axis in "xz")
        load += 0.1 * session.GRAVITY * ("gravity" not in flag)
        return load, -along / max(load, 1e-9)

    def test_friction(self):
        condim, none = 'condim="1"', 'contype="0" conaffinity="0"'
        for name, due, parts in (
                ("of the geoms", 1, {}), ("condim 1 of both", 0, {"tool": condim, "table": condim}),
                ("condim 1 of one", 1, {"tool": condim}),
                ("condim 1 of the one with priority", 0, {"tool": condim + ' priority="1"'}),
                ("of a pair", 0.1, {"rest": self.PAIR.format(3, 0.1, 0.1)}),
                ("of a pair of geoms that touch nothing else", 0.3,
                 {"rest": self.PAIR.format(3, 0.3, 0.3), "tool": none, "table": none}),
                ("condim 1 of a pair", 0, {"rest": self.PAIR.format(1, 0.1, 0.1)}),
                ("of a pair whose bodies are excluded", 0.2, {"rest": self.PAIR.format(3, 0.2, 0.2).replace(
                    "</contact>", '<exclude body1="stand" body2="tool"/></contact>')}),
                ("that the model overrides", 0.4, {"option": 'o_friction="0.4 0.4 0.005 0.0001 0.0001"',
                                                   "flag": '<flag override="enable"/>'})):
            with self.subTest(name):
                load, friction = self.slide(**parts)
                print(f"{name}: load {load:.3f} N, friction {friction:.4f}, due {due}")
                self.assertGreater(load, 0.5)  # N
                self.assertAlmostEqual(friction, due, delta=0.01)

    def test_half_on_what_a_pair_names_and_half_on_what_it_does_not(self):
        halves = self.TABLE.replace("</body>", '<geom type="box" size="0.2 0.1 0.05" pos="0 0.1 -0.05"/></body>').replace(
            "0.2 0.2 0.05", "0.2 0.1 0.05").replace("0 0 -0.05", "0 -0.1 -0.05")
        for table, due in ((halves, 0.55), (halves.replace('<geom type', '</body><body><geom type'), 0.55)):
            with self.subTest(table):
                self.TABLE = table
                load, friction = self.slide(rest=self.PAIR.format(3, 0.1, 0.1))
                print(f"load {load:.3f} N, friction {friction:.4f}, due {due}")
                self.assertAlmostEqual(load, 1.738, delta=0.02)
                self.assertAlmostEqual(friction, due, delta=0.02)

    def test_of_mujoco_s_own_contacts_those_of_condim_1_have_no_friction(self):
        for condim, due in ((1, 0), (3, 0.7), (4, 0.7)):
            ball = f'type="sphere" size="0.02" condim="{condim}" priority="1" friction="0.7 0 0"'
            model, data = scene(ball, "", height=0.021)
            with alone(model, data, contacts="engine") as touch:
                found = touch._contacts(data, touch._listing.early)
            np.testing.assert_allclose(found["friction"], [due])

    def test_flags(self):
        load, _ = self.slide(flag='<flag contact="disable"/>')
        self.assertAlmostEqual(load, 0, delta=0.001)  # N
        load, _ = self.slide(flag='<flag gravity="disable"/>')
        self.assertAlmostEqual(load, 400 * 0.002, delta=0.05)


class Tools(unittest.TestCase):
    def test_what_is_welded_to_the_tool_is_a_part_of_it(self):
        """A tray on a handle, as two bodies: a cube on it is carried."""
        tray = '<body pos="0 0 0.05"><geom type="box" size="0.05 0.05 0.005" mass="0.2"/></body>'
        text = f"""<mujoco><option timestep="0.002"/><worldbody>
            <body name="tool" pos="0 0 0.05"><freejoint/><geom {BOX} mass="0.1"/>{tray}</body>
            <body name="cube" pos="0 0 0.1251"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>
            </worldbody></mujoco>"""
        model, data = session.loaded(text)
        above = []  # m, of the cube above the tool since half a second
        ticks = play(2.5, model, data, reach(0.3, 0, 0.05) + reach(1, 0, 0.1),
                     lambda model, data, t: t > 0.5 and above.append(data.xpos[3][2] - data.xpos[1][2]))
        self.assertAlmostEqual(mean(ticks, "command_force_z_N", 1.6, 2)[0], -0.6 * session.GRAVITY, delta=0.02)  # N
        self.assertLess(np.ptp(above), 5e-5)  # m: it stays where MuJoCo's soft contact had it
        self.assertAlmostEqual(above[-1], 0.075, delta=0.0006)
        with alone(*session.loaded(text)) as touch:
            link = touch._tool.links()[0]
        self.assertAlmostEqual(link.mass, 0.3)  # kg
        np.testing.assert_allclose(link.centre, (0, 0, 0.2 / 0.3 * 0.05), atol=1e-9)
        reference = session.loaded(text.replace('<body pos="0 0 0.05">', "").replace('0.2"/></body>', '0.2" pos="0 0 0.05"/>'))[0]
        R = np.reshape(rotation(reference.body_iquat[1]), (3, 3))
        np.testing.assert_allclose(np.reshape(link.inertia, (3, 3)), (R * reference.body_inertia[1]) @ R.T, atol=1e-9)

    def test_what_cannot_be_felt_is_said(self):
        text = '<mujoco><worldbody><body name="tool">{}</body></worldbody></mujoco>'
        hand, jaw = '<freejoint/><geom size="0.02"/>', '<body name="jaw"><joint/><geom size="0.01"/></body>'
        for inner, said in ((hand + jaw, r"bodies that hang on the tool by joints \(1, the first 'jaw'\)"),
                            ('<freejoint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', "the tool has no geoms"),
                            ('<freejoint/><geom size="0.02" contype="0" conaffinity="0"/>', "nothing of the tool collides")):
            with self.subTest(said), self.assertWarnsRegex(UserWarning, said):
                alone(*session.loaded(text.format(inner))).close()
        axes = "".join(f'<joint type="{kind}" axis="{axis}"/>'
                       for kind in ("slide", "hinge") for axis in ("1 0 0", "0 1 0", "0 0 1"))
        with self.assertRaisesRegex(haptic.HapticError, "write <freejoint/> in place of its 6 joints"):
            alone(*session.loaded(text.format(axes + '<geom size="0.02"/>')))

    def test_a_cube_is_carried_in_steps_of_20_ms(self):
        cube = '<body name="cube" pos="0 0 0.0751"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>'
        model, data = scene('type="box" size="0.05 0.05 0.005"', cube, height=0.05)
        model.opt.timestep = 0.02
        ticks = play(2.4, model, data, reach(0.3, 0, 0.06) + reach(1, 0, 0.1))
        self.assertAlmostEqual(mean(ticks, "command_force_z_N", 1.5, 1.9)[0], -0.4 * session.GRAVITY, delta=0.04)  # N
        # In MuJoCo's first step the cube falls 4 mm: it lay 0.1 mm above the tool.
        self.assertAlmostEqual(data.xpos[2][2] - data.xpos[1][2], 0.025, delta=0.004)  # m


class Offered(unittest.TestCase):
    """What makes the shapes be offered again."""

    def test_each_change_is_offered_once(self):
        model, data = scene(rest='<equality><weld name="tie" body1="brick" body2="tool"/></equality>')
        offers, changes = [], {
            "size": lambda: model.geom_size.__setitem__((1, 0), 0.03), "place": lambda: model.geom_pos.__setitem__((2, 0), 0.01),
            "turn": lambda: model.geom_quat.__setitem__(2, (0, 1, 0, 0)),
            "friction": lambda: model.geom_friction.__setitem__((2, 0), 0.3),
            "condim": lambda: model.geom_condim.__setitem__(2, 1), "priority": lambda: model.geom_priority.__setitem__(2, 3),
            "mask": lambda: model.geom_conaffinity.__setitem__(2, 3), "mass": lambda: model.body_mass.__setitem__(2, 0.5),
            "inertia": lambda: model.body_inertia.__setitem__(2, 0.01), "gravity": lambda: model.opt.gravity.__setitem__(2, -1),
            "equality": lambda: (data if hasattr(data, "eq_active") else model).eq_active.__setitem__(0, 0)}
        with alone(model, data) as touch:
            touch.touch.offer = lambda *given: offers.append(given)
            for name, change in changes.items():
                with self.subTest(name):
                    touch._watch._next = 0
                    offers.clear()
                    touch._follow_changes(data)
                    self.assertEqual(len(offers), 0)
                    change()
                    touch._follow_changes(data)
                    touch._follow_changes(data)
                    self.assertEqual(len(offers), 1)
            self.assertEqual(len(offers[0][-1]), 1, "the server can hold the brick that nothing ties")

    def test_what_changes_in_every_frame_is_offered_from_time_to_time(self):
        model, data = scene()
        offers = []
        with haptic.virtual.Server() as server, haptic.mujoco.Session(model, data, tool="tool", binding=mujoco) as touch:
            touch.touch.offer = lambda *given: offers.append(server.now)
            while len(offers) < 4:
                model.geom_size[1, 0] += 1e-6
                touch._follow_changes(data)
                server.wait(0.016)
        self.assertGreater(min(np.diff(offers)), 0.09)  # s
        self.assertLess(max(np.diff(offers)), 0.13)

    def test_looking_takes_no_more_calls_of_a_hundred_geoms_than_of_one(self):
        def calls(count):
            bodies = "".join(f'<body pos="{i} 0 1"><freejoint/><geom size="0.02"/></body>' for i in range(count))
            model, data = scene(bodies=bodies)
            events = []
            with alone(model, data) as touch:
                touch._follow_changes(data)
                sys.setprofile(lambda frame, event, argument: events.append(event))
                touch._follow_changes(data)
                sys.setprofile(None)
            return sum(event in ("call", "c_call") for event in events)
        few = calls(1)
        self.assertEqual(calls(98), few)
        self.assertLess(few, 100)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
