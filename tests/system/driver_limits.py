#!/usr/bin/env python3
"""The stiffest walls that each driver's device bears, through its stand-in, in the real programs.

Usage: driver_limits.py HAPTIC_SERVER VE_CLIENT STAND_INS WORLDS [--only DRIVER …] [--methods METHOD …] [--seconds S]
                        [--stiffness K … | --drift K]

A hand shakes the handle sideways, with the peg in the testbed's hole, which fits it exactly, as in the paper. Printed for
each driver and method: the largest contact stiffness at which the server's side gives out no energy of its own, which is
what makes a handle shake. The scan goes by factors of two, and once between. A measurement: it needs a machine with
two idle cores, and real-time rights.
"""

import argparse
import csv
import math
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

FREQUENCY = 2.5  # Hz, of the hand
LEAST, MOST = 125, 64_000  # N/m, of the scan
SETTLED = 1.5  # s of a session before it is judged
WINDOW = 2  # s, whole periods of the hand
UNSTABLE = 0.01  # J in the window, as in the experiments

# Force of the hand, N; the server's options; mass (kg) and delay (s) that it is told; the program of the vendor's side.
DRIVERS = {
    "forcedimension": (3, ["--device", "forcedimension"], (0.3, 0.001), None),
    "openhaptics": (2, ["--without-time-guard", "--device", "openhaptics"], (0.1, 0.002), None),
    "haply": (3, ["--without-time-guard", "--device", "haply", "--device-option", "address=127.0.0.1:{port}"], (1, 0.002),
              ["inverse_service", "{port}"]),
    "haply at 200 Hz": (3, ["--without-time-guard", "--device", "haply", "--device-option", "address=127.0.0.1:{port}"], (1, 0.007),
                        ["inverse_service", "{port}"]),
    "haply2diy": (1, ["--without-time-guard", "--device", "haply2diy", "--device-option", "port={folder}/tty"], (0.2, 0.003),
                  ["diy_board", "{folder}/tty"]),
}
METHODS = {
    "IR, direct": (["--controller", "direct", "--update-rule", "intermediate_representation", "--keep-stiffness"],
                   ["--epsilon", "0"]),
    "LM5, direct": (["--controller", "direct", "--keep-stiffness"], ["--epsilon", "0.005"]),
    "LM5, three channels": (["--controller", "three_channel"], ["--epsilon", "0.005"]),
    "LM5, four channels": (["--controller", "four_channel"], ["--epsilon", "0.005"]),
}
# What would stop or soften a device that shakes.
UNPROTECTED = ["--energy-budget", "1e6", "--power-limit", "10000", "--turning-power-limit", "1000",
               "--handle-speed-limit", "1000", "--handle-rate-limit", "10000", "--silence-time", "10", "--max-gap", "60"]


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Trial:
    """One session of the programs, with all that they leave in a folder."""

    def __init__(self, programs, driver, method, seconds):
        self.programs, self.driver, self.method, self.seconds = programs, driver, method, seconds

    def given(self, stiffness):
        """Energy out of nothing, J."""
        return energy_given(self.rows(stiffness), "four" in self.method)

    def drift(self, stiffness):
        """Of the proxy to either side, peak to peak, m; infinite if a fault ended the session."""
        places = [float(row["proxy_x_m"]) for row in self.rows(stiffness)]
        return max(places) - min(places) if places else math.inf

    def rows(self, stiffness):
        """Of the tick log, once the session has settled; none if a fault ended it."""
        with tempfile.TemporaryDirectory() as folder:
            log = pathlib.Path(folder) / "ticks.csv"
            self._play(folder, log, stiffness)
            with open(log, encoding="utf-8") as file:
                rows = list(csv.DictReader(file))
        if any(row["fault"] != "none" for row in rows):
            return []
        rows = [row for row in rows if row["server_state"] == "active"]
        start = float(rows[0]["time_s"]) + SETTLED
        return [row for row in rows if float(row["time_s"]) >= start]

    def is_stable(self, stiffness):
        """In one of two runs: a machine that stalls makes energy, too."""
        return any(self.given(stiffness) < UNSTABLE for _ in range(2))

    def _play(self, folder, log, stiffness):
        force, device, (mass, delay), stand_in = DRIVERS[self.driver]
        server_options, client_options = METHODS[self.method]
        place = {"folder": folder, "port": free_port()}
        hand, orders = pathlib.Path(folder) / "hand.toml", pathlib.Path(folder) / "orders"
        hand.write_text(f"[[segment]]\nduration = 3600.0\nwrench = {{ force = [0, 0, 0], force_amplitude = [{force}, 0, 0], "
                        f"frequency = {FREQUENCY} }}\n")
        orders.write_text("slow\n" if "200 Hz" in self.driver else "")
        environment = {**os.environ, "HAPTIC_STAND_IN_HAND": str(hand), "HAPTIC_STAND_IN_ORDERS": str(orders),
                       "LD_LIBRARY_PATH": str(self.programs.stand_ins)}
        running = []
        try:
            if stand_in:
                running.append(subprocess.Popen([self.programs.stand_ins / stand_in[0],
                                                 *(each.format(**place) for each in stand_in[1:])],
                                                env=environment, stderr=subprocess.DEVNULL))
                time.sleep(0.3)
            address = "127.0.0.1:%d" % free_port()
            server = subprocess.Popen(
                [self.programs.server, "--listen", address, "--log", log, "--status", "false", "--keep-recordings", "0",
                 *(each.format(**place) for each in device), *known(self.driver, mass, delay), *server_options, *UNPROTECTED,
                 "--stiffness", str(stiffness)],
                env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            running.append(server)
            while "listening" not in (line := server.stderr.readline()):
                if not line:
                    raise RuntimeError(f"haptic_server did not start for {self.driver}")
            client = subprocess.Popen(
                [self.programs.client, "--server", address, "--world", self.programs.worlds / "testbed.sdf",
                 "--start", "hole", "--duration", str(SETTLED + self.seconds), "--quiet",
                 "--log-level", "off", *client_options],
                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            running.append(client)
            time.sleep(SETTLED / 2)
            with orders.open("a") as file:
                file.write("press 0\n")  # the hand takes the 2DIY's handle
            client.wait(timeout=30)
        finally:
            for program in reversed(running):
                program.terminate()
                program.communicate(timeout=10)


def known(driver, mass, delay):
    """What the server is told of the device."""
    keys = {"apparent-mass": mass, "apparent-delay": delay}
    if driver.startswith("haply"):
        keys["oldest"] = 0.5  # A busy machine is not what this is about.
    return [word for key, value in keys.items() for word in ("--device-option", f"{key}={value}")]


def energy_given(rows, four_channels):
    """The most that the server's side of the device gave in any WINDOW, J: a passive one gives none out of nothing, and
    what it stores in a period of the hand it has given back by the next. Infinite without rows."""
    if not rows:
        return math.inf
    given = [0]
    for before, now in zip(rows, rows[1:]):
        given.append(given[-1] + work(before, "command", "device", before, now)
                     - four_channels * work(now, "hand", "proxy", before, now))
    window = round(WINDOW / (float(rows[-1]["time_s"]) - float(rows[0]["time_s"])) * len(rows))
    return max(now - before for before, now in zip(given, given[window:]))


def work(row, wrench, moved, before, now):
    """Of that row's wrench on what moved from tick to tick, J."""
    duration = float(now["time_s"]) - float(before["time_s"])
    return sum(float(row[f"{wrench}_force_{axis}_N"])
               * (float(now[f"{moved}_{axis}_m"]) - float(before[f"{moved}_{axis}_m"]))
               + float(row[f"{wrench}_torque_{axis}_N_m"]) * float(now[f"{moved}_w{axis}_rad_per_s"]) * duration
               for axis in "xyz")


def largest_stiffness(trial):
    """Within 20 %, N/m, and whether the scan ended there."""
    least, k = 0, LEAST
    while k <= MOST and trial.is_stable(k):
        least, k = k, 2 * k
    if least in (0, MOST) or k > MOST:
        return least, k > MOST
    middle = math.sqrt(least * k)
    return (middle if trial.is_stable(middle) else least), False


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("server", "client", "stand_ins", "worlds"):
        parser.add_argument(name, type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("--only", nargs="+", default=list(DRIVERS), choices=list(DRIVERS))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=list(METHODS))
    parser.add_argument("--seconds", type=float, default=3, help="that a stiffness is judged; default %(default)s")
    parser.add_argument("--stiffness", type=float, nargs="+", help="print the energy at these, N/m, instead")
    parser.add_argument("--drift", type=float, metavar="STIFFNESS", help="print how far the proxy moves there, instead")
    programs = parser.parse_args()
    if not programs.seconds > WINDOW:
        parser.error(f"--seconds {programs.seconds:g} must be more than {WINDOW}")
    for path in (programs.server, programs.client, programs.stand_ins, programs.worlds):
        if not path.exists():
            parser.error(f"{path} is not there")
    for driver in programs.only:
        for method in programs.methods:
            trial = Trial(programs, driver, method, programs.seconds)
            if programs.drift:
                found = f"{1e3 * trial.drift(programs.drift):.2f} mm"
            elif programs.stiffness:
                found = "  ".join(f"{k:g}: {1e3 * trial.given(k):.2f}" for k in programs.stiffness) + " mJ"
            else:
                stiffness, beyond = largest_stiffness(trial)
                found = f"{'> ' if beyond else '' if stiffness else '< '}{(stiffness or LEAST) / 1e3:.3g} kN/m"
            print(f"{driver:16} {method:20} {found}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
