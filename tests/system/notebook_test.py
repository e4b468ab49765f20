#!/usr/bin/python3
"""The page of a session as a notebook shows it: a frame in a page of another port, in headless Chromium.

Usage: notebook_test.py PROGRAMS LIBHAPTIC PACKAGE_FOLDER [TEST…]
"""

import contextlib
import functools
import http.server
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import threading
import unittest

PROGRAMS, LIBRARY, PACKAGE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
os.environ.update(HAPTIC_LIBRARY=str(LIBRARY), HAPTIC_SERVER_PROGRAM=str(PROGRAMS / "haptic_server"),
                  HAPTIC_PAGE_PROGRAM=str(PROGRAMS / "haptic_page"))
sys.path.insert(0, str(PACKAGE))
SKIPPED = 77
try:
    from live_session import browser, free_port, start, wait_for
except ImportError:
    print("skipped: python3-selenium is not installed")
    sys.exit(SKIPPED)
import haptic_local_model as haptic  # noqa: E402

STRANGER = "stranger.example"   # is told to be this machine


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


class Notebook(unittest.TestCase):
    """A cell's output, in a page that another program of this machine serves."""

    def setUp(self):
        self.stack = contextlib.ExitStack()
        self.addCleanup(self.stack.close)
        self.folder = pathlib.Path(self.stack.enter_context(tempfile.TemporaryDirectory()))
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=self.folder))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.stack.callback(server.server_close)
        self.stack.callback(server.shutdown)
        self.port = server.server_port
        self.driver = browser(f"--host-resolver-rules=MAP {STRANGER} 127.0.0.1")
        self.stack.callback(self.driver.quit)

    def session(self, **options):
        return self.stack.enter_context(haptic.Session(tool=haptic.sphere(), **options))

    def show(self, touch, host, output=None):
        """Goes into the frame."""
        (self.folder / "cell.html").write_text(output or touch._repr_html_())
        self.driver.get(f"http://{host}:{self.port}/cell.html")
        self.driver.switch_to.frame(0)

    def is_alive(self, touch):
        """Whether the page in the frame shows the device; goes on with the session."""
        touch.poll()
        touch.sample(touch.q, touch.v, 1 / 60)
        touch.send(haptic.contacts(0))
        return self.driver.execute_script("return Boolean(window.haptic && haptic.frame && haptic.frame.device)")

    def test_a_session_is_shown_in_a_notebook_of_this_machine_and_in_no_other(self):
        touch = self.session()
        for host in ("127.0.0.1", "localhost"):
            with self.subTest(host):
                self.show(touch, host)
                wait_for(lambda: self.is_alive(touch), "the page in the frame")
        self.show(touch, STRANGER)
        self.assertNotIn("haptic", self.driver.page_source)
        (self.folder / "outer.html").write_text(f'<iframe src="http://127.0.0.1:{self.port}/cell.html"></iframe>')
        self.driver.get(f"http://{STRANGER}:{self.port}/outer.html")    # a stranger's window around a page of this machine
        self.driver.switch_to.frame(0)
        self.driver.switch_to.frame(0)
        self.assertNotIn("haptic", self.driver.page_source)
        touch.close()
        self.assertIsNone(touch._repr_html_())

    def test_with_a_key_the_frame_has_the_token_and_its_cookie_alone_opens_none(self):
        key, udp = self.folder / "haptic.key", free_port(socket.SOCK_DGRAM)
        subprocess.run([PROGRAMS / "haptic_keygen", key], check=True)
        server = start([PROGRAMS / "haptic_server", "--listen", f"127.0.0.1:{udp}", "--status", "false", "--log-level", "off",
                        "--device-option", "freedom=spatial", "--key-file", key])
        self.stack.callback(server.wait)
        self.stack.callback(server.terminate)
        touch = self.session(server=f"127.0.0.1:{udp}", key_file=str(key))
        for host in ("127.0.0.1", "localhost"):
            with self.subTest(host):
                self.driver.delete_all_cookies()
                self.show(touch, host)
                wait_for(lambda: self.is_alive(touch), "the page in the frame")
        bare = touch.show(open_browser=False).split("?")[0]
        self.show(touch, "127.0.0.1", f'<iframe src="{bare}"></iframe>')
        self.assertNotIn("haptic", self.driver.page_source)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
