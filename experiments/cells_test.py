"""Cells of the experiments: each runs alone, in any order, and whatever ends a run on the way, the tables are the same bytes.

Usage: cells_test.py EXPERIMENTS SCRIPTS [Test …]
"""

import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
SCRIPTS = pathlib.Path(sys.argv[2]).resolve()
WORLDS = SCRIPTS.parent / "worlds"
sys.path.insert(0, str(SCRIPTS))
import sweeps  # noqa: E402

MIXED = ["--quick", "--seeds", "2", "--only", "fig06", "approach", "external", "collisions", "updates"]


def run(*arguments, program=PROGRAM, **options):
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=300, check=False, **options)


def tables(folder):
    return {path.name: path.read_bytes() for path in pathlib.Path(folder).glob("*.csv")}


def files(folder):
    return {path.name: path.stat().st_mtime_ns for path in pathlib.Path(folder).glob("cells/*/*.json")}


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.temporary.name)

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def refused(self, *arguments, names, **options):
        done = run(*arguments, **options)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for name in names:
            self.assertIn(name, done.stderr)


class Mixed(Case):
    """Some 90 cells of five experiments."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.whole = cls.root / "whole"
        done = run(*MIXED, "--out", cls.whole)
        assert done.returncode == 0, done.stdout + done.stderr
        cls.due = tables(cls.whole)
        cls.cells = [line.split("\t") for line in run(*MIXED, "--list-cells").stdout.splitlines()]

    def test_list_names_each_cell_once_with_what_it_is(self):
        names = [cell[0] for cell in self.cells]
        self.assertEqual(len(set(names)), len(names))
        self.assertEqual(sorted(f"{name}.json" for name in names), sorted(files(self.whole)))
        conditions = [tuple(cell[1:5]) for cell in self.cells]
        self.assertEqual(len(set(conditions)), len(conditions))
        for cell in self.cells:
            self.assertEqual(len(cell), 6, cell)
            self.assertGreater(float(cell[5]), 0)

    def test_a_file_says_what_it_is_of(self):
        written = json.loads((self.whole / "cells/fig06/fig06-00001.json").read_text())
        self.assertEqual(written["inputs"], {"method": "ir", "rate_hz": 512, "seed": 1})
        self.assertGreater(written["results"]["farthest"], 0.5)  # m: IR throws the peg out.
        for key in ("arguments", "host", "seconds", "peak_memory_MB"):
            self.assertIn(key, written)
        self.assertEqual(sorted(written["program"]), ["commit", "compiler", "executable", "flags", "worlds"])

    def test_seven_workers_give_the_same_bytes(self):
        sweep = sweeps.Sweep(self.root / "seven")
        sweep.begin(PROGRAM, MIXED, False)
        self.assertTrue(sweeps.run_here(sweep, list(reversed(sweep.left({"left"}))), 7, 60))
        self.assertEqual(sweep.run("--merge", capture_output=True).returncode, 0)
        self.assertEqual(tables(sweep.folder), self.due)

    def test_what_is_killed_goes_on_and_what_has_run_does_not_run_again(self):
        folder = self.root / "killed"
        with subprocess.Popen([PROGRAM, *MIXED, "--out", folder], stdout=subprocess.DEVNULL) as process:
            until = time.monotonic() + 60
            while len(files(folder)) < 20 and time.monotonic() < until:
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
        before = files(folder)
        self.assertLess(len(before), len(self.cells))
        self.assertEqual(run("--out", folder, "--status").returncode, 3)
        self.assertEqual(run(*MIXED, "--out", folder).returncode, 0)
        self.assertEqual({name: files(folder)[name] for name in before}, before)
        self.assertEqual(tables(folder), self.due)

    def test_a_cut_file_is_run_again(self):
        folder = self.root / "cut"
        shutil.copytree(self.whole, folder)
        cut, empty = folder / "cells/approach/approach-00007.json", folder / "cells/updates/updates-00001.json"
        cut.write_bytes(cut.read_bytes()[:-20])
        empty.write_bytes(b"")
        merged = run("--out", folder, "--merge")
        self.assertEqual(merged.returncode, 3)
        self.assertIn("approach-00007", merged.stderr)
        self.assertIn("updates-00001", merged.stderr)
        before = files(folder)
        self.assertEqual(run(*MIXED, "--out", folder).returncode, 0)
        self.assertEqual({name for name, at in files(folder).items() if before[name] != at}, {cut.name, empty.name})
        self.assertEqual(tables(folder), self.due)

    def test_merge_runs_twice_and_leaves_out_what_lacks_cells(self):
        folder = self.root / "twice"
        shutil.copytree(self.whole, folder)
        (folder / "cells/fig06/fig06-00003.json").unlink()
        self.assertEqual(run("--out", folder, "--merge").returncode, 3)
        lacking = tables(folder)
        self.assertIn(b"fig06-00003", lacking["missing.csv"])
        self.assertNotIn(b"fig06,", lacking["claims.csv"])
        self.assertEqual(lacking["approach.csv"], self.due["approach.csv"])
        self.assertEqual(run("--out", folder, "--cell", "fig06-00003").returncode, 0)
        self.assertEqual(run("--out", folder, "--merge").returncode, 0)
        self.assertEqual(tables(folder), self.due)

    def test_files_of_others_are_refused(self):
        folder = self.root / "others"
        shutil.copytree(self.whole, folder)
        file = folder / "cells/fig06/fig06-00002.json"
        good = json.loads(file.read_text())

        def other(**changes):
            file.write_text(json.dumps({**good, **changes}))

        for key, value in (("commit", "0123456"), ("compiler", "Clang 16"), ("flags", "-O0"), ("executable", "00")):
            other(program={**good["program"], key: value})
            self.refused("--out", folder, "--merge", names=["fig06-00002", key, value, good["program"][key]])
        other(arguments=["--seed", "2"])
        self.refused("--out", folder, "--merge", names=["fig06-00002", '"2"'])
        other(inputs={**good["inputs"], "rate_hz": 1000})
        self.refused("--out", folder, "--merge", names=["fig06-00002", "1000"])

    def test_another_sweep_needs_another_folder(self):
        before = files(self.whole)
        self.refused("--only", "fig06", "--out", self.whole, names=["whole", "--only fig06", "another folder"])
        self.assertEqual(files(self.whole), before)
        folder = self.root / "replaced"
        shutil.copytree(self.whole, folder)
        self.assertEqual(run("--quick", "--only", "fig06", "--seeds", "2", "--out", folder, "--replace").returncode, 0)
        self.assertEqual(len(files(folder)), 8)
        self.assertNotIn("approach.csv", tables(folder))

    def test_a_folder_of_something_else_is_left_alone(self):
        folder = self.root / "else"
        folder.mkdir()
        (folder / "mine.csv").write_text("1,2\n")
        for more in ([], ["--replace"]):
            self.refused("--only", "fig06", "--out", folder, *more, names=["else", "something else", "another folder"])
        self.assertEqual((folder / "mine.csv").read_text(), "1,2\n")

    def test_a_disk_that_is_full(self):
        folder = self.root / "full"
        run(*MIXED, "--out", folder, "--begin")

        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (100, 100))  # bytes

        self.refused(*MIXED, "--out", folder, names=["full/cells", "cannot be written", "File too large"], preexec_fn=limit)
        self.assertEqual(list(folder.glob("cells/*/*")), [])
        self.assertEqual(run(*MIXED, "--out", folder).returncode, 0)
        self.assertEqual(tables(folder), self.due)


class Failing(Case):
    def test_a_cell_that_fails_is_named_with_the_command_that_runs_it_alone(self):
        folder = self.root / "sweep"
        program = folder / "program" / "experiments"
        chosen = ["--quick", "--only", "scenes", "fig06", "--seeds", "2", "--out", folder]
        shutil.copytree(WORLDS, self.root / "packed/worlds")
        (self.root / "packed/worlds/stack.sdf").write_text("no world")
        packed = shutil.copy2(PROGRAM, self.root / "packed")
        run(*chosen, "--begin", program=packed)
        shutil.copytree(self.root / "packed", folder / "program")
        done = run(*chosen, program=program)
        self.assertEqual(done.returncode, 3)
        missing = (folder / "missing.csv").read_text()
        self.assertIn("stack.sdf", missing)
        self.assertIn("scene stack", missing)
        self.assertTrue((folder / "fig06_series.csv").exists())
        self.assertFalse((folder / "scenes.csv").exists())
        subprocess.run([SCRIPTS / "report.py", folder], check=True, stdout=subprocess.DEVNULL)
        page = (folder / "report.html").read_text()
        command = "program/experiments --out . --cell scenes-00002"
        self.assertIn("1 cells have no results", page)
        self.assertIn(command, page)
        alone = subprocess.run(command.split(), cwd=folder, capture_output=True, text=True, check=False)
        self.assertEqual(alone.returncode, 3)
        self.assertIn("scenes-00002 (scene stack) failed", alone.stderr)

    def test_other_worlds_are_another_program(self):
        folder = self.root / "other_worlds"
        self.assertEqual(run("--only", "fig06", "--seeds", "1", "--out", folder).returncode, 0)
        shutil.copytree(WORLDS, self.root / "changed/worlds")
        with open(self.root / "changed/worlds/push.sdf", "a", encoding="utf-8") as world:
            world.write("<!-- -->")
        self.refused("--out", folder, "--merge", program=shutil.copy2(PROGRAM, self.root / "changed"), names=["worlds"])


def inputs_of(line):
    """As a cell's file has them, from a line of the list."""
    _, _, method, condition, seed, _ = line.split("\t")
    inputs = dict(each.split(" ", 1) for each in condition.split(", "))
    inputs.update({"method": method} if method else {}, seed=seed)
    return {name: float(value) if value.replace(".", "").isdigit() else value for name, value in inputs.items()}


class Pages(Case):
    def test_a_page_of_each_experiment_that_no_quick_run_draws(self):
        for experiment in ("bodylimits", "maps"):
            folder = self.root / experiment
            run("--only", experiment, "--out", folder, "--begin")
            run("--out", folder, "--cell", f"{experiment}-00001")
            one = json.loads((folder / f"cells/{experiment}/{experiment}-00001.json").read_text())
            # The same results in all cells.
            for line in run("--only", experiment, "--list-cells").stdout.splitlines():
                one["inputs"] = inputs_of(line)
                (folder / f"cells/{experiment}/{line.split()[0]}.json").write_text(json.dumps(one))
            merged = run("--out", folder, "--merge")
            self.assertIn(merged.returncode, (0, 1), merged.stderr)
            subprocess.run([SCRIPTS / "report.py", folder], check=True, stdout=subprocess.DEVNULL)
            self.assertIn(f'id="{experiment}"', (folder / "report.html").read_text())


class Usage(Case):
    def test_what_cannot_be_used_is_said_in_one_line(self):
        out = self.root / "none"
        over = ("--only", "ocean", "--list-cells", "--over")
        for arguments, names in (
                (["--out", out, "--status"], ["holds no sweep"]),
                (["--out", out, "--cell", "fig06-00001"], ["holds no sweep"]),
                (["--out", "/proc/none", "--only", "fig06"], ["/proc/none"]),
                (["--only", "wrong"], ["wrong", "fig06"]),
                (["--only", "fig06", "--merge"], ["--only cannot go with --merge"]),
                (["--cell", "fig06-00001", "--status"], ["--status cannot go with --cell"]),
                ([*over, "stifness=1"], ["stifness", "did you mean 'stiffness'"]),
                ([*over, "delay"], ["delay", "NAME=VALUES"]),
                ([*over, "delay=0,20kg"], ["20kg", "kg", "ms"]),
                ([*over, "delay=20"], ["delay 20 s", "0 to 10 s"]),
                ([*over, "loss=95%"], ["loss 0.95 must", "0 to 0.9"]),
                ([*over, "delay=1:2"], ["1:2", "FIRST:LAST:COUNT"]),
                ([*over, "delay=0:1:3log"], ["0:1:3log", "above 0"]),
                ([*over, "rate=fast"], ["fast", "number"]),
                ([*over, "device=none.toml"], ["none.toml"]),
                ([*over, "delay=0,0ms"], ["delay", "0 twice"]),
                ([*over, "delay=0:1:2000", "--over", "speed=0.1:1:1000"], ["1000000 combinations"]),
                (["--only", "fig06", "--seed", "-1", "--list-cells"], ["--seed", "-1"]),
                (["--over", "delay=1"], ["--over", "limits"]),
                (["--only", "fig06", "--over", "delay=1"], ["fig06", "ocean"]),
                (["--only", "ocean", "--method", "vrpn", "--over", "delay=1", "--list-cells"], ["ocean", "no cells"])):
            with self.subTest(arguments=arguments):
                self.refused(*arguments, names=names)

    def test_values_of_ones_own(self):
        device = self.root / "my.toml"
        device.write_text("[device]\ndriver = \"simulated\"\nmass = 0.3\ndamping = 2\ndelay = 1\n")
        listed = run("--only", "limits", "--method", "ir", "--over", "delay=0,20,50ms", "--over", f"device={device}",
                     "--over", "damping=50:200:3log", "--seeds", "2", "--list-cells").stdout.splitlines()
        self.assertEqual(len(listed), 3 * 3 * 2)
        self.assertIn("delay_s 0.02, device my.toml, damping_N·s/m 100", listed[8])
        out = self.root / "own"
        chosen = ["--only", "limits", "--method", "ir", "--over", "delay=0,20ms", "--over", f"device={device}", "--out", out]
        self.assertEqual(run(*chosen).returncode, 0)
        due = tables(out)
        self.assertIn(b"k_max by energy,N/m,,IR,0.02,my.toml,1,", due["limits_over.csv"])
        before = files(out)
        self.assertEqual(run(*chosen).returncode, 0)
        self.assertEqual(files(out), before)
        device.write_text("mass = 0.4\n")
        self.refused(*chosen, names=["own holds", "content of its files", "--replace"])
        self.assertEqual(run(*chosen, "--replace").returncode, 0)
        self.assertNotEqual(tables(out), due)
        (out / "inputs/my.toml").write_text("mass = 0.5\n")
        self.refused("--out", out, "--merge", names=["inputs/my.toml", "changed"])
        device.write_text("[device]\nmas = 0.4\n")
        self.refused(*chosen, names=["my.toml", "mas", "did you mean 'mass'"])


if __name__ == "__main__":
    os.environ.pop("COLUMNS", None)
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=1)
