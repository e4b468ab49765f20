#!/usr/bin/python3
"""What a person at the live page does to the world: pause, single step, slow motion, and the mouse on a loose body.

Usage: page_world_test.py SERVER CLIENT WORLDS [TEST…]
"""

import contextlib
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

from live_session import EXPERT, begin, browser, live_session, show, wait_for

SERVER, CLIENT, WORLDS = sys.argv[1:4]
PERIOD = 1 / 60   # s, of frames
BRICK = "haptic.world.bodies.findIndex(({ name }) => name === 'brick::body')"


class World(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.stack = contextlib.ExitStack()
        cls.session = cls.stack.enter_context(live_session(SERVER, CLIENT, WORLDS, "--log-level", "off", world="push",
                                                           client_options=("--log-level", "off")))
        cls.driver = browser()
        cls.stack.callback(cls.driver.quit)

    @classmethod
    def tearDownClass(cls):
        cls.stack.close()

    def setUp(self):
        show(self.driver, self.session.url)
        begin(self.driver)

    def tearDown(self):
        ActionBuilder(self.driver).clear_actions()

    def ask(self, expression):
        return self.driver.execute_script(f"return ({expression})")

    def time(self):
        return self.ask("haptic.frame.world_time")

    def press(self, name):
        self.driver.find_element("css selector", f"#time button{name}").click()

    def pose(self, name):
        """Where a body is, m."""
        return self.ask(f"haptic.frame.bodies[haptic.world.bodies.filter(({{ fixed }}) => !fixed)"
                        f".findIndex(({{ name }}) => name === '{name}')].slice(0, 3)")

    def wait_for_pace(self, pace):
        wait_for(lambda: self.ask("haptic.frame.environment.pace") == pace, f"the pace {pace}")
        time.sleep(0.4)   # it comes to it within 0.25 s

    def test_a_pause_stands_still_a_step_is_one_frame_and_slow_is_a_quarter(self):
        for view in ("", EXPERT):
            with self.subTest(view):
                show(self.driver, self.session.url + view)
                begin(self.driver)
                self.press("[aria-label='Pause the world']")
                self.wait_for_pace(0)
                still = self.time()
                time.sleep(0.5)
                self.assertEqual(self.time(), still)
                for count in (1, 2):
                    self.press("[aria-label='Single step']")
                    wait_for(lambda: self.time() > still + (count - 0.5) * PERIOD, "the step")
                    time.sleep(0.2)
                    self.assertAlmostEqual(self.time(), still + count * PERIOD, places=6)
                self.press("[aria-label='Pause the world']")
                self.press(":last-child")
                self.wait_for_pace(0.25)
                before = self.ask("[haptic.frame.world_time, performance.now()]")
                time.sleep(2)
                after = self.ask("[haptic.frame.world_time, performance.now()]")
                passed = (after[0] - before[0]) / (after[1] - before[1]) * 1000
                self.assertAlmostEqual(passed, 0.25, delta=0.03)
                self.assertNotIn("pace", self.ask("location.hash"))
                self.driver.find_element("id", "reset").click()
                self.wait_for_pace(1)

    def test_the_hand_feels_what_stands_still_and_does_not_move_it(self):
        self.press("[aria-label='Pause the world']")
        self.wait_for_pace(0)
        before = self.pose("brick::body")
        self.driver.execute_script("haptic.hand.grab(); haptic.hand.moveBy(0.1, 0, 0)")   # beyond the brick
        wait_for(lambda: self.ask("haptic.frame.F_env[0]") < -2, "the brick's force")
        time.sleep(0.5)
        self.assertEqual(self.pose("brick::body"), before)
        self.driver.execute_script("haptic.hand.release()")

    def drag_brick(self, dy, release):
        """With real pointer events, from its middle by dy m."""
        start = self.ask(f"haptic.project(haptic.world.bodies[{BRICK}].pose.slice(0, 3))")
        end = self.ask(f"haptic.project(haptic.world.bodies[{BRICK}].pose.slice(0, 3).map((x, i) => x + (i === 1 ? {dy} : 0)))")
        actions = ActionBuilder(self.driver, duration=30)
        pointer = actions.pointer_action
        pointer.move_to_location(int(start[0]), int(start[1])).pointer_down(MouseButton.LEFT)
        for i in range(1, 11):
            pointer.move_to_location(int(start[0] + (end[0] - start[0]) * i / 10), int(start[1] + (end[1] - start[1]) * i / 10))
        if release:
            pointer.pointer_up(MouseButton.LEFT)
        actions.perform()

    def test_the_mouse_drags_a_brick_and_leaves_the_tool_and_the_wall(self):
        before, tool = self.pose("brick::body"), self.pose("pusher::body")
        self.drag_brick(-0.1, release=False)
        wait_for(lambda: abs(self.pose("brick::body")[1] - (before[1] - 0.1)) < 0.015, "the brick there")
        ActionBuilder(self.driver).clear_actions()
        time.sleep(0.5)
        there = self.pose("brick::body")
        time.sleep(0.5)
        self.assertLess(abs(self.pose("brick::body")[1] - there[1]), 1e-3)   # it is let go
        self.assertLess(max(abs(a - b) for a, b in zip(self.pose("pusher::body"), tool)), 1e-3)
        self.assertFalse(self.ask("haptic.hand.held"))

    def test_a_pointer_far_from_the_tool_does_not_take_it(self):
        x, y = self.ask("haptic.project([0.06, -0.06, 0])")   # nothing is there but the table, 5 cm from the tool
        actions = ActionBuilder(self.driver, duration=30)
        actions.pointer_action.move_to_location(int(x), int(y)).pointer_down(MouseButton.LEFT).move_to_location(int(x) + 40, int(y))
        actions.perform()
        self.assertFalse(self.ask("haptic.hand.held"))
        self.assertGreater(self.ask("haptic.project([0.06, -0.06, 0])")[0], x + 20)   # the view moved

    def test_a_body_that_cannot_be_pulled_is_refused(self):
        for body in ("'brick'", "99", "haptic.world.tool_links[0]", "haptic.world.bodies.findIndex(({ fixed }) => fixed)"):
            self.driver.execute_script(f"haptic.send({{type: 'pull', hold: true, body: {body}, point: [0, 0, 0], target: [0, 0, 0]}})")
            wait_for(lambda: "must be the number of a body that can move" in self.ask("haptic.banner()"), "the refusal")
            show(self.driver, self.session.url)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
