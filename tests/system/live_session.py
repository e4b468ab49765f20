"""The real haptic_server and ve_client with a live page, and Chromium to look at it."""

import contextlib
import pathlib
import socket
import subprocess
import time

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

PATIENCE = 20  # s


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def wait_for(condition, what, patience=PATIENCE):
    """What condition() is once it is true. Raises AssertionError after `patience` seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.05)
    raise AssertionError(f"waited {patience} s for {what}")


def listens(port):
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def start(command, log=None):
    return subprocess.Popen([str(part) for part in command], stderr=log)


class Session:
    """Both programs: ve_client with its page, and haptic_server, which may come and go."""

    def __init__(self, server, client, worlds, server_options, client_options, world, client_log=None):
        udp, tcp = free_port(socket.SOCK_DGRAM), free_port(socket.SOCK_STREAM)
        self.url = f"http://127.0.0.1:{tcp}/"
        self.server = None
        self._server = [server, "--listen", f"127.0.0.1:{udp}", "--status", "false",
                        "--device-option", "friction=0", *server_options]
        self.client = start([client, "--server", f"127.0.0.1:{udp}", "--world",
                             pathlib.Path(worlds) / f"{world}.sdf", "--page", f"127.0.0.1:{tcp}",
                             "--connect-timeout", "0", "--quiet", *client_options], client_log)
        self._port = tcp

    def wait_for_page(self):
        wait_for(lambda: listens(self._port), "the page's server")

    def start_server(self):
        self.server = start(self._server)

    def kill_server(self):
        """Without a goodbye."""
        if self.server:
            self.server.kill()
            self.server.wait()
            self.server = None

    def end(self):
        for process in filter(None, (self.client, self.server)):
            process.terminate()
            process.wait(timeout=PATIENCE)


@contextlib.contextmanager
def live_session(server, client, worlds, *server_options, world="testbed", client_options=(),
                 serving=True, client_log=None):
    """Both programs until the end of the block; without haptic_server at first if not `serving`."""
    session = Session(server, client, worlds, server_options, client_options, world, client_log)
    try:
        if serving:
            session.start_server()
        session.wait_for_page()
        yield session
    finally:
        session.end()


def browser(*more):
    """A headless Chromium that draws without a graphics card, its page 1280 x 800 pixels. more: of its options."""
    options = webdriver.ChromeOptions()
    for argument in ("--headless=new", "--no-sandbox", "--enable-unsafe-swiftshader",
                     "--window-size=1280,943", "--disable-dev-shm-usage", *more):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)
    driver.set_script_timeout(PATIENCE)
    return driver


def resize(driver, width, height, phone=False):
    """The page's size in pixels, also below what a window can have; a phone has fingers instead of a mouse."""
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {
        "width": width, "height": height, "deviceScaleFactor": 1, "mobile": phone})
    driver.execute_cdp_cmd("Emulation.setTouchEmulationEnabled", {"enabled": phone})


def hang(driver, seconds):
    """The page does nothing else for so long, beginning when this has returned."""
    driver.execute_script(
        "setTimeout((seconds) => { const end = performance.now() + 1000 * seconds;"
        "while (performance.now() < end); }, 100, arguments[0])", seconds)


def begin(driver, start=""):
    """A new session in which the tool begins there."""
    driver.execute_script(
        "window.earlier = haptic.world; haptic.send({type: 'reset', start: arguments[0]})", start)
    wait_for(lambda: driver.execute_script(
        "return haptic.world !== earlier && haptic.world.servo_rate && haptic.frame.device"),
        "a new session")


EXPERT = "#view=expert"   # of the page's address: all that there is is shown


def show(driver, url):
    """Opens the page anew and waits until it shows the device."""
    driver.get("about:blank")   # another fragment alone opens nothing
    driver.get(url)
    wait_for(lambda: driver.execute_script(
        "return window.haptic && haptic.frame && haptic.frame.device"), "a frame with the device")
