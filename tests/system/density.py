#!/usr/bin/env python3
"""How many sessions one machine bears: real servers with scripted hands, headless worlds, and how late they get.

Usage: density.py HAPTIC_SERVER VE_CLIENT WORLDS [--sessions 1,2,4,8,16] [--seconds S] [--options "..."]

For each number of sessions so many servers and worlds run at once; the worlds are those of KINDS, in turn. After
a warm-up every server's state file is read for S seconds. One line for each number of sessions:

  median, 99 %  lateness of ticks, us: the middle one of all servers' seconds
  largest       of all ticks of all servers, us
  missed        ticks of all, parts in a million
  updates       a second, of the slowest session, of 60
  server, world processor time of one, a share of one processor; a server's guard counts
  others        what else ran on the machine, in processors: more than a few hundredths, and the figures are of no use
  fits          no fault, and no session below 30 updates a second, the least that the protocol means

Needs real-time rights, as the service has. `--options` are added to each server's: "--final-spin 0".
"""

import argparse
import json
import os
import pathlib
import re
import shlex
import socket
import statistics
import subprocess
import sys
import tempfile
import time

KINDS = ("testbed", "lift", "push", "stack", "door", "peg_in_hole_3d", "corner", "mesh")
PLANAR = ("testbed", "push", "door", "corner")
WARM_UP = 8  # s
LEAST_UPDATES = 30  # Hz
CLOCK = os.sysconf("SC_CLK_TCK")
COLUMNS = "{:>8} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8}  {}"


def free_ports(count):
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for each in sockets:
        each.bind(("127.0.0.1", 0))
    ports = [each.getsockname()[1] for each in sockets]
    for each in sockets:
        each.close()
    return ports


def processor_time(process):
    """Of a process and what it started, s."""
    fields = pathlib.Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    children = pathlib.Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return (int(fields[11]) + int(fields[12])) / CLOCK + sum(map(processor_time, children))


def machine_time():
    """That all processors were busy, s."""
    total = pathlib.Path("/proc/stat").read_text().split("\n")[0]
    user, nice, system, _, _, irq, softirq, *_ = map(int, total.split()[1:])
    return (user + nice + system + irq + softirq) / CLOCK


class Session:
    """A server and a world at it."""

    def __init__(self, arguments, folder, kind, port):
        self.kind = kind
        worlds = pathlib.Path(arguments.worlds)
        hand = folder / f"{kind}.toml"
        script = (worlds / "hands" / f"{'session' if kind == 'testbed' else kind}.toml").read_text()
        hand.write_text(re.sub(r"^after = .*", 'after = "repeat"', script, flags=re.M))
        self.state_file = folder / "haptic_server" / f"127.0.0.1:{port}.json"
        environment = {**os.environ, "XDG_RUNTIME_DIR": str(folder)}
        freedom = [] if kind in PLANAR else ["--device-option", "freedom=spatial"]
        self.programs = [subprocess.Popen(list(map(str, command)), env=environment, stdout=subprocess.DEVNULL,
                                          stderr=subprocess.DEVNULL) for command in (
            [arguments.server, "--listen", f"127.0.0.1:{port}", "--hand", hand, *freedom, "--status", "false",
             "--realtime", "require", "--keep-recordings", 0, *shlex.split(arguments.options)],
            [arguments.client, "--server", f"127.0.0.1:{port}", "--world", worlds / f"{kind}.sdf", "--quiet"])]

    def used(self):
        return [processor_time(program.pid) for program in self.programs]

    def state(self):
        for program in self.programs:
            if program.poll() is not None:
                sys.exit(f"density.py: {program.args[0]} of {self.kind} ended with status {program.returncode}")
        try:
            return json.loads(self.state_file.read_text())
        except FileNotFoundError:
            return None

    def close(self):
        for program in reversed(self.programs):
            program.terminate()
        for program in self.programs:
            program.wait()


def watch(sessions, seconds):
    """Every state that the servers write in this time, by session."""
    states = [{} for _ in sessions]
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        for session, seen in zip(sessions, states):
            state = session.state()
            if state:
                seen[state["written"]] = state
        time.sleep(0.2)
    for session, seen in zip(sessions, states):
        if not seen:
            sys.exit(f"density.py: the server of {session.kind} writes no state")
    return states


def measure(arguments, folder, count):
    """Prints one line."""
    ports = free_ports(count)
    sessions = []
    try:
        for i in range(count):
            sessions.append(Session(arguments, folder, KINDS[i % len(KINDS)], ports[i]))
        time.sleep(WARM_UP)
        begun, busy, used = time.monotonic(), machine_time(), [session.used() for session in sessions]
        states = watch(sessions, arguments.seconds)
        elapsed = time.monotonic() - begun
        busy = machine_time() - busy
        used = [[b - a for a, b in zip(before, session.used())] for before, session in zip(used, sessions)]
    finally:
        for session in sessions:
            session.close()
    server, world = (sum(each) / elapsed for each in zip(*used))
    seconds = [state for seen in states for state in seen.values()]
    loops = [state["loop"] for state in seconds]
    missed = sum(loop["missed"] for loop in loops) / sum(loop["ticks"] + loop["missed"] for loop in loops)
    updates = min(statistics.mean(state["update_rate"] or 0 for state in seen.values()) for seen in states)
    faults = sorted({f"{session.kind}: {state['fault']}" for session, seen in zip(sessions, states)
                     for state in seen.values() if state["fault"] != "none"})
    fits = not faults and updates >= LEAST_UPDATES
    print(COLUMNS.format(
        count, *(f"{1e6 * time:.1f}" for time in (
            statistics.median(loop["lateness_p50"] for loop in loops),
            statistics.median(loop["lateness_p99"] for loop in loops), max(loop["lateness_max"] for loop in loops))),
        f"{1e6 * missed:.0f}", f"{updates:.1f}", f"{server / count:.3f}", f"{world / count:.3f}",
        f"{max(0, busy / elapsed - server - world):.2f}", "yes" if fits else " ".join(["no", *faults])), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server")
    parser.add_argument("client")
    parser.add_argument("worlds")
    parser.add_argument("--sessions", default="1,2,4,8,16", help="default %(default)s")
    parser.add_argument("--seconds", type=float, default=30, help="for each of them; default %(default)s")
    parser.add_argument("--options", default="", help="of each server beside its own")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} processors, {arguments.options or 'the usual options'}")
    print(COLUMNS.format("sessions", "median", "99 %", "largest", "missed", "updates", "server", "world", "others",
                         "fits"))
    for count in map(int, arguments.sessions.split(",")):
        with tempfile.TemporaryDirectory() as folder:
            measure(arguments, pathlib.Path(folder), count)


if __name__ == "__main__":
    main()
