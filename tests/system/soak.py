#!/usr/bin/env python3
"""Hours of a bad network and bad luck for the real server and client, on loopback.

Usage: soak.py HAPTIC_SERVER VE_CLIENT WORLDS [--minutes M] [--seed N] [--keep FOLDER]

A relay between them loses, duplicates, delays, reorders and damages datagrams; meanwhile either side is
stopped, killed and restarted, the server is flooded, and the clock of both is set, while a hand presses a
wall harder than the limit. In every second life of the server the disk of its recordings is full within
seconds. After each blow the network is left alone, and the session must come back. From every tick that
the server logged: no force that is not finite, above the limit, or without a session. Exit status 1 if
any of this fails; the log of the server's life in which it did is kept.
"""

import argparse
import collections
import csv
import heapq
import math
import os
import pathlib
import random
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

from machine import SteppedClock, on_small_disk

LIMIT = 12  # N
RECOVERY = 30  # s in which the session must be back
SETTLE = 1  # s in a session before the next blow
PATIENCE = 3  # s that a person waits for a client that has spoken
BLOWS_PER_LIFE = 8  # of a server, before a new one begins with a new log

# To and fro, 50 mm into the bottom wall: 20 N where it stands.
HAND = """after = "repeat"
[grip]
stiffness = 400
damping = 30
angular_stiffness = 2.0
angular_damping = 0.08
max_force = 30
max_torque = 0.3
[[segment]]
duration = 1.5
move_to = { position = [-0.05, 0.174, 0], rotation = [0, 0, 0] }
[[segment]]
duration = 1.5
move_to = { position = [-0.02, 0, 0], rotation = [0, 0, 0] }
"""

# loss, duplication, bit flips: probabilities. delay, jitter: s; jitter reorders.
Network = collections.namedtuple("Network", "loss duplication flips delay jitter",
                                 defaults=(0, 0, 0, 0, 0))
CLEAN = Network()
NETWORKS = (
    Network(loss=0.05),
    Network(loss=0.3, jitter=0.02),
    Network(duplication=0.5, jitter=0.03),
    Network(flips=0.2),
    Network(delay=0.05, jitter=0.05, loss=0.05, duplication=0.05, flips=0.05),
    Network(loss=1),
)


class Relay(threading.Thread):
    """Passes datagrams between the client and the server as the network of the moment does."""

    def __init__(self, server, seed):
        super().__init__(daemon=True)
        self.server = server
        self.random = random.Random(seed)
        self.network = CLEAN
        self.front = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.front.bind(("127.0.0.1", 0))
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.back.bind(("127.0.0.1", 0))
        self.address = self.front.getsockname()
        self.client = None
        self.waiting = []  # (due, number, socket, address, bytes)
        self.passed = 0

    def run(self):
        while True:
            timeout = max(0, self.waiting[0][0] - time.monotonic()) if self.waiting else 0.1
            for source in select.select([self.front, self.back], [], [], min(timeout, 0.1))[0]:
                self.take(source)
            while self.waiting and self.waiting[0][0] <= time.monotonic():
                _, _, target, address, data = heapq.heappop(self.waiting)
                self.send(target, address, data)

    def take(self, source):
        try:
            data, sender = source.recvfrom(2000)
        except ConnectionError:  # the other side is being restarted
            return
        if source is self.front:
            self.client = sender
            self.pass_on(self.back, self.server, data)
        elif self.client:
            self.pass_on(self.front, self.client, data)

    def pass_on(self, target, address, data):
        network = self.network
        if self.random.random() < network.loss:
            return
        if self.random.random() < network.flips:
            data = bytearray(data)
            for _ in range(self.random.randint(1, 8)):
                data[self.random.randrange(len(data))] ^= 1 << self.random.randrange(8)
        for _ in range(2 if self.random.random() < network.duplication else 1):
            self.passed += 1
            due = time.monotonic() + network.delay + self.random.random() * network.jitter
            heapq.heappush(self.waiting, (due, self.passed, target, address, bytes(data)))

    @staticmethod
    def send(target, address, data):
        try:
            target.sendto(data, address)
        except ConnectionError:
            pass


class Failure(Exception):
    pass


def free_address():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()


class Program:
    """A process that may be stopped, killed and started again."""

    def __init__(self, name, folder, command, environment):
        self.name, self.command, self.environment = name, [str(part) for part in command], environment
        self.errors = open(folder / f"{name}.err", "ab")
        self.process = None

    def start(self, command=None):
        self.process = subprocess.Popen(command or self.command, stdout=subprocess.DEVNULL, stderr=self.errors,
                                        env=self.environment)

    def stop_for(self, seconds):
        self.process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.process.send_signal(signal.SIGCONT)

    def catches(self, signal_number):
        with open(f"/proc/{self.process.pid}/status", encoding="ascii") as status:
            caught = next(line.split()[1] for line in status if line.startswith("SigCgt"))
        return int(caught, 16) >> (signal_number - 1) & 1

    def end(self, signal_number=signal.SIGTERM, allowed=(0,)):
        """Ends it; a status that is neither allowed nor explained by the signal is a crash."""
        self.check_alive()
        begun = time.monotonic()
        while signal_number != signal.SIGKILL and not self.catches(signal_number):
            if time.monotonic() > begun + RECOVERY:
                raise Failure(f"{self.name} does not catch signal {signal_number}")
            time.sleep(0.05)  # It has only just begun.
            self.check_alive()
        self.process.send_signal(signal_number)
        try:
            status = self.process.wait(timeout=10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise Failure(f"{self.name} did not end within 10 s of signal {signal_number}") from None
        if status not in allowed and (signal_number, status) != (signal.SIGKILL, -signal.SIGKILL):
            raise Failure(f"{self.name} ended with status {status} after signal {signal_number}")

    def check_alive(self):
        status = self.process.poll()
        if status is not None:
            raise Failure(f"{self.name} ended by itself with status {status}")


class Soak:
    def __init__(self, arguments, folder):
        self.random = random.Random(arguments.seed)
        self.folder = folder
        self.log = folder / "ticks.csv"
        address = free_address()
        self.relay = Relay(address, arguments.seed)
        self.relay.start()
        hand = folder / "hand.toml"
        hand.write_text(HAND)
        self.clock = SteppedClock(folder)
        self.server = Program("haptic_server", folder, [
            arguments.server, "--listen", "%s:%d" % address, "--hand", hand, "--log", self.log,
            "--status", "false", "--log-level", "warn"], self.clock.environment)
        self.client = Program("ve_client", folder, [
            arguments.client, "--server", "%s:%d" % self.relay.address, "--world",
            pathlib.Path(arguments.worlds) / "testbed.sdf", "--quiet"], self.clock.environment)
        self.disk = folder / "disk"
        self.disk.mkdir()
        self.with_small_disk = on_small_disk(self.disk, [
            *self.server.command, "--record", self.disk / "run.pcap", "--recordings", self.disk])
        self.counts = collections.Counter()
        self.blows = [self.bad_network, self.bad_network, self.flood, self.stop_client,
                      self.stop_server, self.kill_client, self.end_client, self.stop_both, self.set_clock]

    # Blows.

    def bad_network(self):
        self.relay.network = self.random.choice(NETWORKS)
        time.sleep(self.random.uniform(1, 3))
        self.relay.network = CLEAN

    def flood(self):
        count = 20000
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as enemy:
            for _ in range(count):
                data = self.random.randbytes(self.random.randrange(1300))
                if self.random.random() < 0.5:
                    data = b"HLMI\x02\x00" + data
                Relay.send(enemy, self.relay.server, data)
        self.counts["datagrams of floods"] += count

    def stop_client(self):
        self.client.stop_for(self.random.uniform(0.05, 2))

    def stop_server(self):
        self.server.stop_for(self.random.uniform(0.02, 1))

    def stop_both(self):
        self.client.process.send_signal(signal.SIGSTOP)
        self.stop_server()
        self.client.process.send_signal(signal.SIGCONT)

    def kill_client(self):
        self.client.end(signal.SIGKILL)
        self.client.start()

    def end_client(self):
        self.client.end()
        self.client.start()

    def set_clock(self):
        self.clock.set(self.random.choice((-1, 1)) * 10 ** self.random.uniform(-2, 8))

    # The session after a blow.

    def state(self):
        """What the latest line of the log says the server does."""
        with open(self.log, "rb") as log:
            columns = log.readline().decode().rstrip().split(",")
            log.seek(max(0, os.path.getsize(self.log) - 8192))
            lines = log.read().split(b"\n")
        fields = lines[-2].decode().split(",") if len(lines) > 2 else []
        row = dict(zip(columns, fields)) if len(fields) == len(columns) else {}
        return row.get("server_state"), row.get("session")

    def recover(self, blow):
        """Waits for a session; a person ends a fault by starting the client anew."""
        end = time.monotonic() + RECOVERY
        since = None
        asked, gone = 0, None
        while time.monotonic() < end:
            self.server.check_alive()
            self.client.check_alive()
            state, session = self.state()
            if self.relay.client == gone:  # The client that was started has not spoken yet.
                asked = time.monotonic()
            if state == "fault" and time.monotonic() > asked + PATIENCE:
                self.counts["faults ended by a person"] += 1
                self.server.process.send_signal(signal.SIGRTMIN)
                gone = self.relay.client
                self.end_client()
            if state != "active" or session != since:
                since, begun = session if state == "active" else None, time.monotonic()
            elif time.monotonic() - begun >= SETTLE:
                return
            time.sleep(0.1)
        raise Failure(f"no session {RECOVERY} s after {blow}: {state}")

    # A server's life.

    def live(self, end):
        full = self.with_small_disk if self.counts["lives of the server"] % 2 else None
        self.server.start(full)
        while not self.log.exists() or self.log.stat().st_size == 0:
            self.server.check_alive()
            time.sleep(0.05)
        if self.client.process is None:
            self.client.start()
        self.recover("the start")
        for _ in range(BLOWS_PER_LIFE):
            if time.monotonic() > end:
                break
            blow = self.random.choice(self.blows)
            blow()
            self.counts[blow.__name__.replace("_", " ")] += 1
            self.recover(blow.__name__.replace("_", " "))
        self.server.end(self.random.choice((signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)), (0, 1) if full else (0,))
        self.counts["lives of the server"] += 1
        self.counts["with a full disk"] += full is not None
        self.check_log()
        self.log.unlink()

    def check_log(self):
        with open(self.log, newline="", encoding="utf-8", errors="replace") as file:
            for row in csv.DictReader(file):
                if None in row.values():
                    continue  # The line in which the server was killed.
                force = math.hypot(*(float(row[f"command_force_{axis}_N"]) for axis in "xyz"))
                if not force <= LIMIT + 1e-9:
                    raise Failure(f"{force} N at step {row['step']} of session {row['session']}")
                if force > 0 and row["server_state"] in ("off", "arming", "fault"):
                    raise Failure(f"{force} N in state {row['server_state']}")
                self.counts["ticks"] += 1
                self.counts["ticks at the limit"] += force > LIMIT - 1e-6

    def close(self):
        for program in (self.client, self.server):
            if program.process and program.process.poll() is None:
                program.process.kill()
                program.process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server")
    parser.add_argument("client")
    parser.add_argument("worlds")
    parser.add_argument("--minutes", type=float, default=30, help="default %(default)s")
    parser.add_argument("--seed", type=int, default=1, help="default %(default)s")
    parser.add_argument("--keep", type=pathlib.Path, default=pathlib.Path("out/soak"),
                        help="where the logs of a failure go; default %(default)s")
    arguments = parser.parse_args()
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # Under nohup the programs would ignore it, too.
    print(f"soak of {arguments.minutes:g} min, seed {arguments.seed}", flush=True)
    with tempfile.TemporaryDirectory() as name:
        soak = Soak(arguments, pathlib.Path(name))
        end = time.monotonic() + 60 * arguments.minutes
        try:
            while time.monotonic() < end:
                soak.live(end)
        except Failure as failure:
            shutil.copytree(name, arguments.keep, dirs_exist_ok=True)
            print(f"FAILED: {failure}; logs are in {arguments.keep}", file=sys.stderr)
            return 1
        finally:
            soak.close()
            for what, count in sorted(soak.counts.items()):
                print(f"{count:>10} {what}")
            print(f"{soak.relay.passed:>10} datagrams relayed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
