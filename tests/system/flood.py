#!/usr/bin/env python3
"""Floods of garbage at haptic_server on loopback, and what they cost its loop and its session.

Usage: flood.py HAPTIC_SERVER VE_CLIENT WORLDS [--rounds N] [--seconds S] [--rates N …]

The real client has a session, and a hand presses a wall harder than the limit. Then in turn, so that all see the same machine:
nothing, and for each rate so many random packets a second. Printed for each: packets that were sent and that the server took, its ticks
a second, those that began more than 1 ms late, sessions, and how long there was force. A measurement: it needs a
machine with two idle cores, and real-time rights. Exit status 1 if at 50 000 a second the session ends or
more than 1.5 times as many ticks are late as without a flood, or if at any rate the loop loses more than 5 %.
"""

import argparse
import multiprocessing
import os
import pathlib
import random
import socket
import subprocess
import sys
import time

import attacks_test
from attacks_test import Server, drawn_to

KEPT = 50_000  # packets a second that a session endures
LATE = 1e-3  # s
BURST = 1e-3  # s
MOST_AT_ONCE, MOST_BYTES = 64, 60_000  # that the kernel takes in one call
UDP_SEGMENT = 103  # of <linux/udp.h>
NOISE = random.Random(1).randbytes(MOST_BYTES)
WALL = 0.124  # m, where the peg touches the bottom wall


def flood(address, rate, seconds, sent):
    """Random packets of up to 1300 bytes, half of them with our magic and version."""
    chance = random.Random(1)
    enemy = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    enemy.connect(address)
    begin = now = time.monotonic()
    while now < begin + seconds:
        due = int(rate * (now - begin))
        while sent.value < due:
            sent.value += send_many(enemy, min(due - sent.value, MOST_AT_ONCE), chance)
        time.sleep(BURST)
        now = time.monotonic()


def send_many(enemy, count, chance):
    """So many packets of one size in one call: one for each takes Python too long. Returns how many."""
    size = chance.randrange(6, 1300)
    start = b"HLMI\x02\x00" if chance.random() < 0.5 else b""
    count = min(count, MOST_BYTES // size)
    enemy.setsockopt(socket.IPPROTO_UDP, UDP_SEGMENT, size)
    try:
        enemy.send(b"".join(start + NOISE[i * size + len(start):(i + 1) * size] for i in range(count)))
    except ConnectionError:
        pass
    return count


def phase(server, rate, seconds):
    """How many packets were sent."""
    sent = multiprocessing.Value("Q", 0, lock=False)
    if rate == 0:
        time.sleep(seconds)
    else:
        enemy = multiprocessing.Process(target=flood, args=(server.address, rate, seconds, sent))
        enemy.start()
        enemy.join()
    return sent.value


def late_share(ticks):
    return sum(float(row["lateness_s"]) > LATE for row in ticks) / len(ticks)


def summary(name, phases, sent, seconds):
    rows = [row for rows in phases for row in rows]
    taken = sum(int(rows[-1]["datagrams"]) - int(rows[0]["datagrams"]) for rows in phases)
    force = sum(row["server_state"] in ("ramping", "active") for row in rows)
    sessions = {row["session"] for row in rows if row["step"] != "0"}
    print(f"{name:>12}/s: {sent / seconds:9.0f} sent, {taken / seconds:7.0f} taken, {len(rows) / seconds:6.1f} ticks/s, "
          f"{100 * late_share(rows):6.3f} % late, {len(sessions)} sessions, force in {100 * force / len(rows):5.1f} %")
    return sessions


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("server")
    parser.add_argument("client")
    parser.add_argument("worlds")
    parser.add_argument("--rounds", type=int, default=5, help="default %(default)s")
    parser.add_argument("--seconds", type=float, default=10, help="of each rate in a round; default %(default)s")
    parser.add_argument("--rates", type=int, nargs="+", default=[KEPT, 250_000], help="packets a second")
    arguments = parser.parse_args()
    attacks_test.SERVER = arguments.server
    rates = [0, *arguments.rates]
    with Server(hand_script=drawn_to(-0.05, WALL + 0.05, 1)) as server:
        client = subprocess.Popen(
            [arguments.client, "--server", "%s:%d" % server.address, "--world",
             pathlib.Path(arguments.worlds) / "testbed.sdf", "--quiet", "--log-level", "off"])
        time.sleep(3)
        marks, sent = [server_time(server)], []
        for rate in rates * arguments.rounds:
            sent.append(phase(server, rate, arguments.seconds))
            marks.append(server_time(server))
        client.kill()
        client.wait()
        ticks = server.ticks()
    wrong = []
    for i, rate in enumerate(rates):
        mine = range(i, len(sent), len(rates))
        phases = [[row for row in ticks if marks[j] <= row["time"] < marks[j + 1]] for j in mine]
        rows = [row for rows in phases for row in rows]
        seconds = sum(marks[j + 1] - marks[j] for j in mine)
        sessions = summary(rate, phases, sum(sent[j] for j in mine), seconds)
        if len(rows) / seconds < 950:
            wrong.append(f"{rate}/s: the loop loses more than 5 %")
        if rate == 0:
            idle = late_share(rows)
        if rate == KEPT and len(sessions) != 1:
            wrong.append(f"{rate}/s: the session ends")
        if rate == KEPT and late_share(rows) > 1.5 * max(idle, 1 / len(rows)):
            wrong.append(f"{rate}/s: more than 1.5 times as many late ticks as without")
    print("\n".join(wrong) or "all as it should be")
    return 1 if wrong else 0


def server_time(server):
    """Of its latest tick in the log, s."""
    with open(server.log, "rb") as log:
        columns = log.readline().decode().rstrip().split(",")
        log.seek(max(0, os.path.getsize(server.log) - 8192))
        line = log.read().split(b"\n")[-2].decode().split(",")
    return float(line[columns.index("time_s")])


if __name__ == "__main__":
    sys.exit(main())
