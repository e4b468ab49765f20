#!/usr/bin/python3
"""A film of `python3 -m haptic_local_model`, docs/contrast.webp: a floor becomes stiff, and the held force begins to shake.

Usage: contrast_film.py PROGRAMS PACKAGE WORLDS FILE

What arrives at the page is kept, and shown again picture by picture, so that the film is smooth on a slow machine.
"""

import base64
import io
import os
import signal
import subprocess
import sys
import time

from PIL import Image

from live_session import browser, wait_for

PROGRAMS, PACKAGE, WORLDS, FILE = sys.argv[1:5]
WIDTH, HEIGHT = 1100, 540
SOFT, STIFF = 700, 10000         # N/m
BEFORE_SECONDS = 3.0             # not in the film: the plot fills
SOFT_SECONDS, RISE_SECONDS, STIFF_SECONDS = 1.4, 1.2, 4.0
TEXT_SECONDS = 0.2               # the page's figures change more often
FRAME = 0.05                     # s
LARGEST = 1.5e6                  # bytes

# Keeps what arrives at the page, with its time in s.
KEEP = """
  const { left, right } = contrast, began = performance.now();
  window.kept = [];
  for (const side of [left, right]) {
    const { frame, ticks } = side.connection.handlers;
    side.originals = { frame, ticks };
    for (const kind of ['frame', 'ticks']) {
      side.connection.handlers[kind] = (...what) => {
        kept.push({ at: (performance.now() - began) / 1000, side, kind, what });
        side.originals[kind](...what);
      };
    }
  }"""
# From now on nothing arrives, until SHOW says so.
STOP = """
  for (const side of [contrast.left, contrast.right]) {
    Object.assign(side.connection.handlers, { frame: () => {}, ticks: () => {} });
    side.connection.handlers.world(side.view.world);
  }"""
# What arrived up to a time.
SHOW = """
  while (kept.length > 0 && kept[0].at <= arguments[0]) {
    const { side, kind, what } = kept.shift();
    side.originals[kind](...what);
    side.frameAt = performance.now();
  }
  if (arguments[1] !== contrast.wanted.stiffness) contrast.setStiffness(arguments[1]);"""


def stiffness_at(seconds):
    share = min(1, max(0, (seconds - BEFORE_SECONDS - SOFT_SECONDS) / RISE_SECONDS))
    return SOFT * (STIFF / SOFT) ** share


def picture(driver):
    shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
    return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")


def shoot(driver):
    """Pictures, FRAME apart."""
    length = BEFORE_SECONDS + SOFT_SECONDS + RISE_SECONDS + STIFF_SECONDS
    driver.execute_script(KEEP)
    began = time.monotonic()
    while (now := time.monotonic() - began) < length:
        driver.execute_script("if (contrast.wanted.stiffness !== arguments[0]) contrast.setStiffness(arguments[0])",
                              stiffness_at(now))
        time.sleep(0.02)
    driver.execute_script(STOP)
    pictures = []
    for i in range(round(length / FRAME)):
        driver.execute_script(SHOW, i * FRAME, stiffness_at(i * FRAME))
        if i * FRAME < BEFORE_SECONDS:
            continue
        time.sleep(TEXT_SECONDS)
        pictures.append(picture(driver))
    return pictures


def film(url):
    driver = browser()
    try:
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
            "width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
        driver.get(url)
        wait_for(lambda: driver.execute_script("return window.contrast && contrast.right.figures"), "the page")
        driver.execute_script(f"contrast.setStiffness({SOFT})")
        wait_for(lambda: driver.execute_script(
            "return contrast.hand.held && contrast.left.figures.now > 3 && contrast.left.figures.change < 0.1"), "a steady hand")
        return shoot(driver)
    finally:
        driver.quit()


launcher = subprocess.Popen([sys.executable, "-m", "haptic_local_model", "--no-browser", "--worlds", WORLDS], stdout=subprocess.PIPE,
                            text=True, env={**os.environ, "HAPTIC_PROGRAMS": PROGRAMS, "PYTHONPATH": PACKAGE})
try:
    pictures = film(launcher.stdout.readline().split(" ")[0])
finally:
    launcher.send_signal(signal.SIGINT)
    launcher.wait()
pictures[0].save(FILE, save_all=True, append_images=pictures[1:], duration=round(1000 * FRAME), loop=0, quality=60, method=4,
                 minimize_size=True)
size = os.path.getsize(FILE)
print(f"{FILE}: {len(pictures)} pictures, {size / 1e6:.2f} MB")
sys.exit(size > LARGEST)
