#!/usr/bin/python3
"""What a picture of the live page costs without a graphics card, in each quality, while a hand moves the tool.

Usage: page_cost.py SERVER CLIENT WORLDS [WORLD…]

Pictures a second depend on what else the machine does, the processor time of one picture hardly: that of the process that
draws, and of the page's own.
"""

import os
import subprocess
import sys
import time

from live_session import EXPERT, browser, live_session, resize, show

SIZES = ((1280, 720), (1920, 1080))
QUALITIES = ("plain", "shadows")
SETTLE, LOOK = 1.5, 4  # s
TICKS = os.sysconf("SC_CLK_TCK")
SHAKE = """
  haptic.hand.grab();
  let at = 0;
  const began = performance.now();
  setInterval(() => {
    const x = 0.01 * Math.sin((performance.now() - began) / 200);
    haptic.hand.moveBy(x - at, 0, 0);
    at = x;
  }, 16);"""


def processes_below(root):
    lines = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout.splitlines()
    parents = {int(pid): int(parent) for pid, parent in map(str.split, lines)}
    below = {root}
    while more := {pid for pid, parent in parents.items() if parent in below} - below:
        below |= more
    return below


def processor_times(root):
    """Of the browser's process that draws, and of the page's, s."""
    times = {"gpu-process": 0.0, "renderer": 0.0}
    for pid in processes_below(root):
        try:
            with open(f"/proc/{pid}/cmdline") as command, open(f"/proc/{pid}/stat") as stat:
                words = command.read()
                kind = next((kind for kind in times if f"--type={kind}" in words), None)
                user, system = stat.read().rsplit(")", 1)[1].split()[11:13]
        except OSError:
            continue   # It has ended.
        if kind:
            times[kind] += (int(user) + int(system)) / TICKS
    return times


def measure(driver, quality):
    def drawn():
        return driver.execute_script("return haptic.drawn"), processor_times(driver.service.process.pid), time.monotonic()

    driver.execute_script("haptic.quality(arguments[0])", quality)
    time.sleep(SETTLE)
    pictures, times, began = drawn()
    time.sleep(LOOK)
    pictures_then, times_then, ended = drawn()
    count = max(1, pictures_then - pictures)
    costs = [1e3 * (times_then[kind] - times[kind]) / count for kind in times]
    return count / (ended - began), *costs


def main():
    server, client, worlds, *names = sys.argv[1:]
    driver = browser()
    try:
        for name in names or ["testbed"]:
            with live_session(server, client, worlds, "--log-level", "off", world=name,
                              client_options=("--log-level", "off")) as session:
                for width, height in SIZES:
                    resize(driver, width, height)
                    show(driver, session.url + EXPERT)
                    driver.execute_script(SHAKE)
                    for quality in QUALITIES:
                        rate, drawing, page = measure(driver, quality)
                        print(f"{name}, {width} x {height}, {quality}: {rate:.0f} pictures/s, {drawing:.1f} ms of the drawing process "
                              f"and {page:.1f} ms of the page's for one, load {os.getloadavg()[0]:.1f}", flush=True)
    finally:
        driver.quit()


if __name__ == "__main__":
    main()
