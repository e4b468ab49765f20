"""A server whose simulated device a scripted hand moves, and what its tick log says."""

import contextlib
import csv
import pathlib
import re
import signal
import socket
import statistics
import subprocess
import tempfile
import time

STIFFNESS = 400  # N/m, of the hand
GRIP = f"""after = "hold"
[grip]
stiffness = {STIFFNESS}
damping = 30
angular_stiffness = 2.0
angular_damping = 0.08
max_force = 30
max_torque = 0.3
"""
PATIENCE = 10  # s
ATTEMPTS = 3
LATE = 2.4  # frames between two updates
SOON = 0.02  # s, which no machine is asked to keep below
BETWEEN_STALLS = 0.5  # s


def reach(seconds, x, z):
    """The hand moves its target to (x, 0, z), m, in the world."""
    return f"[[segment]]\nduration = {seconds}\nmove_to = {{ position = [{x}, 0, {z}], rotation = [0, 0, 0] }}\n"


def push(seconds, x, z):
    """The hand pushes with (x, 0, z), N, wherever it is."""
    return f"[[segment]]\nduration = {seconds}\nwrench = {{ force = [{x}, 0, {z}] }}\n"


class Server:
    def __init__(self, program, hand, folder, *options):
        self._log = pathlib.Path(folder) / "ticks.csv"
        script = pathlib.Path(folder) / "hand.toml"
        script.write_text(GRIP + hand)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.address = "127.0.0.1:%d" % probe.getsockname()[1]
        self._process = subprocess.Popen(
            [program, "--listen", self.address, "--hand", script, "--log", self._log, "--status", "false",
             "--device-option", "freedom=spatial", "--device-option", "friction=0",
             # A machine that stalls is no matter here.
             "--silence-time", "10", "--max-gap", "60", *options],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        while "listening" not in (line := self._process.stderr.readline()):
            if not line:
                raise RuntimeError("the server did not start")

    def end(self):
        self._process.terminate()
        self._process.communicate(timeout=PATIENCE)

    def ticks(self):
        """Ends the server. The ticks in which force was on, by the log's columns."""
        self.end()
        with self._log.open() as file:
            return [row for row in csv.DictReader(file) if row["server_state"] == "active"]


@contextlib.contextmanager
def server(program, hand, *options):
    with tempfile.TemporaryDirectory() as folder:
        running = Server(program, hand, folder, *options)
        try:
            yield running
        finally:
            running.end()


def mean(ticks, column, begin, end):
    """Mean and standard deviation from `begin` to `end`, s since force was on."""
    start = float(ticks[0]["time_s"])
    chosen = [float(row[column]) for row in ticks if begin <= float(row["time_s"]) - start < end]
    return statistics.mean(chosen), statistics.pstdev(chosen)


def extremes(ticks, column, begin, end):
    """Least and largest from `begin` to `end`, s since force was on."""
    start = float(ticks[0]["time_s"])
    chosen = [float(row[column]) for row in ticks if begin <= float(row["time_s"]) - start < end]
    return min(chosen), max(chosen)


def largest_jump(ticks, begin, end):
    """Largest change of the contact force in a step that takes an update, N, from `begin` to `end`, s."""
    start = float(ticks[0]["time_s"])
    force = [[float(row[f"env_force_{axis}_N"]) for axis in "xyz"] for row in ticks]
    return max(sum((a - b) ** 2 for a, b in zip(force[i], force[i - 1])) ** 0.5
               for i, row in enumerate(ticks)
               if float(row["adopted"]) != 0 and begin <= float(row["time_s"]) - start < end)


def play(program, hand, options, example):
    """Runs a server and `example(address)`, which returns what an example printed. Returns the ticks with force on, and
    where the body was from line to line, m."""
    with server(program, hand, *options) as running:
        printed = example(running.address)
        ticks = running.ticks()
    return ticks, [[float(x) for x in place] for place in re.findall(r"body at \((\S+), (\S+), (\S+)\)", printed)]


def run(command, stall=0, **options):
    """What a program prints that stands still for `stall` seconds now and then."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, **options) as program:
        try:
            while stall > 0 and not _ends_within(program, BETWEEN_STALLS):
                program.send_signal(signal.SIGSTOP)
                time.sleep(stall)
                program.send_signal(signal.SIGCONT)
            printed, _ = program.communicate(timeout=60)
        except BaseException:
            program.kill()
            raise
    if program.returncode != 0:
        raise subprocess.CalledProcessError(program.returncode, command)
    return printed


def _ends_within(program, seconds):
    try:
        program.wait(seconds)
    except subprocess.TimeoutExpired:
        return False
    return True


def longest_wait(ticks):
    """Between two updates, s."""
    taken = [float(row["time_s"]) for row in ticks if float(row["adopted"]) != 0]
    return max(after - before for before, after in zip(taken, taken[1:]))


def on_time(play, *arguments, rate=60):
    """What `play` returns, its ticks first; once more where the machine stalled: a body that gets its impulses late moves late."""
    for _ in range(ATTEMPTS):
        played = play(*arguments, rate=rate)
        if longest_wait(played[0]) < max(LATE / rate, SOON):
            break
    return played


def in_some_attempt(check, *arguments):
    """For what a machine with other work disturbs in ways that no log shows."""
    for _ in range(ATTEMPTS - 1):
        with contextlib.suppress(AssertionError):
            return check(*arguments)
    return check(*arguments)
