"""scripts/sweep with the real things: processes, GNU parallel over ssh, Slurm. Whatever runs the cells, and whatever is killed
meanwhile, tables and page are the same bytes.

Usage: sweep_test.py EXPERIMENTS [Test …]
"""

import contextlib
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from slurm_bed import SlurmBed
from ssh_bed import SshBed

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
SWEEP = pathlib.Path(__file__).resolve().parents[2] / "scripts/sweep"
# Some 400 cells, 20 s of one core.
MIXED = ["fig06", "fig09", "fig16", "updates", "collisions", "corners", "external", "--quick"]
WAIT = 120  # s


def command(folder, *arguments):
    return [SWEEP, *MIXED, "--program", PROGRAM, "--out", folder, *map(str, arguments)]


def sweep(folder, *arguments, **options):
    return subprocess.run(command(folder, *arguments), capture_output=True, text=True, timeout=WAIT, check=False, **options)


def made(folder):
    """Tables and page."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".csv", ".html")}


def files(folder):
    return list(folder.glob("cells/*/*.json"))


def wait_until(true, what):
    until = time.monotonic() + WAIT
    while not true():
        if time.monotonic() > until:
            raise TimeoutError(what)
        time.sleep(0.05)


def workers_of(folder):
    """Processes that run cells of this sweep."""
    found = subprocess.run(["pgrep", "--full", f"cells {folder}/program"], capture_output=True, text=True, check=False)
    return [int(pid) for pid in found.stdout.split()]


class Case(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.root = pathlib.Path(cls.temporary.name)
        cls.one = cls.root / "one"
        done = sweep(cls.one, "--workers", 1)
        assert done.returncode == 0, done.stdout + done.stderr
        cls.due = made(cls.one)
        assert len(files(cls.one)) >= 400, len(files(cls.one))

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def folder(self):
        return self.root / self.id().rsplit(".", 1)[-1]

    def check(self, folder, done=None):
        if done:
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(sorted(made(folder)), sorted(self.due))
        for name, bytes_made in made(folder).items():
            self.assertEqual(bytes_made, self.due[name], name)

    def refused(self, done, names):
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for name in names:
            self.assertIn(name, done.stderr)


class Here(Case):
    def test_two_and_seven_workers(self):
        for workers in (2, 7):
            folder = self.root / f"workers_{workers}"
            self.check(folder, sweep(folder, "--workers", workers))

    def test_workers_are_killed(self):
        folder = self.folder()
        with subprocess.Popen(command(folder, "--workers", 3), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
            for count in (20, 60, 120):
                wait_until(lambda: len(files(folder)) >= count and workers_of(folder), "no worker")
                for pid in workers_of(folder):
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(pid, signal.SIGKILL)
            process.communicate(timeout=WAIT)
            self.assertEqual(process.returncode, 0)
        self.check(folder)

    def test_the_driver_is_killed_and_goes_on(self):
        folder = self.folder()
        with subprocess.Popen(command(folder), stdout=subprocess.DEVNULL, start_new_session=True) as process:
            wait_until(lambda: len(files(folder)) >= 40, "no cells")
            os.killpg(process.pid, signal.SIGKILL)
        before = {path: path.stat().st_mtime_ns for path in files(folder)}
        status = subprocess.run([SWEEP, "--status", folder], capture_output=True, text=True, check=False)
        self.assertEqual(status.returncode, 3)
        self.assertRegex(status.stdout, rf"^{len(before)} done, 0 failed, \d+ left: about \d+ s of one core")
        self.check(folder, sweep(folder))
        self.assertEqual({path: path.stat().st_mtime_ns for path in before}, before)

    def test_an_interrupted_driver_takes_its_workers_along(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            folder = self.root / f"interrupted_{number}"
            with subprocess.Popen(command(folder, "--workers", 1), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                  text=True) as process:
                wait_until(lambda: len(files(folder)) >= 10, "no cells")
                process.send_signal(number)
                error = process.communicate(timeout=WAIT)[1]
            self.assertEqual((process.returncode, error), (130, "What has run stays; the same command goes on.\n"))
            self.assertEqual(workers_of(folder), [])
            job, = folder.glob("jobs/*/1")
            self.assertLess(len(files(folder)), len(job.read_text().split()), "the worker did not end its job")

    def test_a_folder_has_one_command_at_a_time(self):
        folder = self.folder()
        with subprocess.Popen(command(folder), stdout=subprocess.DEVNULL) as process:
            wait_until(lambda: files(folder), "no cells")
            for more in ([], ["--replace"]):
                self.refused(sweep(folder, *more), ["another command", str(folder)])
            self.assertEqual(subprocess.run([SWEEP, "--merge", folder], capture_output=True, check=False).returncode, 3)
            self.assertEqual(process.wait(WAIT), 0)
        self.check(folder)

    def test_a_disk_that_is_full(self):
        folder = self.folder()
        folder.mkdir()
        # What is on the small disk goes with its namespace: so it is copied out.
        script = (f"mount -t tmpfs -o size=8m none {folder} && {' '.join(map(str, command(folder)))}; echo status $?; "
                  f"cp -r {folder}/sweep.json {folder}/program {folder}/cells {self.root}/rescued/")
        (self.root / "rescued").mkdir()
        done = subprocess.run(["unshare", "--mount", "sh", "-c", script], capture_output=True, text=True, timeout=WAIT,
                              check=False)
        self.assertIn("status 2", done.stdout, done.stdout + done.stderr)
        self.assertRegex(done.stderr, r"cells/.*: cannot be written: No space left on device")
        rescued = self.root / "rescued"
        self.assertGreater(len(files(rescued)), 0)
        self.check(rescued, sweep(rescued))


class Ssh(Case):
    def test_two_hosts(self):
        folder = self.folder()
        with SshBed(self.root / "ssh") as bed:
            self.check(folder, sweep(folder, "--ssh", "lab1,lab2:2", "--job", 3, env=bed.environment()))
        hosts = {re.search(r'"host":"([^"]*)"', path.read_text()).group(1) for path in files(folder)}
        self.assertEqual(len(hosts), 1)  # Both are this machine.
        self.assertEqual(list(pathlib.Path.home().glob(f"sweep.{folder.name}.*")), [])

    def test_a_host_that_is_not_there(self):
        folder = self.folder()
        with SshBed(self.root / "ssh_lost") as bed:
            done = sweep(folder, "--ssh", "lab1,nowhere.invalid", "--job", 5, env=bed.environment())
        self.check(folder, done)

    def test_no_host_is_there(self):
        with SshBed(self.root / "ssh_none") as bed:
            done = sweep(self.folder(), "--ssh", "nowhere.invalid", env=bed.environment())
        self.assertEqual(done.returncode, 2)
        self.assertIn("nowhere.invalid does not answer", done.stderr)
        self.assertIn("needs a host that answers", done.stderr)


class Slurm(Case):
    def test_arrays_and_a_job_that_makes_the_page(self):
        folder = self.folder()
        with SlurmBed(self.root / "slurm", max_array_size=4) as slurm:
            done = sweep(folder, "--slurm", "--partition=both --time=10", "--job", 2, env=slurm.environment())
            self.assertEqual(done.returncode, 0, done.stderr)
            arrays, = re.findall(r"array ([\d, ]+);", done.stdout)
            self.assertGreater(len(arrays.split(", ")), 1, "as many as MaxArraySize allows in each")
            wait_until(lambda: (folder / "report.html").exists(), "no page")
        self.check(folder)

    def test_daemons_are_killed(self):
        folder = self.folder()
        with SlurmBed(self.root / "slurm_killed") as slurm:
            with subprocess.Popen(command(folder, "--slurm", "--partition=both", "--wait", "--job", 1.5),
                                  env=slurm.environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
                wait_until(lambda: len(files(folder)) >= 40, "no cells")
                slurm.kill_node(0)
                time.sleep(1)
                slurm.start_node(0)
                wait_until(lambda: len(files(folder)) >= 120, "no more cells")
                slurm.kill_controller(saved=False)
                time.sleep(1)
                slurm.start_controller()
                out, error = process.communicate(timeout=WAIT)
            self.assertEqual(process.returncode, 0, out + error)
        self.check(folder)

    def test_what_the_cluster_refuses(self):
        with SlurmBed(self.root / "slurm_refuses") as slurm:
            for options, names in (("--partition=closed", ["partition"]), ("--account=nobody", ["account"]),
                                   ("--partition=wrong", ["partition"]), ("--wrong", ["--wrong"])):
                with self.subTest(options=options):
                    self.refused(sweep(self.folder(), "--slurm", options, env=slurm.environment()), ["Slurm refuses", *names])
            slurm.kill_controller(saved=False)
            self.refused(sweep(self.folder(), "--slurm", "", env=slurm.environment()), ["Slurm refuses", "controller"])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]], verbosity=2)
