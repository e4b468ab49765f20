#!/usr/bin/env python3
"""The test beds of this folder do what a cluster and a lab's computers do, failures included.

Usage: beds_test.py [unittest arguments]
"""

import pathlib
import subprocess
import tempfile
import time
import unittest

from slurm_bed import SlurmBed
from ssh_bed import SshBed
from unpacked import processes_with, program, wait_until

JOBS = 12
# A job's file has its name only when all of it is there.
JOB = """\
#!/bin/sh
echo $SLURM_ARRAY_TASK_ID $SLURMD_NODENAME >>begun
sleep 1
echo $SLURM_ARRAY_TASK_ID >part.$SLURM_ARRAY_TASK_ID.$$
mv part.$SLURM_ARRAY_TASK_ID.$$ result.$SLURM_ARRAY_TASK_ID
echo $SLURM_ARRAY_TASK_ID >>ended
"""


class BedTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))

    def lines(self, name):
        path = self.folder / name
        return path.read_text().splitlines() if path.exists() else []

    def check_results(self):
        results = {path.name: path.read_text() for path in self.folder.glob("result.*")}
        self.assertEqual(results, {f"result.{index}": f"{index}\n" for index in range(JOBS)})


class Slurm(BedTest):
    def bed(self, **settings):
        return self.enterContext(SlurmBed(self.folder, **settings))

    def submit(self, slurm, *options):
        """The number of an array of JOBS."""
        (self.folder / "job.sh").write_text(JOB)
        done = slurm.run("sbatch", "--parsable", "--requeue", f"--array=0-{JOBS - 1}", "--output=/dev/null", *options, "job.sh")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        return done.stdout.strip()

    def wait_for(self, slurm, job):
        """Until nothing of it waits or runs."""
        wait_until(lambda: slurm.run("squeue", "--noheader", "--jobs", job).stdout == "", f"job {job}", 90)

    def test_an_array_survives_the_death_of_the_controller_and_of_a_node(self):
        slurm = self.bed()
        job = self.submit(slurm)
        wait_until(lambda: self.lines("begun"), "a first job")
        slurm.kill_controller()
        self.assertIn("Unable to contact slurm controller", slurm.run("squeue").stderr)
        slurm.start_controller()
        before = len(self.lines("begun"))
        wait_until(lambda: any(line.endswith(" n1") for line in self.lines("begun")[before:]), "a job on n1")
        slurm.kill_node(1)
        wait_until(lambda: slurm.node_state(1) == "down*", "the loss of n1")
        slurm.start_node(1)
        self.wait_for(slurm, job)
        self.check_results()
        begun, ended = self.lines("begun"), self.lines("ended")
        self.assertEqual({line.split()[0] for line in begun}, {str(index) for index in range(JOBS)})
        self.assertGreaterEqual(len(begun), JOBS + 1)  # the job that died with n1 began again
        self.assertLess(len(ended), len(begun))
        print(f"{JOBS} jobs began {len(begun)} times and ended {len(ended)} times")

    def test_a_job_runs_on_while_its_nodes_daemon_is_away(self):
        slurm = self.bed()
        job = self.submit(slurm, "--partition=n0", "--array=0")
        wait_until(lambda: self.lines("begun"), "the job")
        slurm.kill_node(0, with_jobs=False)
        wait_until(lambda: self.lines("ended"), "its end")
        slurm.start_node(0)
        self.wait_for(slurm, job)
        self.assertEqual((len(self.lines("begun")), len(self.lines("ended"))), (1, 1))

    def test_refusals_are_those_of_a_cluster(self):
        slurm = self.bed(max_array_size=11)
        for options, message in ((["--partition=nowhere"], "Invalid partition name specified"),
                                 (["--partition=closed"], "Required partition not available"),
                                 (["--account=nobody"], "Invalid account or account/partition combination specified"),
                                 (["--array=0-11"], "Invalid job array specification")):
            done = slurm.run("sbatch", *options, "--wrap=true")
            self.assertEqual((done.returncode, done.stdout), (1, ""), options)
            self.assertIn(message, done.stderr)
        for options in (["--account=lab"], ["--array=0-10"]):
            self.assertEqual(slurm.run("sbatch", "--hold", *options, "--wrap=true").returncode, 0, options)
        self.assertIn("MaxArraySize            = 11\n", slurm.run("scontrol", "show", "config").stdout)

    def test_nothing_is_left(self):
        with SlurmBed(self.folder) as slurm:
            self.submit(slurm)
            wait_until(lambda: self.lines("begun"), "a first job")
            self.assertGreater(len(processes_with(SLURM_CONF=slurm.environment()["SLURM_CONF"])), 4)
        self.assertEqual(processes_with(SLURM_CONF=slurm.environment()["SLURM_CONF"]), [])


class Ssh(BedTest):
    def parallel(self, ssh, command, *options):
        return subprocess.run([program("parallel"), "--will-cite", "--sshlogin", ssh.logins, "--jobs=1", "--joblog=log",
                               *options, command, ":::", *map(str, range(JOBS // 2))], cwd=self.folder,
                              env=ssh.environment(), stdin=subprocess.DEVNULL, capture_output=True, text=True)

    def test_files_of_jobs_on_two_hosts_come_back(self):
        with SshBed(self.folder) as ssh:
            done = self.parallel(ssh, "echo {} >result.{}", "--workdir=...", "--return=result.{}", "--cleanup")
        self.assertEqual((done.returncode, done.stderr), (0, ""))
        results = {path.name: path.read_text() for path in self.folder.glob("result.*")}
        self.assertEqual(results, {f"result.{index}": f"{index}\n" for index in range(JOBS // 2)})
        hosts = [line.split("\t")[1] for line in self.lines("log")[1:]]
        self.assertEqual(set(hosts), set(ssh.hosts))
        self.assertEqual(processes_with(SSH_BED=str(self.folder)), [])

    def test_the_loss_of_the_hosts_fails_the_jobs(self):
        with SshBed(self.folder) as ssh:
            ssh.kill()
            done = self.parallel(ssh, "true")
            self.assertEqual(done.returncode, JOBS // 2)  # that many failed
            ssh.start()
            self.assertEqual(self.parallel(ssh, "true", "--resume-failed").returncode, 0)


class TimedResult(unittest.TextTestResult):
    def startTest(self, test):
        self.began = time.monotonic()
        super().startTest(test)

    def addSuccess(self, test):
        super().addSuccess(test)
        self.stream.writeln(f"  {time.monotonic() - self.began:.1f} s")


if __name__ == "__main__":
    unittest.main(testRunner=unittest.TextTestRunner(resultclass=TimedResult, verbosity=2))
