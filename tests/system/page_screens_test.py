#!/usr/bin/python3
"""The live page on screens of five sizes, light and dark: axe-core finds nothing, no text is cut, nothing overflows. At first
look the scene has most of the window, and few numbers are shown.

Usage: page_screens_test.py SERVER CLIENT WORLDS [TEST…]
"""

import contextlib
import pathlib
import sys
import unittest

SKIPPED = 77
AXE = pathlib.Path(__file__).parent / "page/node_modules/axe-core/axe.min.js"
if not AXE.exists():
    print("skipped: axe-core is not installed: run scripts/setup test")
    sys.exit(SKIPPED)
try:
    from live_session import EXPERT, begin, browser, live_session, resize, show, wait_for
except ImportError:
    print("skipped: python3-selenium is not installed")
    sys.exit(SKIPPED)

SERVER, CLIENT, WORLDS = sys.argv[1:4]
# Width, height in pixels, and whether it is a phone.
SCREENS = ((1280, 720, False), (1920, 1080, False), (1024, 768, False), (390, 844, True), (844, 390, True))
LEAST_SCENE = {(1280, 720): (600, 320), (1920, 1080): (1100, 700), (1024, 768): (600, 350), (390, 844): (390, 350),
               (844, 390): (500, 250)}
MOST_NUMBERS = 10     # at first look
LEAST_SHARE = 0.6     # of the window, for the scene

# Texts that do not fit into their element, or lie outside the page. Menus end their entries with an ellipsis.
CUT = """
  const faults = [];
  for (const element of document.querySelectorAll('body *')) {
    const says = [...element.childNodes].some(({ nodeType, data }) => nodeType === Node.TEXT_NODE && data.trim());
    if (!says || !element.offsetWidth || element.closest('select, script, #skip') || element.matches('.unseen')) continue;
    const { left, right } = element.getBoundingClientRect();
    const inline = getComputedStyle(element).display === 'inline';
    const cut = !inline && (element.scrollWidth > element.clientWidth || element.scrollHeight > element.clientHeight + 2);
    if (cut || left < -1 || right > innerWidth + 1) faults.push(`${element.tagName} ${element.textContent.trim().slice(0, 40)}`);
  }
  const wide = document.documentElement.scrollWidth;
  if (wide > innerWidth) faults.push(`the page is ${wide} pixels wide`);
  return faults;"""

# Controls that are smaller than 24 x 24 pixels, with their labels.
SMALL = """
  return [...document.querySelectorAll('button, select, input, summary')].filter((control) => control.offsetWidth)
    .map((control) => control.type === 'checkbox' ? control.closest('label') : control)
    .filter((control) => Math.min(control.offsetWidth, control.offsetHeight) < 24)
    .map((control) => `${control.tagName} ${control.id} ${control.offsetWidth} x ${control.offsetHeight}`);"""

# Numbers in texts and entries that are shown; of menus the chosen entry counts.
NUMBERS = """
  const shown = (element) => element.checkVisibility({ visibilityProperty: true });
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), said = [];
  while (texts.nextNode()) {
    const { parentElement: element, data } = texts.currentNode;
    if (shown(element) && !element.closest('option, script')) said.push(data);
  }
  for (const entry of document.querySelectorAll('input:not([type=range], [type=checkbox])')) if (shown(entry)) said.push(entry.value);
  for (const menu of document.querySelectorAll('select')) if (shown(menu)) said.push(menu.selectedOptions[0]?.text ?? '');
  return said.join(' ').match(/\\d+([.,]\\d+)*/g) ?? [];"""

FINDINGS = """
  const done = arguments[0];
  axe.run(document, { rules: { 'target-size': { enabled: true } } }).then(({ violations }) => done(
    violations.map(({ id, nodes }) => `${id}: ${nodes.slice(0, 4).map(({ html }) => html.slice(0, 120)).join(' | ')}`)));"""


class Screens(unittest.TestCase):
    """With all that there is."""

    WORLD = "testbed"
    SERVER_OPTIONS = ()
    VIEW = EXPERT

    @classmethod
    def setUpClass(cls):
        cls.stack = contextlib.ExitStack()
        cls.session = cls.stack.enter_context(live_session(
            SERVER, CLIENT, WORLDS, "--log-level", "off", *cls.SERVER_OPTIONS, world=cls.WORLD, client_options=("--log-level", "off")))
        cls.driver = browser()
        cls.stack.callback(cls.driver.quit)

    @classmethod
    def tearDownClass(cls):
        cls.stack.close()

    def on_each_screen(self, check):
        for width, height, phone in SCREENS:
            resize(self.driver, width, height, phone)
            show(self.driver, self.session.url + self.VIEW)
            wait_for(lambda: self.driver.execute_script("return haptic.drawn > 0"), "a picture")
            with self.subTest(screen=f"{width} x {height}"):
                check(width, height)

    def prefer(self, **preferences):
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [
            {"name": name.replace("_", "-"), "value": value} for name, value in preferences.items()]})

    def open_settings(self):
        """Where they are folded."""
        if self.VIEW == EXPERT:
            self.driver.execute_script(
                "if (document.getElementById('panel').classList.contains('folded')) document.getElementById('panel-toggle').click()")

    def axe_finds_nothing(self):
        for scheme in ("light", "dark"):
            self.prefer(prefers_color_scheme=scheme)
            wait_for(lambda: self.driver.execute_script(
                "return document.getAnimations().every(({ effect }) => effect.getComputedTiming().iterations === Infinity)"), "its colours")
            self.assertEqual(self.driver.execute_async_script(FINDINGS), [], scheme)
        self.prefer(prefers_color_scheme="light")

    def test_axe_finds_nothing_no_text_is_cut_and_every_control_can_be_hit(self):
        def check(width, height):
            self.driver.execute_script(AXE.read_text())
            self.axe_finds_nothing()
            self.driver.execute_script("haptic.hand.grab(); haptic.hand.moveBy(-0.11, -0.11, 0)")   # long numbers
            wait_for(lambda: self.driver.execute_script("return haptic.frame.device[0] < -0.05"), "the tool there")
            self.assertEqual(self.driver.execute_script(CUT), [])
            self.assertEqual(self.driver.execute_script(SMALL), [])
            size = self.driver.execute_script(
                "const { clientWidth, clientHeight } = document.getElementById('scene'); return [clientWidth, clientHeight]")
            for pixels, least in zip(size, LEAST_SCENE[width, height]):
                self.assertGreaterEqual(pixels, least)
            self.open_settings()
            self.assertEqual(self.driver.execute_script(CUT), [])
            self.axe_finds_nothing()

        self.on_each_screen(check)


class ScreensInSpace(Screens):
    """With the buttons and the sentence that a spatial tool has."""

    WORLD = "peg_in_hole_3d"
    SERVER_OPTIONS = ("--device-option", "freedom=spatial")


class FirstLook(Screens):
    VIEW = ""

    def test_the_scene_has_most_of_the_window_and_few_numbers_are_shown(self):
        def check(width, height):
            begin(self.driver)
            self.driver.execute_script("haptic.hand.grab(); haptic.hand.moveBy(0, 0.16, 0)")   # onto the wall
            wait_for(lambda: self.driver.execute_script("return haptic.frame.F_env[1] < -1"), "a force")
            share = self.driver.execute_script(
                "const { width, height } = document.getElementById('scene').getBoundingClientRect();"
                "return width * height / innerWidth / innerHeight")
            self.assertGreater(share, LEAST_SHARE)
            numbers = self.driver.execute_script(NUMBERS)
            self.assertLessEqual(len(numbers), MOST_NUMBERS, numbers)
            self.assertIn("4", numbers)     # kN/m
            fields = "return [...document.querySelectorAll('.field')].filter((field) => field.offsetWidth).length"
            self.assertEqual(self.driver.execute_script(fields), 1)
            self.assertEqual(self.driver.execute_script("return document.documentElement.scrollHeight"), height)
            self.driver.execute_script("haptic.hand.release()")

        self.on_each_screen(check)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
