#!/usr/bin/python3
"""A film of `python3 -m haptic`, docs/contrast.webp: a floor becomes stiff, and the held force begins to shake.

Usage: contrast_film.py PROGRAMS PACKAGE WORLDS FILE
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
WIDTH, HEIGHT = 960, 500
SOFT, STIFF = 700, 10000         # N/m
SOFT_SECONDS, RISE_SECONDS, STIFF_SECONDS = 1.6, 1.2, 4.0
FRAME = 0.07                     # s, at least
LARGEST = 1.5e6                  # bytes


def picture(driver):
    shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True})
    return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")


def stiffness_at(seconds):
    share = min(1, max(0, (seconds - SOFT_SECONDS) / RISE_SECONDS))
    return SOFT * (STIFF / SOFT) ** share


def shoot(driver):
    """Pictures and when each was made, s."""
    pictures, times, began = [], [], time.monotonic()
    while (now := time.monotonic() - began) < SOFT_SECONDS + RISE_SECONDS + STIFF_SECONDS:
        driver.execute_script("if (contrast.wanted.stiffness !== arguments[0]) contrast.setStiffness(arguments[0])",
                              stiffness_at(now))
        pictures.append(picture(driver))
        times.append(now)
        time.sleep(max(0, now + FRAME - (time.monotonic() - began)))
    return pictures, times


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


launcher = subprocess.Popen([sys.executable, "-m", "haptic", "--no-browser", "--worlds", WORLDS], stdout=subprocess.PIPE,
                            text=True, env={**os.environ, "HAPTIC_PROGRAMS": PROGRAMS, "PYTHONPATH": PACKAGE})
try:
    pictures, times = film(launcher.stdout.readline().split(" ")[0])
finally:
    launcher.send_signal(signal.SIGINT)
    launcher.wait()
durations = [round(1000 * (b - a)) for a, b in zip(times, times[1:])] + [800]
pictures[0].save(FILE, save_all=True, append_images=pictures[1:], duration=durations, loop=0, quality=60, method=4,
                 minimize_size=True)
size = os.path.getsize(FILE)
print(f"{FILE}: {len(pictures)} pictures in {times[-1]:.1f} s, {size / 1e6:.2f} MB")
sys.exit(size > LARGEST)
