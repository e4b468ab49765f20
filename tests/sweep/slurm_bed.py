"""A real Slurm in a folder of its own, as a test bed: controller, node daemons and munge, none of it installed.

    with SlurmBed(folder) as slurm:
        subprocess.run(["sbatch", "--wait", "job.sh"], env=slurm.environment())

Each node has one core. The partitions: `n0`, `n1`, … of one node each, `both` of all, which is the default, and `closed`,
which takes no job. Jobs may name the account `lab` or none; others are refused. There is no accounting: sacct has nothing.
Logs of the daemons are in the folder.
"""

import getpass
import os
import pathlib
import shutil
import signal
import socket
import subprocess

from unpacked import PLUGINS, environment, free_ports, kill_all_with, program, start, wait_until

ACCOUNT = "lab"
SETTINGS = """\
ClusterName=bed
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser={user}
SlurmdUser={user}
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket,cred_expire=5
PluginDir={plugins}
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool_%n
SlurmctldPidFile={folder}/controller.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/controller.log
SlurmdLogFile={folder}/%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
JobSubmitPlugins=lua
MailProg=/bin/true
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters={scheduler}
MaxArraySize={max_array_size}
ReturnToService=2
SlurmdTimeout={node_timeout}
MessageTimeout=2
TCPTimeout=1
KillWait=2
BatchStartTimeout=2
"""
NODE = "NodeName=n{index} NodeHostname={host} NodeAddr=127.0.0.1 Port={port} CPUs=1\n"
PARTITION = "PartitionName={name} Nodes={nodes} {more}\n"
# Slurm's own are 3, 60 and 30 s: the next job of an array then starts within 4 s, a job that depends on others within 60.
QUICK = "batch_sched_delay=0,sched_interval=1,bf_interval=1"
REFUSAL = f"""\
function slurm_job_submit(job, partitions, user)
  if job.account ~= nil and job.account ~= "{ACCOUNT}" then return 2045 end -- ESLURM_INVALID_ACCOUNT
  return slurm.SUCCESS
end
function slurm_job_modify(job, old, partitions, user) return slurm.SUCCESS end
"""


class SlurmBed:
    def __init__(self, folder, nodes=2, max_array_size=1001, node_timeout=4, scheduler=QUICK):
        """`max_array_size`: the highest index of an array's job, plus 1. `node_timeout`: how long a node may be silent
        before its jobs are requeued, s. `scheduler`: SchedulerParameters; "" are Slurm's own."""
        self.folder = pathlib.Path(folder).resolve()
        self.nodes = [f"n{index}" for index in range(nodes)]
        self.max_array_size, self.node_timeout, self.scheduler = max_array_size, node_timeout, scheduler
        self.processes = {}

    def __enter__(self):
        self._write_settings()
        try:
            self._start("munge", "munged", "--foreground", "--force", f"--key-file={self.folder}/munge.key",
                        f"--socket={self.folder}/munge.socket", f"--pid-file={self.folder}/munge.pid",
                        f"--log-file={self.folder}/munge.log", f"--seed-file={self.folder}/munge.seed")
            wait_until((self.folder / "munge.socket").exists, "munge")
            self.start_controller()
            for index in range(len(self.nodes)):
                self.start_node(index)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        """Ends everything, jobs too."""
        kill_all_with(SLURM_CONF=str(self._settings))
        for process in self.processes.values():
            process.wait()

    @property
    def _settings(self):
        return self.folder / "slurm.conf"

    def environment(self):
        """Of sbatch, squeue, scontrol and so on."""
        return {**environment(), "SLURM_CONF": str(self._settings)}

    def run(self, *command):
        """What one of them did: a subprocess.CompletedProcess with text."""
        return subprocess.run([program(command[0]), *map(str, command[1:])], cwd=self.folder, env=self.environment(),
                              capture_output=True, text=True)

    def start_controller(self):
        """Also after it was killed: it goes on with the jobs that it had."""
        self._start("controller", "slurmctld-wlm", "-D")
        wait_until(lambda: self.run("scontrol", "ping").stdout.endswith("is UP\n"), "slurmctld")

    def kill_controller(self, saved=True):
        """In the moment after it saved its state, which it does every 5 s if jobs came, began or ended. If not `saved`, it
        forgets what happened since it last did: jobs that it took are lost, and those that began begin again."""
        state = self.folder / "state/job_state"
        before = state.stat().st_mtime_ns if saved and state.exists() else None
        wait_until(lambda: not saved or state.exists() and state.stat().st_mtime_ns != before, "slurmctld's state")
        self._kill("controller")

    def start_node(self, index):
        """Ends when the controller, which must be up, has the node."""
        name = self.nodes[index]
        self._start(name, "slurmd-wlm", "-D", "-N", name, "-d", program("slurmstepd-wlm"), SLURMD_NODENAME=name)
        wait_until(lambda: self.node_state(index) in ("allocated", "completing", "idle", "mixed"), f"node {name}")

    def kill_node(self, index, with_jobs=True):
        """As by a loss of power, after which it has no disk to remember by; else the daemon alone, and its jobs run on."""
        name = self.nodes[index]
        self._kill(name)
        if with_jobs:
            kill_all_with(SLURM_CONF=str(self._settings), SLURMD_NODENAME=name)
            shutil.rmtree(self.folder / f"spool_{name}")

    def node_state(self, index):
        """In Slurm's words, with a * for a node that does not answer; "" without a controller."""
        return self.run("sinfo", "--noheader", "--partition", self.nodes[index], "--format", "%T").stdout.strip()

    def _start(self, name, command, *arguments, **more):
        self.processes[name] = start([program(command), *arguments], self.folder / f"{name}.out", self.folder,
                                     {**self.environment(), **more})

    def _kill(self, name):
        self.processes[name].send_signal(signal.SIGKILL)
        self.processes[name].wait()

    def _write_settings(self):
        host = socket.gethostname().split(".")[0]
        ports = free_ports(1 + len(self.nodes))
        every = ",".join(self.nodes)
        lines = [SETTINGS.format(folder=self.folder, host=host, port=ports[0], user=getpass.getuser(),
                                 plugins=":".join(str(folder) for folder in PLUGINS if folder.is_dir()),
                                 max_array_size=self.max_array_size, node_timeout=self.node_timeout,
                                 scheduler=self.scheduler)]
        lines += [NODE.format(index=index, host=host, port=port) for index, port in enumerate(ports[1:])]
        lines += [PARTITION.format(name=name, nodes=name, more="") for name in self.nodes]
        lines += [PARTITION.format(name="both", nodes=every, more="Default=YES"),
                  PARTITION.format(name="closed", nodes=every, more="State=INACTIVE")]
        self.folder.mkdir(parents=True, exist_ok=True)
        self._settings.write_text("".join(lines))
        (self.folder / "job_submit.lua").write_text(REFUSAL)
        (self.folder / "state").mkdir()
        key = self.folder / "munge.key"
        key.touch(0o600)
        key.write_bytes(os.urandom(128))
