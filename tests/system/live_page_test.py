#!/usr/bin/python3
"""The live page in headless Chromium, between the real haptic_server and ve_client.

Usage: live_page_test.py SERVER CLIENT WORLDS
"""

import contextlib
import json
import math
import signal
import sys
import time
import unittest

SKIPPED = 77
try:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.actions import interaction
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.mouse_button import MouseButton
    from selenium.webdriver.common.actions.pointer_input import PointerInput
except ImportError:
    print("skipped: python3-selenium is not installed")
    sys.exit(SKIPPED)

from live_session import begin, browser, hang, live_session, show, wait_for

SERVER, CLIENT, WORLDS = sys.argv[1:4]
WALL = 0.124  # m: y of the peg on the bottom wall


class LivePage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.stack = contextlib.ExitStack()
        cls.session = cls.stack.enter_context(live_session(SERVER, CLIENT, WORLDS, "--log-level",
                                                           "off"))
        cls.url = cls.session.url
        cls.driver = browser()
        cls.stack.callback(cls.driver.quit)

    @classmethod
    def tearDownClass(cls):
        cls.stack.close()

    def tearDown(self):
        self.let_go()
        errors = [entry for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(errors, [])

    def setUp(self):
        show(self.driver, self.url)
        begin(self.driver)

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

    def drag(self, x, y, release=True, pointer=interaction.POINTER_MOUSE):
        """The handle with real pointer events to a place in the world, m."""
        start = self.ask("haptic.project(haptic.frame.device.slice(0, 3))")
        end = self.ask(f"haptic.project([{x}, {y}, 0])")
        actions = ActionBuilder(self.driver, mouse=PointerInput(pointer, pointer), duration=30)
        pointer = actions.pointer_action
        pointer.move_to_location(int(start[0]), int(start[1])).pointer_down(MouseButton.LEFT)
        for i in range(1, 21):
            pointer.move_to_location(int(start[0] + (end[0] - start[0]) * i / 20),
                                     int(start[1] + (end[1] - start[1]) * i / 20))
        if release:
            pointer.pointer_up(MouseButton.LEFT)
        actions.perform()

    def let_go(self):
        ActionBuilder(self.driver).clear_actions()

    def test_the_scene_moves(self):
        self.driver.find_element("id", "sound").click()
        drawn = self.ask("haptic.drawn")
        before = self.driver.find_element("css selector", "canvas").screenshot_as_png
        self.drag(0.05, 0.0)
        wait_for(lambda: self.ask("haptic.drawn") > drawn + 10, "more pictures")
        after = self.driver.find_element("css selector", "canvas").screenshot_as_png
        self.assertNotEqual(before, after)

    def test_dragged_onto_the_wall_the_force_is_minus_k_s(self):
        self.drag(0.0, WALL + 0.006, release=False)
        wait_for(lambda: abs(self.frame()["device"][1] - WALL) < 1e-3, "the peg on the wall")
        time.sleep(1.5)
        frame = self.frame()
        self.assertIsNone(self.ask("haptic.chain()"))
        self.let_go()
        k = frame["settings"]["stiffness"]
        expected = sum(k * max(0.0, -contact["s"]) for contact in frame["contacts"])
        self.assertGreater(expected, 0.5)  # N
        self.assertAlmostEqual(-frame["F_env"][1], expected, delta=0.05 * expected)

    def test_a_finger_drags_too(self):
        self.drag(-0.06, -0.06, release=False, pointer=interaction.POINTER_TOUCH)
        wait_for(lambda: math.dist(self.frame()["device"][:2], (-0.06, -0.06)) < 2e-3, "the peg there")
        self.assertEqual(self.ask("haptic.chain().link"), "contacts")
        self.let_go()
        wait_for(lambda: self.ask("haptic.chain().link") == "hand", "the chain to miss the hand")

    def test_keys_turn_the_peg_clockwise_as_seen(self):
        ActionChains(self.driver).key_down("e").pause(0.5).key_up("e").perform()
        time.sleep(0.1)
        # In the plan view y points down, so that clockwise is positive.
        self.assertGreater(self.frame()["device"][6], 0.1)
        wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")

    def test_a_fault_is_shown_with_what_to_do_and_a_reset_ends_it(self):
        def stopped_for_a_while():
            self.session.server.send_signal(signal.SIGSTOP)
            time.sleep(0.35)  # s; a gap of 0.25 is a fault, after 0.5 the client asks anew
            self.session.server.send_signal(signal.SIGCONT)
            time.sleep(1)
            return "Fault overrun" in self.ask("haptic.banner()")

        wait_for(stopped_for_a_while, "the fault")
        self.assertIn("then Reset", self.ask("haptic.banner()"))
        self.driver.find_element("id", "reset").click()
        wait_for(lambda: self.ask("haptic.banner()") == "", "no banner")

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
        self.assertIn("another page", self.send({"type": "hand", "hold": True,
                                                 "target": [0, 0, 0, 1, 0, 0, 0]})["text"])
        self.driver.close()
        self.driver.switch_to.window(first)
        wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")

    def test_a_page_that_hangs_costs_the_others_nothing(self):
        hanging = browser()
        try:
            show(hanging, self.url)
            hanging.execute_script("haptic.hand.grab()")
            for _ in range(20):
                hanging.execute_script(f"haptic.hand.moveBy(0, {(WALL + 0.006) / 20}, 0)")
                time.sleep(0.05)
            wait_for(lambda: self.frame()["F_hand"][1] > 1, "its hand to press on the wall")
            hang(hanging, 6)
            began, ticks = time.monotonic(), self.ask("haptic.ticks.received")
            wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "its hand to let go")
            time.sleep(1)
            self.assertLess(time.monotonic() - began, 6)
            self.assertGreater(self.ask("haptic.ticks.received"), ticks + 1000)
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
        wait_for(lambda: abs(self.frame().get("device", [1])[0]) < 1e-3, "the start")
        wait_for(lambda: self.ask("haptic.ticks.received") > 1000, "a second of ticks")
        self.assertEqual(self.ask("haptic.ticks.lost"), 0)

    def test_the_peg_starts_in_the_hole_when_asked(self):
        begin(self.driver, "hole")
        self.assertLess(math.dist(self.frame()["device"][:2], (0.1, 0.184)), 1e-3)
        self.assertEqual(self.ask("haptic.world.start"), "hole")
        self.assertIn("hole", self.send({"type": "reset", "start": "moon"})["text"])
        begin(self.driver, "")
        self.assertLess(math.hypot(*self.frame()["device"][:2]), 1e-3)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
