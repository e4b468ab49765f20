"""haptic.studio in a browser: the mouse presses a ball on a robot's arm, and a page that is closed ends the force.

Usage: studio_page_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER PYTHON, of an environment with MuJoCo's Studio
"""

import contextlib
import csv
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time
import unittest

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.actions.mouse_button import MouseButton
from selenium.webdriver.common.keys import Keys

from live_session import free_port, listens, wait_for

SERVER, LIBRARY, PACKAGE, PYTHON = sys.argv[1:5]
ROBOT = """<mujoco><option integrator="implicitfast"/><worldbody><body pos="0 0 0.3"><joint name="elbow" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02"/></body></worldbody>
  <actuator><position joint="elbow" kp="50" kv="5"/></actuator></mujoco>"""
SIZE = (800, 600)  # pixels: software draws the page slowly
BALL = (0.5, 0.23)  # where it is in the page, of its size
DOWN = 24  # pixels of a move of the mouse; 12 of them


@contextlib.contextmanager
def running(command, **options):
    with subprocess.Popen([str(part) for part in command], **options) as process:
        try:
            yield process
        finally:
            process.terminate()


def browser():
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist",
                     f"--window-size={SIZE[0]},{SIZE[1]}"):
        options.add_argument(argument)
    return webdriver.Chrome(options=options, service=Service("/usr/bin/chromedriver"))


def press(page):
    """Ctrl and the right button draw the ball down, by steps that a slow page sees."""
    width, height = page.execute_script("return [innerWidth, innerHeight]")
    x, y = int(BALL[0] * width), int(BALL[1] * height)

    def mouse(act):
        builder = ActionBuilder(page, duration=100)
        act(builder.pointer_action)
        builder.perform()
        time.sleep(0.25)
    mouse(lambda pointer: pointer.move_to_location(x, y))
    ActionChains(page).key_down(Keys.CONTROL).perform()
    mouse(lambda pointer: pointer.pointer_down(MouseButton.RIGHT))
    for step in range(1, 13):
        mouse(lambda pointer: pointer.move_to_location(x, y + DOWN * step))


class Page(unittest.TestCase):
    def test_the_mouse_presses_and_a_closed_page_ends_the_force(self):
        port, folder = free_port(socket.SOCK_STREAM), pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        address = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
        (folder / "robot.xml").write_text(ROBOT)
        begin = time.monotonic()
        with running([SERVER, "--listen", address, "--log", folder / "ticks.csv", "--status", "false", "--log-level", "error",
                      "--device-option", "freedom=spatial", "--device-option", "friction=0"]):
            with running([PYTHON, "-m", "haptic_local_model.studio", f"--model={folder / 'robot.xml'}", "--gfx=web", "--port", port],
                         stdout=subprocess.DEVNULL, cwd=folder, env={
                             **os.environ, "PYTHONPATH": PACKAGE, "HAPTIC_LIBRARY": LIBRARY, "HAPTIC_SERVER": address,
                             "HOME": str(folder)}) as studio:
                wait_for(lambda: listens(port), "Studio's page", 60)
                page = browser()
                try:
                    page.get(f"http://127.0.0.1:{port}/")
                    wait_for(lambda: "active" in (folder / "ticks.csv").read_text()[-2000:], "the force to be on", 60)
                    print(f"a felt world after {time.monotonic() - begin:.1f} s")
                    time.sleep(3)  # The page draws its first pictures.
                    press(page)
                    time.sleep(2)
                finally:
                    page.quit()
                time.sleep(1)
                self.assertIsNone(studio.poll())
        with (folder / "ticks.csv").open() as file:
            ticks = [(float(row["time_s"]), row["server_state"], float(row["command_force_z_N"])) for row in csv.DictReader(file)]
        largest = max(force for _, _, force in ticks)
        ends = [time for time, state, _ in ticks if state == "fading"]
        print(f"pressed with {largest:.2f} N")
        self.assertGreater(largest, 1)
        self.assertLess(ends[-1] - ends[0], 0.1)  # s
        self.assertEqual(ticks[-1][1:], ("off", 0))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
