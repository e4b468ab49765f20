#!/usr/bin/python3
"""haptic.dataset: what is read back from a data set is what the hand felt, contact by contact, and on one clock.

Usage: dataset_test.py LIBHAPTIC PACKAGE_FOLDER HAPTIC_REPLAY [TEST …]
"""

import contextlib
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import types
import unittest
import warnings

LIBRARY, PACKAGE, REPLAY = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
os.environ.update(HAPTIC_LIBRARY=str(LIBRARY), HAPTIC_PROGRAMS=str(REPLAY.parent))
sys.path[:0] = [str(PACKAGE), str(pathlib.Path(__file__).resolve().parents[2] / "support")]

import h5py  # noqa: E402
import haptic_local_model as haptic  # noqa: E402
import numpy as np  # noqa: E402
import virtual_hand  # noqa: E402
from hand_session import push, reach  # noqa: E402
from haptic_local_model import _episodes, dataset, shapes  # noqa: E402
from haptic_local_model.dataset.__main__ import main  # noqa: E402
from haptic_local_model.dataset._clock import clock_of  # noqa: E402
from mcap.reader import make_reader  # noqa: E402

RATE, FPS = 60, 30  # Hz
EDGE, MASS = 0.04, 0.1  # m, kg
FRICTION = 0.5
PRESS = reach(0.5, 0, 0.018) + push(5, 0, -2)  # N
SLIDE = reach(0.5, 0, 0.02) + push(5, 3, -2)  # N
HOVER = reach(5, 0, 0.1)
FOLDER = tempfile.TemporaryDirectory()
HERE = pathlib.Path(FOLDER.name)


def demonstrate(name, hand, seconds=2, gravity=(0, 0, 0), extra=None, options=(), **network):
    """A box over a floor, in a recording NAME.pcap and an episode in the folder NAME. Returns all ticks."""
    with virtual_hand.server(hand, "--record", str(HERE / f"{name}.pcap"), *options, **network) as server:
        with haptic.Session(tool=haptic.box(MASS, [EDGE] * 3), q=(0, 0, 0.03, 1, 0, 0, 0), rate=RATE, gravity=gravity) as touch:
            touch.offer([shapes.half_space(), shapes.box([EDGE] * 3, haptic.TOOL_LINK)], friction=[FRICTION] * 2)
            with touch.episode("press the floor", HERE / name, hand=hand) as episode:
                while server.now < seconds:
                    touch.poll()
                    touch.sample(touch.q, touch.v, 1 / RATE)
                    touch.send()
                    touch.log(now=server.now, qpos=touch.q, image=np.full((4, 6, 3), len(server.ticks) % 256, np.uint8),
                              **(extra or {}))
                episode.success()
        return server.ticks


def made(name, form="hdf5", **options):
    """The data set of what demonstrate() has kept under that name."""
    place = HERE / f"{name}_{len(list(HERE.iterdir()))}.{form}"
    dataset.convert([HERE / f"{name}.pcap"], [HERE / name], form, place, FPS, **options)
    return place


def says(*arguments):
    """The exit code, and what it wrote to standard error."""
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors), contextlib.redirect_stdout(io.StringIO()):
        code = main([str(argument) for argument in arguments])
    return code, errors.getvalue()


class Forces(unittest.TestCase):
    def frames(self, name, *arguments, at=-5, **options):
        """Of a frame towards the end: its contacts' forces, N, one row each, and its mean force, N."""
        demonstrate(name, *arguments, **options)
        with h5py.File(made(name)) as file:
            demo = file["data/demo_0"]
            forces = demo["contact/force"][at]
            return forces[demo["contact/id"][at] >= 0].astype(float), demo["obs/force"][at].astype(float)

    def test_a_press_is_on_four_corners(self):
        contacts, force = self.frames("press", PRESS)
        self.assertEqual(len(contacts), 4)
        np.testing.assert_allclose(contacts[:, 2], 0.5, rtol=0.005)  # N
        np.testing.assert_allclose(force[:3], [0, 0, 2], atol=0.01)  # N

    def test_what_slides_rubs_by_the_law(self):
        contacts, _ = self.frames("slide", SLIDE)
        np.testing.assert_allclose(contacts.sum(axis=0), [-FRICTION * 2, 0, 2], rtol=0.005, atol=0.005)  # N

    def test_a_weight_is_no_contact(self):
        contacts, force = self.frames("weigh", HOVER, gravity=(0, 0, -9.81))
        self.assertEqual(len(contacts), 0)
        np.testing.assert_allclose(force[:3], [0, 0, -9.81 * MASS], rtol=0.005, atol=1e-9)  # N


class ReadBack(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.ticks = demonstrate("read", PRESS)
        cls.file = made("read")

    def test_the_ticks_are_the_servers(self):
        ticks = self.ticks[self.ticks["step"] > 0]
        with h5py.File(self.file) as file:
            stream = file["streams/demo_0/tick_force"]
            count = len(stream["time"])
            self.assertGreater(count, 1900)
            expected = np.column_stack([ticks[f"env_force_{axis}_N"] for axis in "xyz"])[:count]
            np.testing.assert_array_equal(stream["value"][:, :3], expected.astype(np.float32))

    def test_the_windows_sum_to_the_impulse_of_the_ticks(self):
        with h5py.File(self.file) as file:
            demo, stream = file["data/demo_0"], file["streams/demo_0/tick_force"]
            window, impulse = demo["obs/force_window"][:], demo["obs/impulse"][:]
            np.testing.assert_allclose(np.nansum(window, axis=1) * 0.001, impulse, atol=1e-6)  # N s
            inside = stream["time"][:] <= (demo.attrs["num_samples"] - 1) / FPS + 1e-9
            np.testing.assert_allclose(impulse.sum(axis=0), stream["value"][:][inside].astype(float).sum(axis=0) * 0.001, atol=1e-6)
            self.assertEqual(np.isnan(window[5:]).any(axis=2).sum(axis=1).max(), 1)  # 33 or 34 ticks
            self.assertTrue((np.isfinite(window[5:, -1])).all())

    def test_contacts_add_up_to_the_force(self):
        with h5py.File(self.file) as file:
            demo = file["data/demo_0"]
            sums, force = np.nansum(demo["contact/force"], axis=1), demo["obs/force"][:, :3]
            landing = np.flatnonzero(force[:, 2] > 0)[0]  # That has the impulse of a collision besides.
            np.testing.assert_allclose(np.delete(sums, landing, 0), np.delete(force, landing, 0), atol=1e-5)  # N

    def test_mcap_has_each_tick_and_the_contacts(self):
        with open(made("read", "mcap"), "rb") as file, h5py.File(self.file) as other:
            said = [(channel.topic, message.log_time, json.loads(message.data)) for _, channel, message in make_reader(file).iter_messages()]
            force = other["streams/demo_0/tick_force/value"][:, 2]
            heard = [message["force"]["z"] for topic, _, message in said if topic == "/hand/wrench"]
            np.testing.assert_allclose(heard, force, atol=1e-6)  # N
            contacts = [message["contacts"] for topic, _, message in said if topic == "/contacts"]
            self.assertEqual(len(contacts), other["data/demo_0"].attrs["num_samples"])
            self.assertEqual(len(contacts[-3]), 4)
            self.assertEqual([message["mark"] for topic, _, message in said if topic == "/episode"], ["begin", "end"])
            arrow = [message for topic, _, message in said if topic == "/contacts/arrows"][-3]["entities"][0]["arrows"][0]
            turned = arrow["pose"]["orientation"]
            # The shaft's own x axis, turned, is z.
            self.assertAlmostEqual(2 * (turned["x"] * turned["z"] - turned["w"] * turned["y"]), 1, delta=1e-3)

    def test_mcap_of_a_recording_alone(self):
        place = HERE / "alone.mcap"
        dataset.convert([HERE / "read.pcap"], [], "mcap", place, FPS)
        self.assertRegex(dataset.check(place)[0], "1 episodes, 6. frames")

    def test_contacts_are_told_apart_by_names_too(self):
        numbers, parts = dataset.ContactNumbers(), np.zeros(1, dataset.CONTACT_PART)
        parts["identity"], parts["a_kind"], parts["b_kind"], parts["b"] = 7, haptic.TOOL_LINK, haptic.MOVABLE_BODY, 1
        cube, ball = (types.SimpleNamespace(bodies={"1": name}) for name in ("cube", "ball"))
        self.assertEqual([int(numbers.of(parts, each)[0]) for each in (cube, ball, cube, None)], [0, 1, 0, 2])
        self.assertEqual([each["b"] for each in numbers.described()], ["cube", "ball", "body 1"])

    def test_the_check_says_what_is_inside(self):
        lines = dataset.check(self.file)
        self.assertRegex(lines[0], r"1 episodes, 6\d frames at 30 Hz, 2\.0 s; ticks at 1000 Hz; 4 contacts")
        self.assertIn("outcomes: 1 success", lines)

    def test_a_recording_alone_is_one_episode_without_a_mark(self):
        place = HERE / "alone.hdf5"
        dataset.convert([HERE / "read.pcap"], [], "hdf5", place, FPS)
        with h5py.File(place) as file, h5py.File(self.file) as other:
            self.assertEqual(file["data/demo_0"].attrs["outcome"], "unmarked")
            self.assertAlmostEqual(file["data/demo_0/obs/force"][-5, 2], other["data/demo_0/obs/force"][-5, 2], delta=1e-5)


class Clock(unittest.TestCase):
    def test_simulator_and_hand_agree_within_a_millisecond_over_any_network(self):
        for number, network in enumerate(({"delay": 0.05}, {"delay": 0.02, "jitter": 0.01, "loss": 0.1})):
            with self.subTest(**network):
                demonstrate(f"clock{number}", PRESS, **network)
                with h5py.File(made(f"clock{number}")) as file:
                    d = next(dataset.demonstrations([HERE / f"clock{number}.pcap"],
                                                    dataset.find_episodes([HERE / f"clock{number}"])[0], FPS))
                    stream = file["streams/demo_0/now"]
                    np.testing.assert_allclose(stream["time"][:] + d.timing.begin, stream["value"][:], atol=0.001)  # s

    def test_an_episode_may_begin_with_its_session(self):
        """Before it knows the round trip the server takes updates for new."""
        for rate in (1000, 4000):
            with self.subTest(rate=rate):
                demonstrate(f"first{rate}", PRESS, seconds=1, delay=0.1, options=("--rate", str(rate)))
                found, = dataset.demonstrations([HERE / f"first{rate}.pcap"], dataset.find_episodes([HERE / f"first{rate}"])[0], FPS,
                                                ("--rate", str(rate)))
                self.assertLess(abs(found.timing.clock.offset), 0.001)  # s: both clocks are one here.
                self.assertLess(abs(found.timing.begin - found.episode.updates["sampled"][0]), 0.001)  # s

    def test_a_set_says_where_no_age_is_known(self):
        demonstrate("short", PRESS, seconds=0.35, delay=0.1)
        said = "\n".join(dataset.check(made("short")))
        self.assertRegex(said, "clocks: in 1 episodes the server attributed no age to updates")
        demonstrate("long", PRESS, seconds=1, delay=0.1)
        self.assertNotIn("attributed no age", "\n".join(dataset.check(made("long"))))

    def test_a_clock_that_is_slower_is_followed(self):
        random = np.random.default_rng(1)
        sampled = np.arange(0, 300, 1 / 60)
        for rate in (0, 1e-4, -5e-5):
            taken = sampled * (1 + rate) + 7 + 0.02 + random.uniform(0, 0.005, len(sampled))
            clock = clock_of(list(zip(sampled, taken, np.full(len(sampled), 0.02))), finds_jumps=True)
            np.testing.assert_allclose(clock.to_server(sampled), sampled * (1 + rate) + 7, atol=0.001)  # s

    def test_a_clock_that_jumps_is_named(self):
        demonstrate("jump", PRESS)
        updates = next((HERE / "jump").iterdir()) / "updates.npy"
        rows = np.load(updates)
        rows["sampled"][len(rows) * 3 // 4:] += 0.1  # s
        np.save(updates, rows)
        with self.assertRaisesRegex(haptic.HapticError, r"jump/.*: its clock jumps against the server's, by 0\.1"):
            made("jump")


class Again(unittest.TestCase):
    def test_the_same_hand_on_a_stiffer_floor(self):
        options, coupling = ("--stiffness", "1000", "--coupling-stiffness", "1500"), 1500  # N/m
        demonstrate("again", PRESS, options=options)
        places = dataset.again([HERE / "again.pcap"], [HERE / "again"], "hdf5", HERE / "again_sets",
                               {"stiffness": ["1000", "2000"]}, fps=FPS, options=options)
        self.assertEqual([place.name for place in places], ["stiffness=1000.hdf5", "stiffness=2000.hdf5"])
        for place, stiffness in zip(places, (1000, 2000)):
            with h5py.File(place) as file:
                self.assertEqual(json.loads(file.attrs["haptic"])["again"], {"stiffness": str(stiffness)})
                depth = EDGE / 2 - float(file["data/demo_0/actions"][-5, 2])  # m: of the handle, which is where it was
                self.assertAlmostEqual(depth, 2 / (4 * 1000), delta=1e-6)  # m
                # The hand pushes as it did, 2 N, and what the proxy lacks to the handle's depth pulls it.
                due = (2 + coupling * depth) / (1 + coupling / (4 * stiffness))
                self.assertAlmostEqual(float(file["data/demo_0/obs/force"][-5, 2]), due, delta=0.005 * due)  # N

    def test_news_of_the_world_that_come_later(self):
        ticks = demonstrate("late", PRESS)
        places = dataset.again([HERE / "late.pcap"], [HERE / "late"], "hdf5", HERE / "late_sets", {"delay": ["0", "0.05"]}, fps=FPS)
        handles, first = [], []
        for place in places:
            with h5py.File(place) as file:
                demo = file["data/demo_0"]
                handles.append(demo["actions"][:])
                first.append(file["streams/demo_0/tick_force/time"][0])
        np.testing.assert_array_equal(handles[0][5:], handles[1][5:])  # Each frame is the same moment.
        self.assertAlmostEqual(first[1] - first[0], 0.05, delta=0.0011)  # s
        self.assertGreater(len(ticks), 0)

    def test_a_frame_without_a_tick_knows_nothing(self):
        demonstrate("unknown", PRESS)
        place, = dataset.again([HERE / "unknown.pcap"], [HERE / "unknown"], "hdf5", HERE / "unknown_sets", {"delay": ["1"]}, fps=FPS)
        with h5py.File(place) as file:
            demo = file["data/demo_0"]
            without = np.isnan(demo["obs/force"][:, 0])
            self.assertGreater(without.sum(), 25)
            for name in ("actions", "obs/state", "obs/impulse", "contact/force"):
                self.assertTrue(np.isnan(demo[name][:][without]).all(), name)
            self.assertTrue((demo["contact/id"][:][without] == -1).all())
        self.assertRegex("\n".join(dataset.check(place)), rf"missing: {without.sum()} frames have no force")

    def test_a_value_that_cannot_be_leaves_nothing(self):
        demonstrate("half", PRESS)
        given = [HERE / "half.pcap"], [HERE / "half"], "hdf5", HERE / "half_sets"
        for changes, said in (({"stiffness": ["1000", "hard"]}, "stiffness"), ({"rate": ["500"]}, "--again rate must be one of delay, friction"),
                              ({"stiffness": ["1000", "1000"]}, "--again stiffness=1000 must be a value, once"),
                              ({"delay": ["0.0004"]}, "--late 0.0004 must be whole periods of the loop, 0.001 s each"),
                              ({"delay": ["5"]}, "it has no tick with --late 5")):
            with self.subTest(said), self.assertRaisesRegex(haptic.HapticError, said):
                dataset.again(*given, changes)
            self.assertEqual([path.name for path in HERE.iterdir() if "half_sets" in path.name or path.name.startswith(".")], [])

    def test_with_other_options_nothing_is_made(self):
        demonstrate("other", PRESS, options=("--stiffness", "1000"))
        with self.assertRaisesRegex(haptic.HapticError, r"other\.pcap does not come back as it was: it was recorded with other options: give the server's"):
            made("other")
        self.assertEqual(list(HERE.glob("other_*")), [])
        made("other", options=("--stiffness", "1000"))


class WrongInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        demonstrate("good", PRESS)

    def test_each_gets_one_line_and_leaves_nothing(self):
        recording, episodes = HERE / "good.pcap", HERE / "good"
        episode = next(episodes.iterdir())
        cut, foreign, unended, bare, there = (HERE / name for name in ("cut.pcap", "foreign.pcap", "unended", "bare", "there.hdf5"))
        cut.write_bytes(recording.read_bytes()[:150_000])
        foreign.write_bytes(b"no capture at all")
        shutil.copytree(episode, unended / "20260101T000000_0000.part")
        bare.mkdir()
        there.write_text("mine")
        outside = HERE / "outside"
        for inputs, out, said in (
                ((cut, episodes), "x.hdf5", r"good/\S+: its recording ends 1\.\d+ s before it, as one that was cut"),
                ((foreign, episodes), "x.hdf5", "foreign.pcap: .*unknown file format"),
                ((HERE / "none.pcap", episodes), "x.hdf5", "none.pcap' must be a file that haptic_server --record has written"),
                ((recording, unended), "x.hdf5", "has no end: its program was ended, or its disk was full"),
                ((recording, bare), "x.hdf5", "there are no episodes in .*bare"),
                ((episodes,), "x.hdf5", "episode .*: no recording knows it: give the one of its server"),
                ((recording, episodes), "there.hdf5", "there.hdf5 must not be there yet"),
                ((recording, episodes, "--fps", "0"), "x.hdf5", "fps 0 must be 1 to 1000 Hz"),
                ((recording, episodes, "--contacts", "0"), "x.hdf5", "contacts 0 must be a whole number of 1 to 64"),
                ((recording, episodes, "--again", "stiffness"), "x", "--again stiffness must be NAME=VALUE"),
                ((recording, episodes, "--again", "delay=soon"), "x", "delay=soon must be a time, as 0.05 or 50ms"),
                ((recording, episodes, "--again", "stiffness=hard"), "x", "stiffness"),
                ((recording, episodes, "--", "--nonsense"), "x.hdf5", "nonsense"),
                ((recording, episodes, "--", "--late", "0.1"), "x.hdf5", "--late must be an option of haptic_server"),
                ((recording, episodes, "--state", "force"), "x.hdf5", "--state force must be of --to lerobot, not hdf5"),
                ((recording, episodes), "x" * 300, "cannot be written: "),
                ((recording, episodes), "good.pcap/x.hdf5", "x.hdf5 cannot be written: ")):
            with self.subTest(said):
                code, errors = says(*inputs[:2], "--to", "hdf5", "--out", HERE / out, *inputs[2:])
                self.assertEqual(code, 2)
                self.assertRegex(errors, f"^haptic_dataset: .*{said}")
                self.assertEqual(len(errors.splitlines()), 1)
                self.assertEqual(list(HERE.glob("x.hdf5*")) + list(HERE.glob("x/*")) + list(HERE.glob("*.part")), [])
        self.assertEqual(there.read_text(), "mine")
        code, errors = says("--check", outside)
        self.assertEqual((code, len(errors.splitlines())), (2, 1))

    def test_damaged_files_are_named(self):
        for name, content, said in (("qpos.npy", b"", "qpos.npy cannot be read"), ("qpos.npy", b"PK\x03\x04", "qpos.npy cannot be read"),
                                    ("updates.npy", (HERE / "good").glob("*/qpos.npy").__next__().read_bytes(), "updates.npy must have rows of"),
                                    ("episode.json", b"[]", "episode.json is no description of an episode"),
                                    ("episode.json", b'{"format": 2}', "episode.json is no description of an episode")):
            with self.subTest(name=name, content=content[:10]), tempfile.TemporaryDirectory() as folder:
                copy = shutil.copytree(next((HERE / "good").iterdir()), pathlib.Path(folder) / "one")
                (copy / name).write_bytes(content)
                code, errors = says(HERE / "good.pcap", folder, "--to", "hdf5", "--out", pathlib.Path(folder) / "x.hdf5")
                self.assertEqual((code, len(errors.splitlines())), (2, 1))
                self.assertRegex(errors, said)

    def test_what_others_have_there_stays(self):
        mine = HERE / "others.hdf5.part"
        mine.mkdir()
        (mine / "file").write_text("mine")
        dataset.convert([HERE / "good.pcap"], [HERE / "good"], "hdf5", HERE / "others.hdf5", FPS)
        self.assertEqual((mine / "file").read_text(), "mine")
        shutil.rmtree(mine)
        (HERE / "others2.hdf5.json").write_text("mine")
        with self.assertRaisesRegex(haptic.HapticError, "others2.hdf5.json must not be there yet"):
            dataset.convert([HERE / "good.pcap"], [HERE / "good"], "hdf5", HERE / "others2.hdf5", FPS)

    def test_a_set_that_is_cut_is_told_from_a_whole_one(self):
        for form in ("mcap", "hdf5"):
            place = made("good", form)
            place.write_bytes(place.read_bytes()[:1000])
            code, errors = says("--check", place)
            self.assertEqual((code, len(errors.splitlines())), (2, 1))
            self.assertRegex(errors, "is no whole data set")

    def test_one_that_cannot_be_used_leaves_the_others(self):
        both = HERE / "some"
        shutil.copytree(HERE / "good", both)
        other = shutil.copytree(next(both.iterdir()), both / "20260101T000000_0001")
        rows = np.load(other / "updates.npy")
        rows["session"] += 1
        np.save(other / "updates.npy", rows)
        about = dataset.convert([HERE / "good.pcap"], [both], "hdf5", HERE / "some.hdf5", FPS)
        self.assertEqual(len(about["episodes"]), 1)
        self.assertRegex("\n".join(about["left_out"]), r"episode \S+_0001: no recording knows it: give the one of its server")

    def test_an_episode_without_its_end_is_left_out_and_named(self):
        both = HERE / "both"
        shutil.copytree(HERE / "good", both)
        shutil.copytree(next(both.iterdir()), both / "20260101T000000_0000.part")
        place = HERE / "both.hdf5"
        about = dataset.convert([HERE / "good.pcap"], [both], "hdf5", place, FPS)
        self.assertEqual(len(about["episodes"]), 1)
        self.assertRegex("\n".join(dataset.check(place)), r"left out: \S+0000\.part has no end")


class Marks(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(dir=HERE))

    def touch(self):
        state = types.SimpleNamespace(buttons=0, servo_rate=1000)
        return types.SimpleNamespace(now=1.0, state=state, running=True, current_episode=None)

    def open(self, touch, **options):
        return _episodes.open_episode(touch, "task", self.folder, options.pop("buttons", None), options)

    def kept(self):
        return [(path.suffix, json.loads((path / "episode.json").read_text())["outcome"]) for path in self.folder.iterdir()]

    def test_a_buttons_edge_marks_and_ends(self):
        touch = self.touch()
        touch.state.buttons = 2  # Down before: no mark.
        with self.open(touch, buttons={1: "failure", 0: "success"}) as episode:
            episode.sent(1, 1)
            self.assertTrue(episode.running)
            touch.state.buttons = 3
            episode.sent(1, 2)
            self.assertFalse(episode.running)
        self.assertEqual(self.kept(), [("", "success")])

    def test_the_first_mark_stands_and_the_end_is_the_end(self):
        touch = self.touch()
        with self.open(touch, buttons={1: "failure"}) as episode:
            touch.state.buttons = 2
            episode.sent(1, 1)
            episode.success()
        self.assertEqual(self.kept(), [("", "failure")])
        for use in (episode.success, episode.discard, lambda: episode.log(x=1)):
            with self.assertRaisesRegex(haptic.HapticError, r"the episode \S+_0000 has ended"):
                use()

    def test_whole_numbers_may_be_followed_by_others(self):
        with self.open(self.touch()) as episode:
            for reward in (0, 0.75, np.float32(0.5)):
                episode.log(reward=reward)
        np.testing.assert_array_equal(np.load(episode.path / "reward.npy"), [0, 0.75, 0.5])

    def test_the_end_of_a_program_ends_it(self):
        subprocess.run([sys.executable, "-c", f"""import types, haptic_local_model as haptic
from haptic_local_model import _episodes
touch = types.SimpleNamespace(now=1.0, state=types.SimpleNamespace(buttons=0), running=True, current_episode=None)
_episodes.open_episode(touch, "task", {str(self.folder)!r}, None, {{}}).log(x=1)"""], check=True,
                       env={**os.environ, "PYTHONPATH": str(PACKAGE)})
        self.assertEqual(self.kept(), [("", "unmarked")])

    def test_what_is_discarded_is_gone_and_what_fails_is_kept(self):
        with self.open(self.touch()) as episode:
            episode.log(x=1)
            episode.discard()
        self.assertEqual(self.kept(), [])
        with self.assertRaises(ZeroDivisionError), self.open(self.touch()) as episode:
            episode.log(x=1 / 0)
        self.assertEqual(self.kept(), [("", "interrupted")])

    def test_a_full_disk_ends_the_episode_and_not_the_session(self):
        touch = self.touch()
        with self.open(touch) as episode, warnings.catch_warnings(record=True) as warned:
            warnings.simplefilter("always")
            episode.log(x=np.zeros(10))
            of_stream = episode._streams["x"][0]
            of_stream._file.close()
            of_stream._file = open("/dev/full", "wb", buffering=0)
            episode.log(x=np.zeros(10))
            self.assertFalse(episode.running)
            episode.log(x=np.zeros(10))
            episode.sent(1, 1)
        self.assertEqual(len(warned), 1)
        self.assertRegex(str(warned[0].message), "No space left on device; the episode ends here")
        self.assertEqual([suffix for suffix, _ in self.kept()], [".part"])

    def test_wrong_uses_get_one_line(self):
        touch = self.touch()
        with self.open(touch) as episode:
            episode.log(image=np.zeros((4, 5, 3), np.uint8))
            for use, said in ((lambda: episode.log(image=np.zeros((4, 6, 3), np.uint8)),
                               r"image has the shape \(4, 6, 3\), and had \(4, 5, 3\) before in this episode"),
                              (lambda: episode.log(name="text"), "name must be numbers of at most 64 bits each, and at most 2 GB of them, not 'text'"),
                              (lambda: episode.log(force=1), "stream 'force' must have an identifier as its name, which is none of updates, state"),
                              (lambda: episode.log(image=np.full((4, 5, 3), 0.5)), "image is float64 .*, and was uint8 before in this episode"),
                              (lambda: episode.log(x=[[1], [1, 2]]), "x must be numbers"),
                              (lambda: episode.log(updates=1), "stream 'updates' must have an identifier as its name"),
                              (lambda: self.open(touch), r"the episode \S+ must end before another begins"),
                              (lambda: self.open(self.touch(), buttons={40: "success"}), "button 40 must be a whole number of 0 to 31"),
                              (lambda: self.open(self.touch(), buttons={4: "won"}), "outcome 'won' must be one of success, failure"),
                              (lambda: self.open(self.touch(), model=object()), "what is said of an episode must be JSON")):
                with self.subTest(said), self.assertRaisesRegex(haptic.HapticError, said):
                    use()
            episode.success()
        self.assertEqual(self.kept(), [("", "success")])


if __name__ == "__main__":
    sys.argv[1:4] = []
    unittest.main(verbosity=2)
