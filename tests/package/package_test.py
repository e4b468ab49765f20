#!/usr/bin/python3
"""What is installed works away from the source tree: the library, the programs, the page.

Usage: package_test.py SOURCE BUILD, where all programs have been built in BUILD
"""

import contextlib
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.error
import urllib.parse
import urllib.request

SOURCE, BUILD = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
EXAMPLE = SOURCE / "examples/client"
NEEDED = {"Boost", "Eigen3", "Threads"}
# Parts of the paths of headers that the client library must not need.
FOREIGN = ("/spdlog/", "/CLI/", "/toml++/", "/ode/", "/ccd/", "/sdformat", "/nlohmann/", "/pcap")
PATIENCE = 20  # s
USES_SEALING = """#include <hlm/protocol/sealing/key_file.h>
#include <hlm/protocol/sealing/sealed_client_link.h>
void seal(hlm::protocol::DatagramLink& socket, const hlm::protocol::Endpoint& server) {
  hlm::protocol::SealedClientLink link(socket, server, hlm::protocol::read_key("haptic.key"));
  link.forget(server);
}
"""


def cached(name):
    """A variable of BUILD's configuration, "" if it has none."""
    found = re.search(rf"^{name}:\w+=(.*)$", (BUILD / "CMakeCache.txt").read_text(), re.M)
    return found.group(1) if found else ""


def run(*command, **variables):
    """What the command prints. Raises AssertionError with that if it fails."""
    done = subprocess.run([str(part) for part in command], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, env={**os.environ, **variables})
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}:\n{done.stdout}")
    return done.stdout


@contextlib.contextmanager
def running(*command):
    process = subprocess.Popen([str(part) for part in command])
    try:
        yield process
    finally:
        process.terminate()
        process.wait(timeout=PATIENCE)


def free_port(kind):
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def optional_packages():
    """What any CMakeLists.txt looks for, except what the client library needs."""
    names = set(re.findall(r"find_package\((\w+)", (SOURCE / "CMakeLists.txt").read_text()))
    for path in (SOURCE / "tests").rglob("CMakeLists.txt"):
        names.update(re.findall(r"find_package\((\w+)", path.read_text()))
    return names - NEEDED


def fetch(url):
    """The text at the URL, asked for until the server is there."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            with urllib.request.urlopen(url, timeout=PATIENCE) as response:
                return response.read().decode()
        except urllib.error.HTTPError as error:
            raise AssertionError(f"{url}: {error}") from error
        except OSError:
            if time.monotonic() > end:
                raise
            time.sleep(0.05)


def files_read_by(page):
    """The page's URL, and every style sheet and module that it and its modules name."""
    index = fetch(page)
    imports = dict(re.findall(r'"([\w/.]+)": "(\./[^"]+)"', index))
    waiting = re.findall(r'(?:href|src)="([^":]+\.(?:css|js))"', index)
    waiting = [urllib.parse.urljoin(page, name) for name in waiting]
    seen = {page}
    while waiting:
        url = waiting.pop()
        if url in seen:
            continue
        seen.add(url)
        text = fetch(url)
        if url.endswith(".js"):
            for name in re.findall(r"""^(?:import|export|\}).*?["']([^"'\n]+)["'];?$""", text, re.M):
                base = page if name in imports else url
                waiting.append(urllib.parse.urljoin(base, imports.get(name, name)))
    return seen


class Package(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)
        cls.prefix = cls.folder / "prefix"
        run("cmake", "--install", BUILD, "--prefix", cls.prefix)
        cls.programs = cls.prefix / "bin"

    def build_example(self, name, cmake_lists, *options, code=""):
        """The example in a folder of its own, with more code and a flaw that -Wall reports. Returns where it
        was built."""
        folder = self.folder / name
        shutil.copytree(EXAMPLE, folder)
        (folder / "CMakeLists.txt").write_text(cmake_lists)
        with (folder / "main.cc").open("a") as main:
            main.write(code + "void users_own() { int unused = 0; }\n")
        flags = "-Wall -Wextra -Werror=unused-result"
        run("cmake", "-G", "Ninja", "-S", folder, "-B", folder / "build", f"-DCMAKE_CXX_FLAGS={flags}",
            f"-DCMAKE_CXX_COMPILER={cached('CMAKE_CXX_COMPILER')}", "-DCMAKE_BUILD_TYPE=Debug",
            f"-DCMAKE_CXX_COMPILER_LAUNCHER={shutil.which('ccache') or ''}", *options)
        output = run("cmake", "--build", folder / "build")
        warnings = re.findall(r"warning: .*", output)
        self.assertEqual(len(warnings), 1, output)
        self.assertIn("unused variable", warnings[0])
        return folder / "build"

    def test_an_installed_client_library_serves_a_users_project(self):
        build = self.build_example("by_package", (EXAMPLE / "CMakeLists.txt").read_text(),
                                   f"-DCMAKE_PREFIX_PATH={self.prefix}")
        hand = self.folder / "hand.toml"
        hand.write_text("after = 'hold'\n[[segment]]\nduration = 1.0\n"
                        "move_to = { position = [0, 0.05, 0] }\n")
        server = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
        with running(self.programs / "haptic_server", "--listen", server, "--hand", hand,
                     "--status", "false"):
            lines = run(build / "simulator", server).splitlines()
        # The hand wants to be 35 mm below where the ball meets the floor.
        last = re.fullmatch(r"connected, ball at \(\S+, (\S+)\) m, contacts: 1, force on the hand: (\S+) N", lines[-1])
        self.assertTrue(last, lines)
        self.assertGreater(float(last.group(2)), 1)
        self.assertAlmostEqual(float(last.group(1)), 0.015, delta=0.005)
        # By itself it starts a server, whose hand leads the ball 10 mm into the floor with 200 N/m, against 4 kN/m.
        lines = run(build / "simulator", HAPTIC_SERVER=server, PATH=f"{self.programs}:{os.environ['PATH']}").splitlines()
        self.assertRegex(lines[-1], r"connected, ball at \(0\.0000, 0\.015[45]\) m, contacts: 1, force on the hand: 1\.9\d N")

    def test_an_installed_sealing_library_serves_a_users_project(self):
        cmake_lists = (EXAMPLE / "CMakeLists.txt").read_text().replace("hlm::client", "hlm::client hlm::sealing")
        self.build_example("sealed", cmake_lists, f"-DCMAKE_PREFIX_PATH={self.prefix}", code=USES_SEALING)

    def test_the_installed_c_interface_serves_c_by_pkg_config_and_python(self):
        paths = {**os.environ, "PKG_CONFIG_PATH": next(self.prefix.rglob("pkgconfig")).as_posix()}
        flags = subprocess.run(["pkg-config", "--cflags", "--libs", "haptic"], env=paths, text=True, check=True,
                               stdout=subprocess.PIPE).stdout.split()
        program = self.folder / "touch"
        run("cc", "-std=c99", "-D_POSIX_C_SOURCE=199309L", "-Wall", "-Wextra", "-Werror", SOURCE / "examples/c/touch.c",
            "-o", program, *flags)
        nobody = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
        lines = run(program, HAPTIC_SERVER=nobody, HAPTIC_PAGE_PROGRAM="/bin/true").splitlines()
        self.assertIn("page: no page: haptic_page has ended", lines)
        # 200 N/m against four corners of 4 kN/m, 20 mm.
        self.assertRegex(lines[-1], r"3\.9\d N")
        found = subprocess.run(["/usr/bin/python3", "-c", "import haptic_local_model as haptic; haptic.Session(); print(haptic.__file__)"],
                               text=True, check=True, stdout=subprocess.PIPE, cwd=self.folder,
                               env={"PYTHONPATH": str(self.prefix / "lib/python3/dist-packages")}).stdout
        self.assertIn(str(self.prefix), found)

    def test_a_subdirectory_builds_the_client_library_with_eigen_and_boost_alone(self):
        cmake_lists = re.sub(r"find_package\(.*\)", f"add_subdirectory({SOURCE} haptic_local_model)",
                             (EXAMPLE / "CMakeLists.txt").read_text())
        hidden = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in optional_packages()]
        self.assertGreater(len(hidden), 5)
        build = self.build_example("by_subdirectory", cmake_lists, *hidden)
        headers = run("ninja", "-C", build, "-t", "deps")
        self.assertIn("/eigen3/", headers)
        for part in FOREIGN:
            self.assertNotIn(part, headers)

    def test_either_side_configures_without_what_only_the_other_needs(self):
        for left_out, packages in (("HLM_SERVER", []),
                                   ("HLM_VE_CLIENT", ["sdformat12", "assimp"])):
            hidden = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{name}=ON" for name in packages]
            run("cmake", "-G", "Ninja", "-S", SOURCE, "-B", self.folder / left_out,
                f"-DCMAKE_CXX_COMPILER={cached('CMAKE_CXX_COMPILER')}", f"-D{left_out}=OFF", *hidden)

    def test_an_installed_program_serves_the_installed_page(self):
        mark = "<!-- the installed one -->"
        with (self.prefix / "share/haptic_local_model/page/index.html").open("a") as index:
            index.write(mark)
        address = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        with running(self.programs / "ve_client", "--world",
                     self.prefix / "share/haptic_local_model/worlds/testbed.sdf", "--server",
                     f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}", "--page", address, "--quiet"):
            self.assertIn(mark, fetch(f"http://{address}/"))
            files = files_read_by(f"http://{address}/")
        for name in ("main.js", "three.core.js", "OrbitControls.js", "uPlot.esm.js", "style.css"):
            self.assertTrue(any(url.endswith(f"/{name}") for url in files), (name, files))

    def test_the_units_of_the_service_and_of_many_sessions_are_installed(self):
        units = self.prefix / "lib/systemd/system"
        self.assertEqual(sorted(path.name for path in units.iterdir()),
                         ["haptic_server.service", "haptic_server@.service", "ve_client@.service"])
        for path in units.iterdir():
            text = path.read_text()
            self.assertNotRegex(text, r"@[A-Z]+_", path)  # CMake has filled it in.
            # After a crash a person at a device lets force come back; where there is none, it does by itself.
            self.assertEqual("Restart=no" in text, path.name == "haptic_server.service")

    def test_nothing_installed_names_the_source_tree(self):
        for path in self.prefix.rglob("*"):
            if path.suffix in (".cmake", ".h", ".js", ".html", ".service"):
                self.assertNotIn(str(SOURCE), path.read_text(), path)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
