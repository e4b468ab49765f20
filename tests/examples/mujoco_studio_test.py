#!/usr/bin/python3
"""haptic.studio: a body of a model in MuJoCo Studio is in the hand while one looks and the world runs, and then it is not.

Usage: mujoco_studio_test.py LIBHAPTIC PACKAGE_FOLDER [TEST …], with the Python of an environment with MuJoCo's Studio
"""

import os
import pathlib
import sys
import tempfile
import unittest
from unittest import mock

LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
os.environ["HAPTIC_LIBRARY"] = str(LIBRARY)
sys.path[:0] = [str(PACKAGE), str(pathlib.Path(__file__).resolve().parents[1] / "support")]

import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from haptic_local_model import studio  # noqa: E402
from mujoco.studio import app, launch_thread, messages, plugin, sim, sim_history, viewer_handle  # noqa: E402

GRAVITY, HAND, CONTACTS = 9.81, 200, 4 * 4000  # m/s², N/m, N/m of four contacts
WEIGHT = 0.11 * GRAVITY  # N, of cube and knob
SCENE = """<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody><geom name="table" type="plane" size="1 1 0.1"/>
  <body name="cube" pos="0 0 0.021"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.1"/>
    <body name="knob" pos="0 0 0.03" euler="0 0 30"><geom size="0.01" mass="0.01"/></body></body>
  <body name="brick" pos="0.2 0 0.02"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.3"/></body>
  <body name="arm" pos="0.5 0 0.3"><joint name="elbow" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.2 0 0" size="0.01"/></body>
  </worldbody><actuator><position joint="elbow" kp="2" kv="0.05"/></actuator>
  <keyframe><key qpos="0 0 0.05 1 0 0 0 0.2 0 0.02 1 0 0 0 0.1"/></keyframe></mujoco>"""
ROBOT = """<mujoco><option integrator="implicitfast"/><worldbody><body pos="0 0 0.3"><joint name="elbow" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/></body></worldbody>
  <actuator><position joint="elbow" kp="50" kv="5"/></actuator><keyframe><key name="up" qpos="-0.4"/></keyframe></mujoco>"""


CRANE = """<mujoco><option integrator="implicitfast"/><worldbody><body name="x" pos="0 0 0.2"><joint name="x" type="slide" axis="1 0 0"/>
  <geom size="0.01" mass="0.1"/><body name="y"><joint name="y" type="slide" axis="0 1 0"/><geom size="0.01" mass="0.1"/><body name="palm">
  <joint name="z" type="slide" axis="0 0 1"/><geom type="box" size="0.02 0.06 0.01" mass="0.2"/>
  <body name="left"><joint name="left" type="slide" axis="0 1 0" range="0 0.03"/><geom type="box" size="0.01 0.005 0.02" pos="0 0.005 -0.03"
    mass="0.02"/></body>
  <body name="right"><joint name="right" type="slide" axis="0 -1 0" range="0 0.03"/><geom type="box" size="0.01 0.005 0.02" pos="0 -0.005 -0.03"
    mass="0.02"/></body></body></body></body></worldbody><actuator><position name="x" joint="x" kp="1000" dampratio="1"/>
  <position name="y" joint="y" kp="1000" dampratio="1"/><position name="z" joint="z" kp="1000" dampratio="1"/>
  <position name="left" joint="left" kp="500" ctrlrange="0 0.03" forcerange="-10 10"/>
  <position name="right" joint="right" kp="500" ctrlrange="0 0.03" forcerange="-10 10"/></actuator></mujoco>"""


class Session(unittest.TestCase):
    """Studio's simulation thread with its own plugins and ours; the viewer is a script."""

    def setUp(self):
        self.server = self.enterContext(haptic.virtual.Server())
        self.enterContext(mock.patch("time.sleep"))
        viewer, simulation = launch_thread.make_thread_endpoints()
        self.viewer, self.hand = viewer, studio.Hand()
        self.handle = viewer_handle.ViewerHandle(simulation, sim_plugins=[*app.SIM_PLUGINS, self.hand])
        self.addCleanup(self.handle.close)
        self.wanted, self.felt = studio.WantedSnapshot(seen=True), studio.FeltSnapshot()
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))

    def load(self, text, name="scene.xml"):
        (self.folder / name).write_text(text)
        self.viewer.send_to_sim(messages.LoadModelEvent(path=str(self.folder / name)))
        self.run_for(0)

    def select(self, name, pose=()):
        self.wanted = studio.WantedSnapshot(self.handle.model.body(name).id, pose, True)

    def run_for(self, seconds):
        """Frames of a sixtieth of a second, in which time passes also where there is no hand."""
        end = self.server.now + seconds
        while True:
            self.viewer.send_to_sim(self.wanted)
            begin = self.server.now
            self.handle.sync()
            for message in self.viewer.get_sim_snapshots():
                if isinstance(message, studio.FeltSnapshot):
                    self.felt = message
            if self.server.now >= end - 1e-9:
                return
            if self.server.now == begin:
                self.server.wait(1 / 60)

    def pause(self, state):
        self.viewer.send_to_sim(messages.StepControlSnapshot(pause_state=state))

    def press(self):
        """The cube, by the mouse, 10 mm into the table."""
        self.load(SCENE)
        self.select("cube", (0, 0, 0.01, 1, 0, 0, 0))
        self.run_for(2)
        pull = HAND * 0.01  # N
        due = pull - HAND * (pull + WEIGHT) / (HAND + CONTACTS)
        self.assertAlmostEqual(self.server.ticks["command_force_z_N"][-1], due, delta=0.01)

    def force_since(self, begin):
        """Largest force from the tick of that number on, by tick, N."""
        ticks = self.server.ticks_since(begin)
        return np.linalg.norm([ticks[f"command_force_{axis}_N"] for axis in "xyz"], axis=0)


class Held(Session):
    def test_a_cube_that_the_mouse_presses_on_the_table_is_felt(self):
        self.press()
        self.assertIn("cube: active", self.felt.text)
        self.assertAlmostEqual(self.felt.force[2], self.server.ticks["command_force_z_N"][-1], delta=0.02)
        np.testing.assert_allclose(self.felt.point, self.handle.data.body("cube").xpos, atol=1e-3)

    def test_a_part_of_it_is_it(self):
        self.load(SCENE)
        knob = self.handle.model.body("knob").id
        self.select("knob", (0, 0, 0.1, 1, 0, 0, 0))
        pulls = np.zeros((self.handle.model.nbody, 6))
        pulls[knob, 2] = 5  # N: the mouse's own spring, which is not felt besides the hand.
        for _ in range(120):
            self.viewer.send_to_sim(messages.PerturbSnapshot(state=pulls.ravel(), state_sig=int(mujoco.mjtState.mjSTATE_XFRC_APPLIED)))
            self.run_for(1 / 60)
        self.assertIn("cube: active", self.felt.text)
        self.assertAlmostEqual(self.handle.data.body("cube").xpos[2], 0.1 - WEIGHT / HAND, delta=1e-3)

    def test_a_double_click_on_a_jaw_puts_the_gripper_in_the_hand(self):
        self.load(CRANE)
        self.select("left", (0, 0, 0.2, 1, 0, 0, 0))
        self.run_for(0.5)
        self.assertIn("palm: active", self.felt.text)
        self.select("palm", (0, 0, 0.18, 1, 0, 0, 0))
        self.run_for(1.5)
        self.assertAlmostEqual(self.handle.data.body("palm").xpos[2], 0.18, delta=1e-3)
        jaw = self.handle.data.joint("left")
        self.viewer.send_to_sim(studio.JawsEvent())
        self.run_for(1)
        self.assertGreater(jaw.qpos[0], 0.029)  # m: they began closed
        self.viewer.send_to_sim(studio.JawsEvent())
        self.run_for(1)
        self.assertLess(jaw.qpos[0], 0.001)

    def test_another_body_changes_hands(self):
        self.press()
        self.select("brick", (0.2, 0, 0.1, 1, 0, 0, 0))
        self.run_for(2)
        self.assertIn("brick: active", self.felt.text)
        self.assertAlmostEqual(self.handle.data.body("brick").xpos[2], 0.1 - 0.3 * GRAVITY / HAND, delta=1e-3)
        self.assertAlmostEqual(self.handle.data.body("cube").xpos[2], 0.02, delta=1e-3)

    def test_what_cannot_move_freely_is_named(self):
        self.load(SCENE)
        self.select("arm")
        self.run_for(0.2)
        self.assertEqual(self.felt.text, "arm has no free joint, and is no gripper's")
        self.select("cube")
        self.run_for(0.5)
        self.assertIn("cube: active", self.felt.text)

    def test_it_is_let_go_of_until_another_is_selected(self):
        self.press()
        self.viewer.send_to_sim(studio.LetGoEvent())
        begin = len(self.server.ticks)
        self.run_for(1)
        self.assertLess(self.force_since(begin + 100).max(initial=0), 1e-9)
        self.assertIn("Double-click", self.felt.text)
        self.wanted = studio.WantedSnapshot(seen=True)  # As the panel does.
        self.run_for(0.1)
        self.select("cube")
        self.run_for(0.5)
        self.assertIn("cube: active", self.felt.text)

    def test_a_session_that_cannot_be_ends_with_a_word(self):
        self.press()
        self.handle.data.qvel[:] = np.nan
        with mock.patch("mujoco.mj_step"):
            self.run_for(0.1)
        self.assertRegex(self.felt.text, "nan")


class Interrupted(Session):
    def fades(self, what):
        """The force, within 0.1 s, and nothing of the session is left in the model."""
        begin = len(self.server.ticks)
        what()
        self.run_for(1)
        self.assertLess(self.force_since(begin + 100).max(), 1e-9)
        self.assertLess(np.abs(np.diff(self.force_since(begin))).max(), 0.5)  # N
        return begin + 100

    def comes_back(self, begin, force=1.96):
        """Each beginning forgives how deep it lies, 0.2 mm here."""
        self.run_for(2)
        felt = self.force_since(begin)
        self.assertAlmostEqual(felt[-1], force, delta=0.06)
        self.assertLess(np.abs(np.diff(felt)).max(), 0.5)  # N

    def test_pause_and_scrub(self):
        self.press()
        before = self.handle.data.qpos.copy()
        for ask in (lambda: self.pause(sim.PauseState.NORMAL_PAUSED),
                    lambda: self.viewer.send_to_sim(sim_history.SimHistorySnapshot(index=-50))):
            begin = self.fades(ask)
            np.testing.assert_array_equal(self.handle.model.dof_armature, 0)
            np.testing.assert_allclose(self.handle.data.qpos[:3], before[:3], atol=1e-3)
            self.pause(sim.PauseState.UNPAUSED)
            self.comes_back(begin)

    def test_one_step_while_paused_is_studio_s(self):
        self.press()
        self.fades(lambda: self.pause(sim.PauseState.NORMAL_PAUSED))
        before = self.handle.data.time
        self.viewer.send_to_sim(messages.SingleStepEvent())
        self.run_for(0.1)
        self.assertAlmostEqual(self.handle.data.time - before, 0.002, delta=1e-9)

    def test_slow_motion_has_no_hand(self):
        self.press()
        begin = self.fades(lambda: self.viewer.send_to_sim(messages.StepControlSnapshot(speed=50)))
        self.assertIn("full speed", self.felt.text)
        self.viewer.send_to_sim(messages.StepControlSnapshot())
        self.comes_back(begin)

    def test_a_browser_that_is_closed(self):
        self.press()
        wanted = self.wanted
        def close():
            self.wanted = studio.WantedSnapshot(wanted.body, wanted.pose, seen=False)
        begin = self.fades(close)
        self.assertIn("nobody looks", self.felt.text)
        self.wanted = wanted
        self.comes_back(begin)

    def test_a_reset_puts_the_body_where_it_was_and_the_hand_goes_on_from_there(self):
        self.press()
        for key, height in ((None, 0.021), (0, 0.05)):
            with self.subTest(key=key):
                self.wanted = studio.WantedSnapshot(self.wanted.body, (0, 0, height + WEIGHT / HAND, 1, 0, 0, 0), True)
                begin = len(self.server.ticks)
                self.viewer.send_to_sim(messages.ResetEvent(key=key))
                self.run_for(0)
                self.assertAlmostEqual(self.handle.data.body("cube").xpos[2], height, delta=1e-3)
                self.run_for(2)
                self.assertLess(np.abs(np.diff(self.force_since(begin))).max(), 0.5)
                self.assertIn("cube: active", self.felt.text)

    def test_another_model_and_the_same_one_again(self):
        self.press()
        first = self.handle.model
        self.load(SCENE.replace("0.021", "0.0205"))
        self.assertIsNot(self.handle.model, first)
        np.testing.assert_array_equal(first.dof_armature, 0)
        self.comes_back(len(self.server.ticks))
        self.wanted = studio.WantedSnapshot(seen=True)
        self.load(SCENE, "other.xml")
        self.run_for(0.5)
        self.assertIn("Double-click", self.felt.text)
        self.select("cube")  # It has the same number as before.
        self.run_for(0.5)
        self.assertIn("cube: active", self.felt.text)
        self.pause(sim.PauseState.NORMAL_PAUSED)
        self.run_for(0.1)
        self.wanted = studio.WantedSnapshot(seen=True)
        self.load(ROBOT, "third.xml")
        self.run_for(0.5)
        self.assertIn("active", self.felt.text)

    def test_the_end(self):
        self.press()
        model = self.handle.model
        self.handle.close()
        np.testing.assert_array_equal(model.dof_armature, 0)
        self.server.wait(0.1)
        self.assertLess(self.force_since(len(self.server.ticks) - 1)[0], 1e-9)


class Ball(Session):
    def test_a_robot_without_free_bodies_is_touched_with_a_ball(self):
        self.load(ROBOT)
        model, data = self.handle.model, self.handle.data
        ball = model.body(studio.PROBE).id
        mujoco.mj_resetDataKeyframe(mujoco.MjModel.from_xml_string(ROBOT), mujoco.MjData(mujoco.MjModel.from_xml_string(ROBOT)), 0)
        np.testing.assert_allclose(model.key_qpos[0][:1], -0.4)
        np.testing.assert_allclose(model.key_qpos[0][1:4], data.xpos[ball])
        self.run_for(0.5)
        self.assertIn(f"{studio.PROBE}: active", self.felt.text)
        radius, tip = model.geom_size[-1][0], data.geom_xpos[0] + (0.1, 0, 0)
        self.assertFalse(data.ncon)
        over = (tip[0], 0, tip[2] + 0.02 + radius)
        for height in (0.05, 0, -0.015):
            self.wanted = studio.WantedSnapshot(0, (over[0], 0, over[2] + height, 1, 0, 0, 0), True)
            self.run_for(1.5)
        self.assertGreater(self.felt.force[2], 0.5)  # N
        self.assertGreater(data.qpos[0], 0.001)  # The servo gives way.

    def test_it_touches_whatever_collides_and_is_a_ball_whatever_the_model_s_defaults_are(self):
        for text in (ROBOT.replace("<worldbody>", '<default><geom type="capsule" contype="4" conaffinity="2"/></default>'
                                                  "<worldbody>"), ROBOT.replace('<geom type', '<geom contype="2" conaffinity="2" type')):
            self.load(text, f"{len(text)}.xml")
            model = self.handle.model
            self.assertEqual((model.geom_type[-1], *model.geom_pos[-1]), (mujoco.mjtGeom.mjGEOM_SPHERE, 0, 0, 0))
            self.assertTrue(model.geom_contype[-1] & model.geom_conaffinity[0] or model.geom_contype[0] & model.geom_conaffinity[-1])

    def test_files_that_studio_alone_can_load_are_left_to_it(self):
        with self.assertLogs(level="ERROR") as logged:
            self.load("<mujoco><nonsense/></mujoco>", "wrong.xml")
        self.assertIn("wrong.xml", "\n".join(logged.output))
        self.load(SCENE)
        self.assertEqual(self.handle.model.nbody, 5)


class Mouse(unittest.TestCase):
    def test_the_pose_of_the_hand_is_that_of_the_body_which_the_mouse_moves(self):
        model = mujoco.MjModel.from_xml_string(SCENE)
        data = mujoco.MjData(model)
        data.qpos[:7] = 0.1, -0.2, 0.3, 0.5, 0.5, -0.5, 0.5
        mujoco.mj_forward(model, data)
        for name in ("cube", "knob"):
            with self.subTest(name):
                body, turn = model.body(name).id, np.zeros(4)
                mujoco.mju_mulQuat(turn, data.xquat[body], model.body_iquat[body])
                pose = np.array(studio.body_pose(model, body, data.xipos[body], turn))
                np.testing.assert_allclose(pose[:3], data.qpos[:3], atol=1e-9)
                np.testing.assert_allclose(np.abs(pose[3:] @ data.qpos[3:7]), 1, atol=1e-9)


class Drawn(unittest.TestCase):
    """The viewer's side, without a window."""

    def setUp(self):
        model = mujoco.MjModel.from_xml_string(SCENE)
        self.panel, self.sent = studio.HandPanel(), []
        self.viewer = self.panel.viewer = mock.Mock(model=model, data=mujoco.MjData(model), extra_geoms=["another's"])
        self.viewer.perturb = mujoco.MjvPerturb()
        self.viewer.send_to_sim = self.sent.append

    def update(self):
        self.panel.on_update(messages.UpdateEvent())

    def test_the_force_is_an_arrow_and_what_others_draw_stays(self):
        for force in ((0, 0, 2), (1, 0, 0), (0, 0, 0)):
            self.panel.on_felt(studio.FeltSnapshot("cube: active", force, (0, 0, 0.1)))
            self.update()
            drawn = [each for each in self.viewer.extra_geoms if not isinstance(each, str)]
            self.assertEqual(len(drawn), int(any(force)))
            self.assertEqual(len(self.viewer.extra_geoms), 1 + len(drawn))
        np.testing.assert_allclose(drawn, [])

    def test_it_says_what_is_selected_and_where_the_mouse_draws_it(self):
        self.viewer.perturb.select, self.viewer.perturb.refpos = 1, (0.1, 0, 0.2)
        self.viewer.perturb.refquat = 1, 0, 0, 0
        self.update()
        self.assertEqual(self.sent[-1], studio.WantedSnapshot(1, seen=True))
        self.viewer.perturb.active = 1
        self.update()
        self.assertEqual(len(self.sent[-1].pose), 7)

    def test_what_is_in_the_hand_from_the_start_is_selected(self):
        for selected, due in ((0, 2), (1, 1)):
            self.panel.on_felt(studio.FeltSnapshot())
            self.viewer.perturb.select = selected
            self.panel.on_felt(studio.FeltSnapshot("ball: active", body=2))
            self.assertEqual(self.viewer.perturb.select, due)

    def test_browsers_that_look_are_counted(self):
        from mujoco.studio.web import web_server
        browsers, source = studio._Browsers(), pathlib.Path(web_server.__file__).read_text()
        self.addCleanup(browsers.close)
        for text, count in (("[StateWS] Browser connected (%d total)", 2), ("[StateWS] Browser disconnected (%d total)", 0)):
            self.assertIn(f'"{text}"', source)
            web_server.logger.info(text, count)
            self.assertEqual(browsers.count, count)


class Plugins(unittest.TestCase):
    def test_studio_finds_both_in_the_file(self):
        self.assertEqual([type(each).__name__ for each in plugin.load_plugins([studio.__file__])], ["Hand", "HandPanel"])


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
