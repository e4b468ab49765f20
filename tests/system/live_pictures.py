#!/usr/bin/python3
"""Pictures of the live page: the first look, free motion, pressing on the wall, and the peg in the hole under two methods.

Usage: live_pictures.py SERVER CLIENT WORLDS FOLDER

Writes first.png, free.png, wall.png, hole_lm5.png and hole_ir.png (docs/live_first.png, live.png and live_ir.png are of them).
"""

import math
import pathlib
import sys
import time

from live_session import begin, browser, live_session, show

WALL = 0.124   # m: y of the peg on the bottom wall


class Page:
    def __init__(self, driver, folder):
        self.driver = driver
        self.folder = pathlib.Path(folder)

    def do(self, script):
        return self.driver.execute_script(script)

    def frame(self):
        return self.do("return haptic.frame")

    def click(self, selector):
        self.do(f"document.querySelector('{selector}').click()")

    def move(self, dx, dy, seconds):
        """The hand, evenly, m."""
        steps = max(1, round(seconds * 60))
        for _ in range(steps):
            self.do(f"haptic.hand.moveBy({dx / steps}, {dy / steps}, 0)")
            time.sleep(seconds / steps)

    def shake(self, amplitude, seconds):
        """The hand to and fro along x once a second."""
        self.driver.execute_async_script(
            """const [amplitude, seconds, done] = arguments, began = performance.now();
            let at = 0;
            const timer = setInterval(() => {
              const t = (performance.now() - began) / 1000;
              const x = amplitude * Math.sin(2 * Math.PI * t);
              haptic.hand.moveBy(x - at, 0, 0);
              at = x;
              if (t > seconds) { clearInterval(timer); done(); }
            }, 16);""", amplitude, seconds)

    def picture(self, name):
        print(f"{name}: F_env {math.hypot(*self.frame()['F_env'][:3]):.2f} N, "
              f"proxy-tool {1e3 * max(self.do('return haptic.ticksOf(`proxy_tool`).slice(-2000)')):.2f} mm, "
              f"{self.do('return haptic.fps()'):.0f} frames/s, banner '{self.do('return haptic.banner()')}'")
        self.driver.save_screenshot(str(self.folder / f"{name}.png"))


def free_motion(page):
    begin(page.driver)
    page.do("haptic.hand.grab()")
    page.move(-0.06, -0.06, 1.0)
    page.do("haptic.hand.turnBy(0.5)")
    page.move(0.11, 0.0, 1.2)
    page.picture("free")
    page.do("haptic.hand.release()")


def on_the_wall(page, name):
    begin(page.driver)
    page.do("haptic.hand.grab()")
    page.move(0.0, WALL, 2.0)
    page.move(0.0, 0.012, 1.0)
    time.sleep(2)
    page.picture(name)
    page.do("haptic.hand.release()")


def in_the_hole(page):
    begin(page.driver, "hole")
    page.click(".situations button")
    page.do("haptic.hand.grab()")
    for method in ("lm5", "ir"):
        page.click(f"[data-method={method}]")
        page.shake(0.015, 6.25)   # Ends where the hand pulls most.
        page.picture(f"hole_{method}")
    page.do("haptic.hand.release()")


def main():
    server, client, worlds, folder = sys.argv[1:]
    with live_session(server, client, worlds, "--log-level", "warn") as session:
        driver = browser()
        try:
            show(driver, session.url)
            page = Page(driver, folder)
            page.do("haptic.quality('shadows')")   # however busy the machine is
            on_the_wall(page, "first")
            page.click("#expert")
            free_motion(page)
            on_the_wall(page, "wall")
            in_the_hole(page)
        finally:
            driver.quit()


if __name__ == "__main__":
    main()
