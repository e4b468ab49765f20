#!/usr/bin/python3
"""The live page in headless Chromium, between the real haptic_server and ve_client.

Usage: live_page_test.py SERVER CLIENT WORLDS [TEST…]
"""

import contextlib
import gzip
import json
import math
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

SKIPPED = 77
try:
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.actions import interaction
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.mouse_button import MouseButton
    from selenium.webdriver.common.actions.pointer_input import PointerInput
    from selenium.webdriver.common.keys import Keys
    from selenium.webdriver.support.select import Select
except ImportError:
    print("skipped: python3-selenium is not installed")
    sys.exit(SKIPPED)

from live_session import EXPERT, begin, browser, hang, live_session, show, wait_for

SERVER, CLIENT, WORLDS = sys.argv[1:4]
WALL = 0.124  # m: y of the peg on the bottom wall


# How many corners of the world's boxes are outside the scene.
OUTSIDE = """
  const { left, top, right, bottom } = document.getElementById('scene').getBoundingClientRect();
  const signs = [-0.5, 0.5];
  let outside = 0;
  for (const body of haptic.world.bodies) {
    for (const { size, pose } of body.shapes) {
      for (const sx of signs) for (const sy of signs) for (const sz of signs) {
        const corner = [sx, sy, sz].map((s, i) => body.pose[i] + pose[i] + s * size[i]);
        const [x, y] = haptic.project(corner);
        if (x < left - 1 || x > right + 1 || y < top - 1 || y > bottom + 1) ++outside;
      }
    }
  }
  return outside;"""

# What is below the contrast of WCAG 2.1 AA: texts (1.4.3), and edges of buttons and entries (1.4.11).
CONTRASTS = """
  const channels = (color) => color.match(/[\\d.]+/g).map(Number);
  const over = ([r, g, b, a = 1], below) => [r, g, b].map((c, i) => a * c + (1 - a) * below[i]);
  const background = (element) => {
    const color = channels(getComputedStyle(element).backgroundColor);
    if (color[3] === undefined) return color;
    return over(color, element.parentElement ? background(element.parentElement) : [255, 255, 255]);
  };
  const luminance = (color) => color.slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
  const contrast = (a, b) => {
    const [low, high] = [luminance(a), luminance(b)].sort((x, y) => x - y);
    return (high + 0.05) / (low + 0.05);
  };
  const faults = [];
  const check = (element, color, below, least, what) => {
    const ratio = contrast(over(channels(color), below), below);
    if (ratio < least) faults.push(`${what} of ${element.tagName} "${element.textContent.slice(0, 30)}": ${ratio.toFixed(2)}`);
  };
  const shown = (element) => element.offsetWidth > 0;
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !shown(element) || element.closest('option, script, :disabled')) continue;
    check(element, getComputedStyle(element).color, background(element), 4.5, 'text');
  }
  for (const control of document.querySelectorAll('button:enabled, select, input[type=text]')) {
    if (!shown(control)) continue;
    const { borderTopColor: edge, color } = getComputedStyle(control);
    check(control, color, background(control), 4.5, 'text');
    check(control, edge, background(control.parentElement), 3, 'edge');
  }
  return faults;"""


class PageTest(unittest.TestCase):
    """A browser of the class's own, on a session of its own; url shows all that there is."""

    WORLD = "testbed"
    FOLDER = WORLDS
    CLIENT_OPTIONS = ()
    SERVER_OPTIONS = ()
    SERVING = True   # whether haptic_server runs from the beginning

    @classmethod
    def setUpClass(cls):
        cls.stack = contextlib.ExitStack()
        cls.session = cls.stack.enter_context(live_session(
            SERVER, CLIENT, cls.FOLDER, "--log-level", "off", *cls.SERVER_OPTIONS, world=cls.WORLD, serving=cls.SERVING,
            client_options=("--log-level", "off", *cls.CLIENT_OPTIONS)))
        cls.url = cls.session.url + EXPERT
        cls.driver = browser()
        cls.stack.callback(cls.driver.quit)

    @classmethod
    def tearDownClass(cls):
        cls.stack.close()

    def tearDown(self):
        self.let_go()
        errors = [entry for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE"]
        self.assertEqual(errors, [])

    def ask(self, expression):
        return self.driver.execute_script(f"return ({expression})")

    def frame(self):
        return self.ask("haptic.frame")

    def send(self, message):
        """A message of a page of its own; what is answered with refused, or None."""
        return self.driver.execute_async_script(
            """const done = arguments[arguments.length - 1];
            const socket = new WebSocket(location.origin.replace('http', 'ws') + '/session');
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

    def drag_until(self, x, y, reached, what, **options):
        """Drags and holds until reached(); anew where a page that hung for a moment lost its hold."""
        for _ in range(4):
            self.drag(x, y, release=False, **options)
            try:
                return wait_for(reached, what, patience=5)
            except AssertionError as failure:
                last = failure
                self.let_go()
        raise last

    def let_go(self):
        ActionBuilder(self.driver).clear_actions()

    def pull(self, x, y):
        """The page's hand, from where the handle is to a place in the world within 0.5 s, m; it stays."""
        self.driver.execute_script("haptic.hand.grab()")
        here = self.frame()["device"]
        for _ in range(10):
            self.driver.execute_script(
                f"haptic.hand.moveBy({(x - here[0]) / 10}, {(y - here[1]) / 10}, 0)")
            time.sleep(0.05)

    def device_at_rest(self):
        """Its pose, once it has not moved by more than 0.05 mm in 0.1 s."""
        last = self.frame()["device"]

        def rests():
            nonlocal last
            time.sleep(0.1)
            before, last = last, self.frame()["device"]
            return math.dist(before[:3], last[:3]) < 5e-5

        wait_for(rests, "the device to rest")
        return last

    def text(self, element):
        return self.driver.find_element("id", element).text

    def conclusion(self):
        """The sentence below the chain of force, and how it is shown."""
        sentence = self.driver.find_element("id", "chain-reason")
        return sentence.text, sentence.get_attribute("class")

    def pixels_of_the_device(self):
        """How many pixels of the scene have the colour of handle and commanded force."""
        picture = self.driver.find_element("id", "scene").screenshot_as_base64
        return self.driver.execute_async_script(
            """const [source, done] = arguments;
            const image = new Image();
            image.onload = () => {
              const canvas = new OffscreenCanvas(image.width, image.height).getContext('2d');
              canvas.drawImage(image, 0, 0);
              const { data } = canvas.getImageData(0, 0, image.width, image.height);
              let count = 0;
              for (let i = 0; i < data.length; i += 4) {
                if (Math.hypot(data[i] - 0x1d, data[i + 1] - 0x35, data[i + 2] - 0x57) < 12) ++count;
              }
              done(count);
            };
            image.src = 'data:image/png;base64,' + source;""", picture)


class LivePage(PageTest):
    def setUp(self):
        show(self.driver, self.url)
        begin(self.driver)

    def test_the_scene_moves(self):
        self.driver.find_element("id", "sound").click()
        drawn = self.ask("haptic.drawn")
        before = self.driver.find_element("css selector", "canvas").screenshot_as_png
        self.drag(0.05, 0.0)
        wait_for(lambda: self.ask("haptic.drawn") > drawn + 10, "more pictures")
        after = self.driver.find_element("css selector", "canvas").screenshot_as_png
        self.assertNotEqual(before, after)

    def test_dragged_onto_the_wall_the_force_is_minus_k_s(self):
        def pressed():
            frame = self.frame()
            return abs(frame["device"][1] - WALL) < 1e-3 and -frame["F_env"][1] > 1  # N
        self.drag_until(0.0, WALL + 0.006, pressed, "the peg on the wall")
        self.device_at_rest()
        frame = self.frame()
        self.assertIsNone(self.ask("haptic.chain()"))
        self.let_go()
        k = frame["settings"]["stiffness"]
        expected = sum(k * max(0.0, -contact["s"]) for contact in frame["contacts"])
        self.assertGreater(expected, 0.5)  # N
        self.assertAlmostEqual(-frame["F_env"][1], expected, delta=0.05 * expected)

    def test_a_finger_drags_too(self):
        self.drag_until(-0.06, -0.06,
                        lambda: math.dist(self.frame()["device"][:2], (-0.06, -0.06)) < 2e-3,
                        "the peg there", pointer=interaction.POINTER_TOUCH)
        wait_for(lambda: self.ask("haptic.chain().link") == "contacts", "the chain to miss contacts")
        self.let_go()
        wait_for(lambda: self.ask("haptic.chain().link") == "hand", "the chain to miss the hand")

    def test_keys_turn_the_peg_clockwise_as_seen(self):
        ActionChains(self.driver).key_down("e").pause(0.5).key_up("e").perform()
        time.sleep(0.1)
        # In the plan view y points down, so that clockwise is positive.
        self.assertGreater(self.frame()["device"][6], 0.1)
        wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")

    def test_a_flight_recording_is_offered(self):
        before = self.frame()["recording"]
        self.session.server.send_signal(signal.SIGUSR1)
        wait_for(lambda: self.frame()["recording"] != before, "a new recording")
        wait_for(lambda: self.ask("!document.getElementById('recording').hidden"), "the link")
        text = self.driver.execute_async_script(
            "fetch('recording').then((reply) => reply.text()).then(arguments[0])")
        self.assertTrue(text.startswith("session,step,time_s,"))

    def test_a_fault_is_shown_with_what_to_do_and_a_reset_ends_it(self):
        def stopped_for_a_while():
            self.session.server.send_signal(signal.SIGSTOP)
            time.sleep(0.35)  # s; a gap of 0.25 is a fault, after 0.5 the client asks anew
            self.session.server.send_signal(signal.SIGCONT)
            time.sleep(1)
            return "Fault overrun" in self.ask("haptic.banner()")

        wait_for(stopped_for_a_while, "the fault")
        self.assertIn("then press Reset", self.ask("haptic.banner()"))
        self.session.server.send_signal(signal.SIGRTMIN)
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
        self.assertIn("-1 must be 1 to 1000000 N/m", refused["text"])
        self.assertEqual(self.frame()["settings"]["stiffness"], 4000)
        for nonsense in ({"type": "explode"}, {"type": "hand", "hold": True, "target": [1, 2]},
                         {"type": "environment", "loss": "much"}, [], 7):
            self.assertIsNotNone(self.send(nonsense), nonsense)

    def test_two_pages_see_the_same_and_a_closed_page_lets_go(self):
        first = self.driver.current_window_handle
        self.driver.switch_to.new_window("window")
        show(self.driver, self.url)
        self.drag_until(0.0, WALL + 0.01, lambda: self.frame()["F_hand"][1] > 0.05, "the hand's force")
        self.assertIn("another page", self.send({"type": "hand", "hold": True,
                                                 "target": [0, 0, 0, 1, 0, 0, 0]})["text"])
        self.driver.close()
        self.driver.switch_to.window(first)
        wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")

    def test_a_page_that_is_left_frees_its_place(self):
        for _ in range(6):   # of four places; tearDown finds what was refused
            show(self.driver, self.url)
        self.driver.get("about:blank")
        self.driver.back()
        wait_for(lambda: self.ask("window.haptic && haptic.frame && haptic.frame.device"), "the page again")

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

    def test_charts_find_every_column_by_its_name(self):
        begin(self.driver, "hole")
        names = [column["name"] for column in self.ask("haptic.world.tick_columns")]
        self.assertEqual(len(names), len(set(names)))
        for name in (*names, "round_trip"):
            wait_for(lambda: self.ask(f"haptic.ticksOf('{name}').some((value) => value !== null)"), name)
        for strip in self.driver.find_elements("css selector", ".strip"):
            self.driver.execute_script("arguments[0].scrollIntoView()", strip)
            wait_for(lambda: all(output.text not in ("", "–")
                                 for output in strip.find_elements("css selector", "output")), strip.text)

    def test_quantities_are_shown_and_taken_in_handy_units(self):
        def enter(field, text):
            entry = self.driver.find_element("id", f"field-{field}")
            entry.send_keys(Keys.CONTROL, "a")
            entry.send_keys(text, Keys.ENTER)
            entry.send_keys(Keys.ESCAPE)

        for kind, field, text, value, shown in (
                ("environment", "epsilon", "7 mm", 0.007, "7"),
                ("environment", "epsilon", "4", 0.004, "4"),
                ("environment", "epsilon", "0.005 m", 0.005, "5"),
                ("environment", "delay", "20 ms", 0.02, "20"),
                ("environment", "delay", "0,01 s", 0.01, "10"),
                ("environment", "loss", "5 %", 0.05, "5"),
                ("environment", "rate", "50", 50, "50"),
                ("settings", "stiffness", "15 kN/m", 15000, "15"),
                ("settings", "stiffness", "2500 N/m", 2500, "2.5"),
                ("settings", "damping", "40 N s/m", 40, "40"),
                ("settings", "friction", "50%", 0.5, "0.5")):
            enter(field, text)
            wait_for(lambda: self.frame()[kind][field] == value, f"{field} {text}")
            wait_for(lambda: self.driver.find_element("id", f"field-{field}").get_property("value")
                     == shown, f"{field} shown as {shown}")
        for field, text, allowed in (("epsilon", "5 kg", "0 to 200 mm"), ("epsilon", "300 mm", "0 to 200 mm"),
                                     ("delay", "soon", "0 to 200 ms"), ("loss", "60 %", "0 to 50 %"),
                                     ("stiffness", "0", "0.001 to 1000 kN/m")):
            before = self.frame()["environment"]
            enter(field, text)
            message = self.driver.find_element("css selector", f"[data-field={field}] p").text
            self.assertEqual(message, f"“{text}” must be {allowed}")
            self.assertEqual(self.frame()["environment"], before)
        self.send({"type": "reset"})

    def test_arrow_keys_move_the_tool_as_seen(self):
        for key, axis, sign in ((Keys.ARROW_RIGHT, 0, 1), (Keys.ARROW_LEFT, 0, -1),
                                (Keys.ARROW_DOWN, 1, 1), (Keys.ARROW_UP, 1, -1)):
            before = self.device_at_rest()
            ActionChains(self.driver).key_down(key).pause(0.5).key_up(key).perform()
            wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")
            moved = [now - then for now, then in zip(self.frame()["device"], before)]
            self.assertGreater(sign * moved[axis], 0.01)
            self.assertLess(abs(moved[1 - axis]), 1e-3)

    def test_enter_and_space_press_the_buttons_that_move_the_tool(self):
        for key, move, part, sign in ((Keys.ENTER, "right", 0, 1), (Keys.SPACE, "left", 0, -1),
                                      (Keys.ENTER, "turnRight", 6, 1)):
            before = self.device_at_rest()
            self.driver.execute_script(f"document.querySelector('[data-move={move}]').focus()")
            ActionChains(self.driver).key_down(key).pause(0.5).key_up(key).perform()
            wait_for(lambda: self.frame()["F_hand"] == [0, 0, 0, 0, 0, 0], "the hand to let go")
            self.assertGreater(sign * (self.frame()["device"][part] - before[part]), 0.01)

    def test_the_expert_switch_shows_all_or_one_slider_and_the_address_keeps_it(self):
        fields = "[...document.querySelectorAll('.field')].filter((field) => field.offsetWidth).map((field) => field.dataset.field)"
        all_of_them = self.ask(fields)
        self.assertGreater(len(all_of_them), 10)
        self.driver.find_element("id", "expert").click()
        self.assertEqual(self.ask(fields), ["stiffness"])
        self.assertNotIn(EXPERT, self.ask("location.hash"))
        self.assertIn("Drag the orange tool", self.text("sentence"))
        slider = self.driver.find_element("css selector", "[data-field=stiffness] input[type=range]")
        slider.send_keys(Keys.HOME)
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 100, "the softest")
        slider.send_keys(Keys.END)
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 1e5, "the stiffest")
        self.driver.refresh()
        wait_for(lambda: self.ask("window.haptic && haptic.frame && haptic.frame.device"), "the page again")
        self.assertEqual(self.ask(fields), ["stiffness"])
        self.driver.find_element("id", "expert").click()
        self.assertEqual(self.ask(fields), all_of_them)
        self.assertIn(EXPERT, self.ask("location.hash"))

    def test_the_focus_is_seen_wherever_it_is(self):
        self.driver.execute_script("document.activeElement.blur()")
        seen = set()
        for _ in range(80):
            ActionChains(self.driver).send_keys(Keys.TAB).perform()
            name, style, width = self.ask(
                "(() => { const e = document.activeElement, s = getComputedStyle(e); return ["
                "`${e.tagName} ${e.id} ${e.textContent.slice(0, 30)}`, s.outlineStyle,"
                "parseFloat(s.outlineWidth)]; })()")
            if name.startswith("BODY"):
                break
            seen.add(name)
            self.assertEqual((style, width), ("solid", 2), name)
        self.assertGreater(len(seen), 40)

    def test_text_and_controls_have_the_contrast_of_wcag_aa(self):
        self.pull(0.0, WALL + 0.01)
        self.assertEqual(self.driver.execute_script(CONTRASTS), [])
        self.driver.execute_script("haptic.hand.release()")
        wait_for(lambda: self.conclusion()[1] == "stops", "a reason")
        self.assertEqual(self.driver.execute_script(CONTRASTS), [])

    def test_the_world_stays_in_the_picture_when_the_window_is_resized(self):
        before = self.driver.get_window_size()
        try:
            for _ in range(2):   # plan and 3-D view
                for width, height in ((850, 1300), (500, 900), (1600, 700), (1280, 943)):
                    self.driver.set_window_size(width, height)
                    wait_for(lambda: self.ask("innerWidth") == width, "the size")
                    time.sleep(0.3)
                    self.assertEqual(self.driver.execute_script(OUTSIDE), 0, f"at {width} x {height}")
                self.driver.find_element("id", "view-toggle").click()
        finally:
            self.driver.set_window_size(before["width"], before["height"])

    def watch_downloads(self):
        """From now on files are kept in window.saved, as {name, blob}, and not saved."""
        self.driver.execute_script(
            """window.saved = [];
            let latest;
            URL.createObjectURL = (blob) => { latest = blob; return '#'; };
            HTMLAnchorElement.prototype.click = function () { saved.push({ name: this.download, blob: latest }); };""")

    def saved(self):
        """Name, type and the first bytes of the latest file."""
        wait_for(lambda: self.ask("saved.length > 0"), "the file")
        return self.driver.execute_async_script(
            """const done = arguments[0], { name, blob } = saved.pop();
            blob.arrayBuffer().then((bytes) => done([name, blob.type, blob.size, ...new Uint8Array(bytes, 0, 4)]));""")

    def test_a_picture_and_a_film_can_be_saved(self):
        self.watch_downloads()
        self.driver.find_element("id", "picture").click()
        name, kind, size, *begin_of_it = self.saved()
        self.assertEqual((name, kind, bytes(begin_of_it)), ("testbed.png", "image/png", b"\x89PNG"))
        self.assertGreater(size, 3000)   # an empty one has some hundred bytes
        film = self.driver.find_element("id", "film")
        film.click()
        self.drag(0.05, 0.0)
        time.sleep(1.5)
        self.assertEqual(film.get_attribute("aria-pressed"), "true")
        film.click()
        name, kind, size, *begin_of_it = self.saved()
        self.assertEqual((name, kind, bytes(begin_of_it)), ("testbed.webm", "video/webm", b"\x1aE\xdf\xa3"))
        self.assertGreater(size, 5000)
        self.assertEqual(film.get_attribute("aria-pressed"), "false")

    def plug_in(self, identity):
        """A gamepad whose axes and buttons are window.pad's."""
        self.driver.execute_script(
            """window.pad = { id: arguments[0], connected: true, axes: [0, 0, 0, 0, 0, 0],
                           buttons: Array.from({ length: 8 }, () => ({ pressed: false, value: 0 })) };
            navigator.getGamepads = () => [null, pad];""", identity)

    def steer(self, axis, reached, what):
        """Pushes an axis until reached(); anew where a page that hung for a moment lost its hold."""
        def pushes():
            if not self.ask("haptic.hand.held"):
                self.driver.execute_script(f"pad.axes[{axis}] = 0")
                time.sleep(0.1)
                self.driver.execute_script(f"pad.axes[{axis}] = 1")
                time.sleep(0.1)
            return reached()

        wait_for(pushes, what)

    def test_a_gamepad_is_the_hand_while_it_is_moved(self):
        for identity, turning in (("Some gamepad (STANDARD GAMEPAD)", 2), ("3Dconnexion SpaceMouse Pro", 5)):
            with self.subTest(identity):
                begin(self.driver)
                self.plug_in(identity)
                self.driver.execute_script("pad.axes[1] = -0.05")   # does not rest at 0
                self.steer(0, lambda: self.frame()["device"][0] > 0.02, "the tool to go right")
                self.assertLess(abs(self.frame()["device"][1]), 1e-3)
                self.driver.execute_script("pad.axes[0] = 0")
                self.steer(turning, lambda: self.frame()["device"][6] > 0.1, "the tool to turn clockwise")   # y points down
                self.driver.execute_script(f"pad.axes[{turning}] = 0; pad.buttons[0].pressed = true")
                time.sleep(0.3)
                self.assertTrue(self.ask("haptic.hand.held"))
                self.driver.execute_script("pad.buttons[0].pressed = false")
                wait_for(lambda: not self.ask("haptic.hand.held"), "the hand to let go")
                # What Escape has taken from it must be let go before it holds again.
                self.driver.execute_script("pad.axes[0] = 1")
                wait_for(lambda: self.ask("haptic.hand.held"), "the hand to hold")
                ActionChains(self.driver).send_keys(Keys.ESCAPE).perform()
                time.sleep(0.3)
                self.assertFalse(self.ask("haptic.hand.held"))

    def test_the_address_keeps_what_was_chosen_and_brings_it_back(self):
        self.assertEqual(self.ask("location.hash"), EXPERT)
        Select(self.driver.find_element("id", "start")).select_by_value("hole")
        wait_for(lambda: self.ask("haptic.world.start") == "hole", "the start")
        self.driver.find_element("css selector", "[data-method=ir]").click()
        self.driver.find_element("css selector", ".situations button").click()   # stiff and late
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 15000, "a stiff wall")
        address = self.ask("location.href")
        self.assertIn(EXPERT + "&scene=testbed&start=hole&method=ir&stiffness=15000&damping=100&delay=0.02", address)
        begin(self.driver)
        self.assertEqual(self.frame()["settings"]["stiffness"], 4000)
        show(self.driver, address)
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 15000 and self.frame()["method"] == "ir", "the settings")
        self.assertEqual(self.ask("haptic.world.start"), "hole")
        self.assertEqual(self.frame()["environment"]["delay"], 0.02)
        self.assertEqual(self.ask("location.href"), address)
        self.driver.find_element("id", "reset").click()
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 4000, "the first stiffness")
        self.assertEqual(self.ask("location.hash"), EXPERT + "&scene=testbed&start=hole")
        show(self.driver, self.url + "&scene=moon&stiffness=9000&nonsense=1")
        wait_for(lambda: "scene moon" in self.ask("haptic.banner()"), "the complaint")
        self.assertEqual(self.frame()["settings"]["stiffness"], 4000)

    def test_the_picture_is_made_cheaper_where_it_takes_too_long(self):
        def quality():
            return self.ask("haptic.scene().quality")

        self.driver.execute_script("haptic.quality('shadows')")
        self.assertEqual(quality(), "shadows")
        dear = """const wait = () => { const end = performance.now() + 60; while (performance.now() < end); requestAnimationFrame(wait); };
                  haptic.quality(); wait();"""
        self.driver.execute_script(dear)
        wait_for(lambda: quality() == "coarse", "fewer pixels")
        wait_for(lambda: self.ask("document.querySelector('canvas').width / document.querySelector('canvas').clientWidth") < 0.7,
                 "fewer pixels")

    def test_the_whole_page_is_small(self):
        files = [self.session.url, *self.ask("performance.getEntriesByType('resource').map(({ name }) => name)"
                                     ".filter((name) => /[.](js|css)$/.test(name))")]
        self.assertGreater(len(files), 20)
        sizes = [len(gzip.compress(urllib.request.urlopen(file).read())) for file in files]
        self.assertLess(sum(sizes), 0.6e6)   # bytes, compressed

    def test_a_second_page_is_told_that_another_holds_the_handle(self):
        self.assertEqual(self.text("hint"), "Drag the handle")
        holder = browser()
        try:
            show(holder, self.url)
            holder.execute_script("haptic.hand.grab()")
            wait_for(lambda: self.text("hint") == "Another page holds the handle", "the hint")
            wait_for(lambda: "another page holds it" in self.conclusion()[0], "the reason")
            self.drag(0.05, 0.0)
            wait_for(lambda: "another page holds the hand" in self.ask("haptic.banner()"), "the refusal")
            self.assertFalse(self.ask("haptic.hand.held"))
        finally:
            holder.quit()
        wait_for(lambda: not self.frame()["held"], "the hand to be free")
        self.driver.refresh()
        wait_for(lambda: self.text("hint") == "Drag the handle", "the usual hint")

    def shake_in_the_hole(self, method):
        """[{kind, clipped, sentence, class}] while the peg is shaken at 2.5 Hz for 5 s."""
        self.driver.find_element("css selector", f"[data-method={method}]").click()
        wait_for(lambda: self.frame()["method"] == method, method)
        return self.driver.execute_async_script(
            """const done = arguments[0], seen = [], began = performance.now();
            haptic.hand.grab();
            let at = 0;
            const timer = setInterval(() => {
              const t = (performance.now() - began) / 1000, x = 0.015 * Math.sin(5 * Math.PI * t);
              haptic.hand.moveBy(x - at, 0, 0);
              at = x;
              const sentence = document.getElementById('chain-reason');
              const verdict = haptic.verdict();
              if (t > 1) seen.push({ kind: verdict.kind, clipped: verdict.clipped,
                                     sentence: sentence.textContent, shown: sentence.className });
              if (t < 5) return;
              clearInterval(timer);
              haptic.hand.release();
              done(seen);
            }, 16);""")

    def test_chatter_and_clipping_are_said_where_they_are(self):
        begin(self.driver, "hole")
        self.driver.find_element("css selector", ".situations button").click()   # stiff and late
        wait_for(lambda: self.frame()["settings"]["stiffness"] == 15000, "a stiff wall")
        local = self.shake_in_the_hole("lm5")
        self.assertEqual({look["kind"] for look in local}, {"stable"})
        self.assertNotIn("chatters", " ".join(look["sentence"] for look in local))
        representation = self.shake_in_the_hole("ir")
        self.assertIn("chattering", {look["kind"] for look in representation})
        self.assertGreater(max(look["clipped"] for look in representation), 20)   # of 1000
        said = [look for look in representation if "chatters" in look["sentence"]]
        self.assertTrue(said)
        self.assertEqual({look["shown"] for look in said}, {"stops"})
        self.send({"type": "reset"})


class WithoutServer(PageTest):
    SERVING = False

    def test_without_a_server_nothing_is_shown_of_the_device_and_the_page_says_why(self):
        self.driver.get(self.url)
        wait_for(lambda: self.ask("window.haptic && haptic.frame && haptic.drawn > 0"), "a picture")
        wait_for(lambda: self.conclusion() == ("At “session”: haptic_server does not answer.", "stops"),
                 "the reason")
        self.assertEqual(self.pixels_of_the_device(), 0)
        self.assertFalse(self.ask("haptic.hand.grab()"))


class ServerThatDies(PageTest):
    def test_a_dead_server_leaves_nothing_behind_and_a_hand_must_grab_again(self):
        show(self.driver, self.url)
        self.pull(0.0, WALL + 0.03)
        wait_for(lambda: self.frame()["F_env"][1] < -0.5, "a force on the wall")
        self.assertGreater(self.pixels_of_the_device(), 0)
        wait_for(lambda: self.conclusion()[1] == "reaches", "the sentence on the force")
        self.session.kill_server()
        wait_for(lambda: self.conclusion() == ("At “session”: haptic_server does not answer.", "stops"),
                 "the reason")
        self.assertEqual(self.text("verdict"), "")
        self.assertEqual(self.pixels_of_the_device(), 0)
        self.assertFalse(self.ask("haptic.hand.held"))
        # Even a page that holds on regardless.
        self.driver.execute_script(
            "window.stubborn = setInterval(() => haptic.send({type: 'hand', hold: true,"
            "target: [0, 0.2, 0, 1, 0, 0, 0]}), 50)")
        self.session.start_server()
        wait_for(lambda: self.frame().get("device"), "the device")
        for _ in range(20):
            self.assertEqual(self.frame()["F_hand"], [0, 0, 0, 0, 0, 0])
            time.sleep(0.05)
        self.driver.execute_script("clearInterval(window.stubborn)")
        self.assertTrue(self.ask("haptic.hand.grab()"))
        self.driver.execute_script("haptic.hand.moveBy(0, 0.01, 0)")

        def pulls():
            if not self.ask("haptic.hand.held"):  # A page that hung for a second has lost its hold.
                self.driver.execute_script("haptic.hand.grab() && haptic.hand.moveBy(0, 0.01, 0)")
            return math.hypot(*self.frame()["F_hand"][:2]) > 0.05

        wait_for(pulls, "the hand's force")


class Scenes(PageTest):
    """A folder with two worlds, and one that is none."""

    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, folder)
        for name in ("testbed", "push"):
            shutil.copy(pathlib.Path(WORLDS) / f"{name}.sdf", folder)
        (folder / "broken.sdf").write_text("<sdf version='1.9'><world name='w'/></sdf>")
        cls.FOLDER = folder
        super().setUpClass()

    def setUp(self):
        show(self.driver, self.url)
        if self.ask("haptic.world.scene") != "testbed":
            self.choose("testbed")
            self.wait_for_scene("testbed")

    def choose(self, scene):
        Select(self.driver.find_element("id", "scenes")).select_by_value(scene)

    def wait_for_scene(self, scene):
        wait_for(lambda: self.ask(f"haptic.world.scene === '{scene}' && haptic.world.servo_rate"
                                  " && haptic.frame.device && haptic.scene().live"), scene)

    def tools(self):
        return self.ask("haptic.world.bodies.filter((body) => body.tool).map((body) => body.name)")

    def shown(self):
        return Select(self.driver.find_element("id", "scenes")).first_selected_option.text

    def test_another_scene_has_its_own_tool_and_the_charts_mark_where_it_began(self):
        self.assertEqual(self.tools(), ["peg::body"])
        wait_for(lambda: self.ask("haptic.ticks.received") > 500, "half a second of ticks")
        before = len(self.ask("haptic.charts().marks"))
        self.choose("push")
        self.wait_for_scene("push")
        self.assertEqual(self.tools(), ["pusher::body"])
        self.assertEqual(self.shown(), "push: Each brick slides once the push exceeds its friction.")
        self.assertTrue(self.driver.execute_script("haptic.hand.grab(); return haptic.hand.held"))
        self.driver.execute_script("haptic.hand.release()")
        marks = wait_for(lambda: self.ask("haptic.charts().marks")[before:], "the mark")
        self.assertEqual([name for _, name in marks], ["push"])
        self.assertEqual(self.ask("haptic.ticks.lost"), 0)
        self.assertGreater(marks[0][0], 500)   # ticks: what was before is still there

    def test_one_page_chooses_for_all(self):
        self.assertIsNone(self.send({"type": "scene", "name": "push"}))
        self.wait_for_scene("push")
        self.assertIn("push: ", self.shown())

    def test_the_chosen_scene_stays_in_the_menu_while_it_loads_and_the_page_says_so(self):
        choice = self.driver.execute_script(
            """const menu = document.getElementById('scenes');
            menu.value = 'push';
            menu.dispatchEvent(new Event('change'));
            return new Promise((resolve) => setTimeout(() => resolve([menu.value, document.getElementById('loading').innerText,
              haptic.world.scene]), 160));""")
        if choice[2] != "push":   # It has come within 160 ms otherwise.
            self.assertEqual(choice[:2], ["push", "Loading scene push …"])
        self.wait_for_scene("push")
        wait_for(lambda: self.ask("document.getElementById('loading').hidden"), "no more waiting")
        self.assertEqual(self.ask("location.hash"), EXPERT + "&scene=push")

    def test_a_world_that_cannot_be_played_says_so_and_the_present_one_goes_on(self):
        self.driver.execute_script("window.earlier = haptic.world")
        self.choose("broken")
        wait_for(lambda: "broken.sdf" in self.ask("haptic.banner()"), "the reason")
        self.assertIn("<haptic:tool>", self.ask("haptic.banner()"))
        self.assertIn("testbed: ", self.shown())
        self.assertIn("Scene broken was not loaded: ", self.text("loading"))
        self.assertNotIn("broken", self.ask("location.hash"))
        received = self.ask("haptic.ticks.received")
        wait_for(lambda: self.ask("haptic.ticks.received") > received + 500, "more ticks")
        self.assertTrue(self.ask("haptic.world === earlier"))
        self.assertEqual(self.ask("haptic.ticks.lost"), 0)
        outside = self.send({"type": "scene", "name": "../worlds/push"})
        self.assertIn("must be broken, push, testbed", outside["text"])

    def test_a_pressed_brick_gets_the_opposite_of_the_force_on_the_tool(self):
        self.choose("push")
        self.wait_for_scene("push")
        self.pull(0.09, 0.0)
        wait_for(lambda: self.ask("haptic.scene().pairs") == 1 and self.frame()["F_env"][0] < -0.5,
                 "a pressed brick")
        self.device_at_rest()
        on_body = float(self.text("value-on-body").split()[0])
        self.assertAlmostEqual(on_body, math.hypot(*self.frame()["F_env"][:3]), delta=0.1)   # N
        wait_for(lambda: sum(c["of"] == "movable_body" for c in self.frame()["contacts"]) >= 3,
                 "the brick's contacts with the table")
        discs = self.ask("haptic.scene().discs")
        self.driver.find_element("id", "bodies-contacts").click()
        wait_for(lambda: self.ask("haptic.scene().discs") <= discs - 3, "fewer discs")
        self.driver.find_element("id", "bodies-contacts").click()

    def test_the_menu_and_its_sentence_leave_the_scene_room_at_1280_by_720(self):
        before = self.driver.get_window_size()
        try:
            self.driver.set_window_size(1280, before["height"] - 80)
            wait_for(lambda: self.ask("innerHeight") == 720, "the size")
            bottom, top, height, width = self.ask(
                """(() => {
                  const menu = document.getElementById('scenes').getBoundingClientRect();
                  const scene = document.getElementById('scene').getBoundingClientRect();
                  return [menu.bottom, scene.top, scene.height, menu.width];
                })()""")
            self.assertLessEqual(bottom, top)
            self.assertGreater(height, 350)
            sentence = self.ask(
                """(() => {
                  const menu = document.getElementById('scenes');
                  const canvas = new OffscreenCanvas(1, 1).getContext('2d');
                  canvas.font = getComputedStyle(menu).font;
                  return canvas.measureText(menu.selectedOptions[0].text).width;
                })()""")
            self.assertLess(sentence, width - 30)   # pixels, of its frame and arrow
        finally:
            self.driver.set_window_size(before["width"], before["height"])


class RefusedScene(PageTest):
    """A server that takes tools of one link alone, and scenes with and without."""

    SERVER_OPTIONS = ("--controller", "direct")

    def choose(self, scene):
        Select(self.driver.find_element("id", "scenes")).select_by_value(scene)

    def test_a_scene_that_the_server_refuses_says_why_and_another_one_is_played(self):
        show(self.driver, self.url)
        for _ in range(2):
            self.choose("linkage")
            wait_for(lambda: "needs a tool of one link" in self.ask("haptic.banner()"), "the server's reason")
            self.assertEqual(self.ask("haptic.world.scene"), "linkage")
            self.assertEqual(self.conclusion(), ("At “session”: haptic_server cannot use the tool.", "stops"))
            self.assertIsNone(self.session.client.poll())
            self.choose("testbed")
            wait_for(lambda: self.ask("haptic.world.scene === 'testbed' && haptic.frame.connected && haptic.frame.device"),
                     "a session")
            wait_for(lambda: self.ask("haptic.banner()") == "", "no complaint")
        self.pull(0.0, WALL + 0.03)
        wait_for(lambda: self.frame()["F_env"][1] < -0.5, "a force on the wall")


class Linkage(PageTest):
    WORLD = "linkage"

    def setUp(self):
        show(self.driver, self.url)
        begin(self.driver)

    def test_nothing_of_the_scene_covers_a_button(self):
        self.pull(0.5, 0.0)
        self.assertEqual(self.ask(
            """(() => {
              const box = (element) => element.getBoundingClientRect();
              const meet = (a, b) => a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
              const scene = ['scene', 'hint', 'spring-force'].map((id) => document.getElementById(id))
                .filter((element) => element.offsetWidth);
              return [...document.querySelectorAll('button, select, label, summary')]
                .filter((button) => button.offsetWidth && scene.some((part) => meet(box(button), box(part))))
                .map((button) => button.textContent);
            })()"""), [])

    def test_arrows_are_no_longer_than_a_third_of_the_scene(self):
        def force():
            return math.hypot(*self.frame()["F_hand"][:3])

        def pulls():
            if force() <= 1:  # N; a page that hung for a second has lost its hold.
                self.pull(0.5, 0.0)
            return force() > 1

        wait_for(pulls, "the hand's force")
        metres = force() * self.ask("haptic.scene().metresPerNewton")
        begin_at, end_at = (self.ask(f"haptic.project([{x}, 0, 0])") for x in (0, metres))
        self.assertLess(math.dist(begin_at, end_at), self.ask("document.getElementById('scene').clientHeight") / 3)

    def test_the_answer_is_not_cut_at_1280_pixels(self):
        self.driver.execute_script("haptic.hand.grab(); haptic.hand.moveBy(0.05, 0.05, 0)")
        wait_for(lambda: "farther than epsilon" in self.conclusion()[0], "a long sentence")
        self.assertEqual(self.ask("innerWidth"), 1280)
        self.assertEqual(self.ask(
            """(() => {
              const sentence = document.getElementById('chain-reason');
              const { bottom } = sentence.getBoundingClientRect();
              return [sentence.scrollWidth <= sentence.clientWidth, sentence.scrollHeight <= sentence.clientHeight,
                      bottom <= innerHeight];
            })()"""), [True, True, True])
        self.assertEqual(self.ask("""[...document.querySelectorAll('#chain li, #chain output')]
            .filter((part) => part.scrollWidth > part.clientWidth).map((part) => part.textContent)"""), [])

    def test_methods_that_do_not_suit_the_tool_cannot_be_chosen(self):
        self.assertEqual(self.ask(
            "[...document.querySelectorAll('#methods button:disabled')].map((b) => b.dataset.method)"),
            ["ir", "coupler", "engine"])


class OfferedLittle(PageTest):
    """A session of another program: no menu, no methods, no starts, no settings of the client, no chain, no names."""

    BARE = """
      const parse = JSON.parse;
      JSON.parse = (text) => {
        const message = parse(text);
        if (message.type === 'world') {
          for (const name of ['scenes', 'starts', 'start', 'methods', 'controllers', 'update_rules']) delete message[name];
          for (const name of ['epsilon', 'rate', 'delay', 'jitter', 'loss']) delete message.ranges[name];
          for (const body of message.bodies) body.name = '';
        }
        for (const name of ['environment', 'method', 'chain', 'recording']) if (message.type === 'frame') delete message[name];
        return message;
      };"""

    def test_what_a_world_does_not_offer_is_hidden_and_the_rest_works(self):
        self.driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": self.BARE})
        show(self.driver, self.url + "&scene=push&method=ir&delay=0.1&stiffness=5000")
        wait_for(lambda: self.ask("haptic.scene().live"), "the scene")
        hidden = ("methods", "start-choice", "scene-choice", "chain", "chain-reason", "recording", "loading")
        self.assertEqual([name for name in hidden if self.driver.find_element("id", name).is_displayed()], [])
        self.assertEqual(self.ask("[...document.querySelectorAll('.field')].filter((field) => field.offsetWidth)"
                                  ".map((field) => field.dataset.field)"),
                         ["stiffness", "damping", "friction", "restitution", "coupling_stiffness", "coupling_damping",
                          "coupling_angular_stiffness", "coupling_angular_damping"])
        self.assertEqual(self.ask("[...document.querySelectorAll('#panel summary')].filter((title) => title.offsetWidth)"
                                  ".map((title) => title.textContent)"), ["Contact", "Controller"])
        self.pull(0.0, WALL + 0.03)
        wait_for(lambda: self.frame()["F_env"][1] < -0.5, "a force on the wall")


class WithAKey(unittest.TestCase):
    """Both programs have a key: the page needs the token in its address."""

    def test_the_address_in_the_log_opens_it_and_no_other(self):
        with contextlib.ExitStack() as stack:
            folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory()))
            key = folder / "haptic.key"
            subprocess.run([pathlib.Path(SERVER).with_name("haptic_keygen"), key], check=True)
            log = stack.enter_context(open(folder / "log", "w"))
            session = stack.enter_context(live_session(
                SERVER, CLIENT, WORLDS, "--key-file", key, client_options=("--key-file", key),
                client_log=log))
            address = re.search(r"http://\S+/\?token=\w+", (folder / "log").read_text())[0]
            driver = browser()
            stack.callback(driver.quit)
            driver.get(session.url)
            self.assertIn("token", driver.find_element("tag name", "body").text)
            show(driver, address)
            driver.delete_all_cookies()   # the page keeps the token for its web socket
            session.kill_server()
            session.start_server()
            begin(driver)

if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
