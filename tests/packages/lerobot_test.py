#!/usr/bin/python3
"""The plug-in lerobot_teleoperator_haptic: LeRobot finds it by its name, and what its own loop records is what was felt. And the
data sets of haptic.dataset: LeRobot reads them, and a policy learns from them.

Usage: lerobot_test.py HAPTIC_SERVER LIBHAPTIC [TEST …]
"""

import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from given import PYTHON, SERVER, main

import torch

FOLDER = tempfile.TemporaryDirectory()
os.environ.update(HF_HUB_OFFLINE="1", HF_LEROBOT_HOME=FOLDER.name, HF_HOME=FOLDER.name, PYNPUT_BACKEND="dummy")
# Torchvision's own operators are for another PyTorch. LeRobot uses none of them, but a name must be there.
torch.library.define("torchvision::nms", "(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")


def install(package):
    """As a user would, from a copy, as a build leaves files behind."""
    copy = shutil.copytree(PYTHON / package, pathlib.Path(FOLDER.name) / "source" / package)
    place = str(pathlib.Path(FOLDER.name) / "installed")
    subprocess.run([sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check", "install", "--no-index",
                    "--no-deps", "--no-build-isolation", "--target", place, copy], check=True)
    # The folder of the package haptic has the source of the plug-in, too: that which was installed is to be found.
    sys.path.insert(0, place)


install("lerobot_teleoperator_haptic")

import h5py  # noqa: E402
import haptic_local_model as haptic  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from hand_session import mean, push, reach, server  # noqa: E402
from lerobot.datasets.lerobot_dataset import LeRobotDataset  # noqa: E402
from lerobot.datasets.utils import dataset_to_policy_features, hw_to_dataset_features  # noqa: E402
from lerobot.policies.act.configuration_act import ACTConfig  # noqa: E402
from lerobot.policies.act.modeling_act import ACTPolicy  # noqa: E402
from lerobot.policies.factory import make_pre_post_processors  # noqa: E402
from lerobot.processor import RobotProcessorPipeline, make_default_processors  # noqa: E402
from lerobot.processor.converters import robot_action_observation_to_transition, transition_to_robot_action  # noqa: E402
from lerobot.robots import Robot, RobotConfig  # noqa: E402
from lerobot.scripts.lerobot_record import record_loop  # noqa: E402
from lerobot.teleoperators import TeleoperatorConfig, make_teleoperator_from_config  # noqa: E402
from lerobot.utils.import_utils import register_third_party_plugins  # noqa: E402

FPS = 30
FLOOR = 1000  # N/m, of the floor at z = 0


class Arm(Robot):
    """A robot whose end effector goes where it is told, over a floor, with a force sensor."""
    config_class, name = RobotConfig, "arm"
    is_connected = is_calibrated = True
    action_features = dict.fromkeys(("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz", "ee.gripper_pos"), float)
    observation_features = dict.fromkeys(("ee.z", "force.x", "force.y", "force.z"), float)

    def __init__(self, teleop):
        super().__init__(RobotConfig())
        self.z, self._teleop, self._times = 0.0, teleop, []

    def times(self):
        """Of the observations, s since force came on."""
        return np.array([at for at, _ in self._times]) - next(at for at, state in self._times if state == "active")

    def get_observation(self):
        self._times.append((time.monotonic(), self._teleop.touch.server_state))
        return {"ee.z": self.z, "force.x": 0.0, "force.y": 0.0, "force.z": FLOOR * max(0, -self.z)}

    def send_action(self, action):
        self.z = action["ee.z"]
        return action

    def connect(self, calibrate=True): ...
    def calibrate(self): ...
    def configure(self): ...
    def disconnect(self): ...


def teleoperator(**config):
    register_third_party_plugins()
    return make_teleoperator_from_config(TeleoperatorConfig.get_choice_class("haptic")(**config))


class Plugin(unittest.TestCase):
    def test_lerobot_finds_it_by_its_name(self):
        register_third_party_plugins()
        self.assertIn("haptic", TeleoperatorConfig.get_known_choices())
        made = teleoperator(id="right")
        self.assertEqual(type(made).__name__, "HapticTeleoperator")
        self.assertIn("installed", sys.modules[type(made).__module__].__file__)
        self.assertFalse(made.is_connected)
        self.assertEqual(set(made.action_features), set(Arm.action_features))

    def test_the_command_line_knows_its_options(self):
        told = subprocess.run(
            [sys.executable, "-c", "import torch; torch.library.define('torchvision::nms', '(Tensor dets, Tensor scores, "
             "float iou_threshold) -> Tensor'); from lerobot.scripts.lerobot_teleoperate import main; main()", "--help"],
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path[:3])}, stdout=subprocess.PIPE, text=True).stdout
        self.assertRegex(told, r"--teleop.grasp_button")

    def test_what_is_wrong_is_named(self):
        made = teleoperator(server="127.0.0.1:9")
        with self.assertRaisesRegex(haptic.HapticError, "not connected"):
            made.get_action()
        made.connect()
        with self.assertRaisesRegex(haptic.HapticError, r"feedback has no force.y; it must have force.x, force.y, force.z, N"):
            made.send_feedback({"force.x": 0.0, "force.z": 1.0})
        with self.assertRaisesRegex(haptic.HapticError, "wrench"):
            made.send_feedback({"force.x": 0.0, "force.y": 0.0, "force.z": np.nan})
        made.disconnect()


class Set(unittest.TestCase):
    """What haptic.dataset makes of a recording, as LeRobot reads it."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(FOLDER.name) / "set"
        recording, demonstrations = cls.folder / "run.pcap", cls.folder / "demonstrations"
        cls.folder.mkdir()
        with virtual_hand.server(reach(0.5, 0, 0.018) + push(5, 0, -2), "--record", str(recording), delay=0.02) as running:
            with haptic.Session(tool=haptic.box(0.1, [0.04] * 3), q=(0, 0, 0.03, 1, 0, 0, 0), rate=60, gravity=(0, 0, 0)) as touch:
                touch.offer([haptic.shapes.half_space(), haptic.shapes.box([0.04] * 3, haptic.TOOL_LINK)])
                for outcome in ("success", "failure"):
                    with touch.episode("press", demonstrations) as episode:
                        for _ in range(120):
                            touch.poll()
                            touch.sample(touch.q, touch.v, 1 / 60)
                            touch.send()
                            touch.log(qpos=touch.q, camera=np.full((32, 48, 3), int(100 * running.now) % 256, np.uint8))
                        getattr(episode, outcome)()
        cls.given = [recording], [demonstrations]
        haptic.dataset.convert(*cls.given, "lerobot", cls.folder / "lerobot", FPS, state=("force", "qpos"))
        haptic.dataset.convert(*cls.given, "hdf5", cls.folder / "set.hdf5", FPS)

    def test_it_is_read_back_as_it_is(self):
        read = LeRobotDataset("local/set", root=self.folder / "lerobot", delta_timestamps={"observation.force": [-1 / FPS, 0]})
        with h5py.File(self.folder / "set.hdf5") as file:
            demos = [file["data"][name] for name in ("demo_0", "demo_1")]
            self.assertEqual([demo.attrs["num_samples"] for demo in demos], list(read.meta.episodes["length"]))
            frame, demo = read[40], demos[0]
            for name in ("force_window", "force_peak", "impulse", "qpos"):
                np.testing.assert_allclose(frame[f"observation.{name}"], demo[f"obs/{name}"][40], rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(frame["observation.force"], demo["obs/force"][39:41], rtol=1e-6, atol=1e-9)
            np.testing.assert_allclose(frame["action"], demo["actions"][40], rtol=1e-6)
            np.testing.assert_allclose(frame["contact.force"], demo["contact/force"][40], rtol=1e-6)
            np.testing.assert_allclose(frame["observation.images.camera"] * 255, np.moveaxis(demo["obs/camera"][40], -1, 0), atol=0.01)
            np.testing.assert_allclose(frame["observation.state"][14:20], demo["obs/force"][40], rtol=1e-6, atol=1e-9)
        self.assertEqual(frame["task"], "press")
        self.assertEqual([bool(read[int(end) - 1]["next.success"]) for end in read.meta.episodes["dataset_to_index"]], [True, False])

    def test_a_policy_takes_a_step_on_it(self):
        read = LeRobotDataset("local/set", root=self.folder / "lerobot", delta_timestamps={"action": [i / FPS for i in range(8)]})
        features = dataset_to_policy_features(read.meta.features)
        config = ACTConfig(input_features={name: features[name] for name in ("observation.state", "observation.images.camera")},
                           output_features={"action": features["action"]}, chunk_size=8, n_action_steps=8, device="cpu",
                           pretrained_backbone_weights=None)
        before, _ = make_pre_post_processors(config, dataset_stats=read.meta.stats)
        batch = before(next(iter(torch.utils.data.DataLoader(read, batch_size=4))))
        policy = ACTPolicy(config)
        loss, _ = policy.forward(batch)
        loss.backward()
        self.assertTrue(torch.isfinite(loss))
        self.assertTrue(all(torch.isfinite(each.grad).all() for each in policy.parameters() if each.grad is not None))

    def test_episodes_of_different_streams_are_named(self):
        other = shutil.copytree(self.given[1][0], self.folder / "other")
        last = sorted(other.iterdir())[-1]
        np.save(last / "camera.npy", np.zeros((120, 16, 48, 3), np.uint8))
        with self.assertRaisesRegex(haptic.HapticError, r"0001: observation.images.camera is image \(16, 48, 3\), and image "
                                    r"\(32, 48, 3\) in the first episode"):
            haptic.dataset.convert(self.given[0], [other], "lerobot", self.folder / "no", FPS)
        self.assertEqual(list(self.folder.glob("no*")), [])


class Recording(unittest.TestCase):
    def test_the_force_in_a_recorded_demonstration_is_what_was_felt(self):
        """The hand presses with 1, 2 and 3 N for 3 s each."""
        hand = reach(1, 0, 0.002) + push(3, 0, -1) + push(3, 0, -2) + push(60, 0, -3)
        with server(SERVER, hand) as running:
            made = teleoperator(server=running.address, rate=FPS)
            robot = Arm(made)
            made.connect()
            steps = RobotProcessorPipeline(
                steps=[sys.modules[type(made).__module__].FeelObservation(made)],
                to_transition=robot_action_observation_to_transition, to_output=transition_to_robot_action)
            _, of_robot, of_observation = make_default_processors()
            features = {**hw_to_dataset_features(robot.action_features, "action"),
                        **hw_to_dataset_features(robot.observation_features, "observation")}
            dataset = LeRobotDataset.create("local/pressed", FPS, features, root=pathlib.Path(FOLDER.name) / "pressed",
                                            use_videos=False)
            record_loop(robot=robot, teleop=made, events={"exit_early": False}, fps=FPS, control_time_s=11,
                        teleop_action_processor=steps, robot_action_processor=of_robot,
                        robot_observation_processor=of_observation, dataset=dataset, single_task="press")
            made.disconnect()
            ticks = running.ticks()
        dataset.save_episode()
        dataset.finalize()
        read = LeRobotDataset("local/pressed", root=pathlib.Path(FOLDER.name) / "pressed")
        column = read.features["observation.state"]["names"].index("force.z")
        recorded = np.array([float(frame["observation.state"][column]) for frame in read.hf_dataset])
        times = robot.times()
        for end, due in ((4, 1), (7, 2), (9.8, 3)):
            felt, _ = mean(ticks, "env_force_z_N", end - 0.8, end - 0.1)
            there = recorded[(times > end - 0.8) & (times < end - 0.1)].mean()
            print(f"pressed with {due} N: felt {felt:.4f} N, recorded {there:.4f} N, {100 * (there / felt - 1):+.2f} %")
            self.assertAlmostEqual(felt, due, delta=0.02 * due)
            self.assertAlmostEqual(there, felt, delta=0.02 * felt)


if __name__ == "__main__":
    main()
