"""Where the real programs are of which the test beds of this folder consist: Slurm, munge, sshd, GNU parallel.

`scripts/check sweep` unpacks into .venv/cluster what of the packages in cluster.txt is not installed.
"""

import contextlib
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

TREE = pathlib.Path(__file__).resolve().parents[2] / ".venv/cluster"
LIBRARIES = [TREE / "usr/lib/x86_64-linux-gnu", TREE / "usr/lib/x86_64-linux-gnu/slurm-wlm"]
PLUGINS = [TREE / "usr/lib/x86_64-linux-gnu/slurm-wlm", pathlib.Path("/usr/lib/x86_64-linux-gnu/slurm-wlm")]
PROGRAMS = [TREE / "usr/bin", TREE / "usr/sbin"]
PATIENCE = 30  # s; any of the waits below takes a few at most


def environment():
    """Of a program that is to find those of the packages."""
    def before(variable, folders):
        return ":".join([*map(str, folders), *filter(None, [os.environ.get(variable)])])
    return {**os.environ, "PATH": before("PATH", PROGRAMS) + ":/usr/sbin:/sbin",
            "LD_LIBRARY_PATH": before("LD_LIBRARY_PATH", LIBRARIES)}


def program(name):
    """Its path. Raises FileNotFoundError if it is neither unpacked nor installed."""
    found = shutil.which(name, path=environment()["PATH"])
    if not found:
        raise FileNotFoundError(f"{name} is neither in {TREE} nor installed: scripts/check sweep unpacks it")
    return found


def start(command, log, folder, variables):
    """A program as a subprocess.Popen, which ends with the test, however that ends."""
    with open(log, "ab") as out:
        return subprocess.Popen(["setpriv", "--pdeathsig", "KILL", *command], stdin=subprocess.DEVNULL, stdout=out, stderr=out,
                                cwd=folder, env=variables)


def free_ports(count):
    """Ports of loopback that nobody listens on."""
    sockets = [socket.socket() for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


def wait_until(condition, what, patience=PATIENCE):
    """Raises TimeoutError, which names what was waited for."""
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: not within {patience} s")
        time.sleep(0.01)


def variables(process):
    """The environment that a process was started with; {} of one that has ended or is another user's."""
    try:
        text = pathlib.Path(f"/proc/{process}/environ").read_bytes()
    except OSError:
        return {}
    return dict(pair.decode(errors="replace").split("=", 1) for pair in text.split(b"\0") if b"=" in pair)


def processes_with(**wanted):
    """Numbers of the processes that were started with these environment variables, but for this one."""
    numbers = (int(name) for name in os.listdir("/proc") if name.isdigit() and int(name) != os.getpid())
    return [number for number in numbers if wanted.items() <= variables(number).items()]


def kill_all_with(**wanted):
    """Ends them with SIGKILL, and those that they start meanwhile."""
    def kill():
        processes = processes_with(**wanted)
        for process in processes:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        return not processes
    wait_until(kill, f"the end of the processes with {wanted}")
