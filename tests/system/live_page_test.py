#!/usr/bin/python3
"""The live page in headless Chromium, between the real haptic_server and ve_client.

Usage: live_page_test.py SERVER CLIENT WORLDS
"""

import contextlib
import json
import math
import sys
import time
import unittest

SKIPPED = 77
try:
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.mouse_button import MouseButton
except ImportError:
    print("skipped: python3-selenium is not installed")
    sys.exit(SKIPPED)

from live_session import browser, live_session, show, wait_for

SERVER, CLIENT, WORLDS = sys.argv[1:4]
WALL = 0.124  # m: y of the peg on the bottom wall


class LivePage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.stack = contextlib.ExitStack()
        cls.url = cls.stack.enter_context(live_session(SERVER, CLIENT, WORLDS, "--log-level",
                                                       "error"))
        cls.driver = browser()
        cls.stack.callback(cls.driver.quit)

    @classmethod
    def tearDownClass(cls):
        cls.stack.close()

    def setUp(self):
        show(self.driver, self.url)

    def ask(self, expression):
        return self.driver.execute_script(f"return ({expression})")

    def frame(self):
        return self.ask("haptic.frame")

    def send(self, message):
        """A message of a page of its own; what is answered with refused, or None."""
        return self.driver.execute_async_script(
            """const done = arguments[arguments.length - 1];
            const socket = new WebSocket(location.href.replace('http', 'ws') + 'session');
            socket.onmessage = ({data}) => {
              if (typeof data !== 'string') return;
              const message = JSON.parse(data);
              if (message.type === 'refused') { socket.close(); done(message); }
            };
            socket.onopen = () => {
              socket.send(arguments[0]);
              setTimeout(() => { socket.close(); done(null); }, 500);
            };""", json.dumps(message))

    def drag(self, x, y, release=True):
        """The handle with real pointer events to a place in the world, m."""
        start = self.ask("haptic.project(haptic.frame.device.slice(0, 3))")
        end = self.ask(f"haptic.project([{x}, {y}, 0])")
        actions = ActionBuilder(self.driver, duration=30)
        pointer = actions.pointer_action
        pointer.move_to_location(int(start[0]), int(start[1])).pointer_down(MouseButton.LEFT)
        for i in range(1, 21):
            pointer.move_to_location(int(start[0] + (end[0] - start[0]) * i / 20),
                                     int(start[1] + (end[1] - start[1]) * i / 20))
        if release:
            pointer.pointer_up(MouseButton.LEFT)
        actions.perform()

    def let_go(self):
        actions = ActionBuilder(self.driver)
        actions.pointer_action.pointer_up(MouseButton.LEFT)
        actions.perform()

    def test_loads_without_an_error_and_the_scene_moves(self):
        drawn = self.ask("haptic.drawn")
        self.drag(0.05, 0.0)
        wait_for(lambda: self.ask("haptic.drawn") > drawn + 10, "a moving scene")
        errors = [entry for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(errors, [])

    def test_dragged_onto_the_wall_the_force_is_minus_k_s(self):
        self.drag(0.0, WALL + 0.006, release=False)
        wait_for(lambda: abs(self.frame()["device"][1] - WALL) < 1e-3, "the peg on the wall")
        time.sleep(1.5)
        frame = self.frame()
        self.let_go()
        k = frame["settings"]["stiffness"]
        expected = sum(k * max(0.0, -contact["s"]) for contact in frame["contacts"])
        self.assertGreater(expected, 0.5)  # N
        self.assertAlmostEqual(-frame["F_env"][1], expected, delta=0.05 * expected)

    def test_every_tick_arrives(self):
        wait_for(lambda: self.ask("haptic.ticks.received") > 3000, "three seconds of ticks")
        self.assertEqual(self.ask("haptic.ticks.lost"), 0)

    def test_a_method_acts_and_a_value_out_of_range_is_refused_with_the_range(self):
        self.send({"type": "method", "name": "ir"})
        wait_for(lambda: self.frame()["method"] == "ir", "the intermediate representation")
        self.assertEqual(self.frame()["settings"]["controller"], "direct")
        self.assertEqual(self.frame()["settings"]["update_rule"], "intermediate_representation")
        self.assertEqual(self.frame()["epsilon"], 0)
        self.send({"type": "method", "name": "lm5"})
        wait_for(lambda: self.frame()["method"] == "lm5", "the local model")

        refused = self.send({"type": "settings", "stiffness": -1})
        self.assertEqual(refused["field"], "stiffness")
        self.assertIn("-1 must be 1 to 1e+06 N/m", refused["text"])
        self.assertEqual(self.frame()["settings"]["stiffness"], 4000)
        for nonsense in ({"type": "explode"}, {"type": "hand", "hold": True, "target": [1, 2]},
                         {"type": "environment", "loss": "much"}, [], 7):
            self.assertIsNotNone(self.send(nonsense), nonsense)

    def test_two_pages_see_the_same_and_a_closed_page_lets_go(self):
        first = self.driver.current_window_handle
        self.driver.switch_to.new_window("window")
        show(self.driver, self.url)
        self.drag(0.05, -0.05, release=False)
        wait_for(lambda: math.hypot(*self.frame()["F_hand"][:2]) > 0.05, "the hand's force")
        self.driver.close()
        self.driver.switch_to.window(first)
        wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")

    def test_a_page_that_hangs_costs_the_others_nothing(self):
        hanging = browser()
        try:
            show(hanging, self.url)
            hanging.execute_script(
                "setTimeout(end => { while (performance.now() < end); }, 0, performance.now() + 4000);")
            ticks = self.ask("haptic.ticks.received")
            time.sleep(3)
            self.assertGreater(self.ask("haptic.ticks.received"), ticks + 2500)
            self.assertEqual(self.ask("haptic.ticks.lost"), 0)
        finally:
            hanging.quit()

    def test_reset_brings_the_session_back_to_its_start(self):
        self.drag(0.08, -0.08)
        wait_for(lambda: self.frame()["device"][0] > 0.05, "the peg far from its start")
        self.send({"type": "settings", "stiffness": 9000})
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 9000, "another stiffness")
        self.send({"type": "reset"})
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 4000, "the first stiffness")
        wait_for(lambda: abs(self.frame().get("device", [1])[0]) < 0.01, "the start")

    def test_the_peg_starts_in_the_hole_when_asked(self):
        self.send({"type": "reset", "start": "hole"})
        wait_for(lambda: abs(self.frame().get("device", [0, 0])[1] - 0.184) < 1e-3, "the hole")
        self.assertEqual(self.ask("haptic.world.start"), "hole")
        self.assertIn("hole", self.send({"type": "reset", "start": "moon"})["text"])
        self.send({"type": "reset", "start": ""})
        wait_for(lambda: abs(self.frame().get("device", [0, 1])[1]) < 1e-3, "the first place")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
