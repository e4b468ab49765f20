#!/usr/bin/env python3
"""What an enemy or a broken client can do to haptic_server, over raw sockets on loopback.

Usage: attacks_test.py HAPTIC_SERVER PROTOCOL.md [unittest arguments]

The packets are made from the protocol's document alone. A hand pushes the simulated device against
a wall that the client reports, harder than the force limit of 12 N. What the server did is read from its tick log.
"""

import contextlib
import csv
import importlib.util
import math
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest

SERVER, DOCUMENT = None, None

RATE = 60  # Hz
WALL = 0.01  # m
LIMIT = 12  # N
FASTEST = 3000  # N/s, the default limit
SILENT = 0.1  # N
PERIOD = 1e-3  # s, of the server
HEADER = 40

def drawn_to(x, y, seconds):
    """A hand that draws the handle there, 50 mm past a wall: 20 N where it stands, 12 N where the device gives way."""
    return f"""after = "hold"
[grip]
stiffness = 400
damping = 30
angular_stiffness = 2.0
angular_damping = 0.08
max_force = 30
max_torque = 0.3
[[segment]]
duration = {seconds}
move_to = {{ position = [{x}, {y}, 0], rotation = [0, 0, 0] }}
"""


HAND = drawn_to(WALL + 0.05, 0, 0.4)
# Endures whatever pauses a busy machine makes in test or server.
PATIENT = ("--silence-time", "10", "--max-gap", "60")


def load_document(path):
    """The tables of the document, its examples by message, and the encoder that its own test has."""
    source = pathlib.Path(path).parents[1] / "tests" / "protocol" / "document_test.py"
    spec = importlib.util.spec_from_file_location("document_test", source)
    encoder = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(encoder)
    text = pathlib.Path(path).read_text(encoding="utf-8")
    examples = {name: values for name, values, _ in encoder.read_examples(text)}
    return encoder, encoder.read_tables(text), examples


class Document:
    def __init__(self, path):
        self.encoder, self.tables, self.examples = load_document(path)
        self.types = {number: name for name, (number, _) in self.tables.items() if number}

    def encode(self, message, **changes):
        values = dict(self.examples[message])
        values.update({key.replace("__", "."): str(value) for key, value in changes.items()})
        return self.encoder.encode(self.tables, message, values)

    def decode(self, data):
        """(message, fixed fields by name)"""
        message = self.types[data[6]]
        values, offset = {}, 0
        for table in ("header", message):
            for _, kind, count, name, *_ in self.tables[table][1]:
                if kind in self.tables:
                    break
                n = 1 if count is None else int(values.get(count, count))
                if kind == "char":
                    values[name], offset = data[offset : offset + n], offset + n
                    continue
                code = f"<{n}{self.encoder.FORMATS[kind]}"
                if offset + struct.calcsize(code) > len(data):
                    break  # not sent by this version
                found = struct.unpack_from(code, data, offset)
                values[name] = found if count else found[0]
                offset += struct.calcsize(code)
        return message, values


class Server:
    """The real program, its hand and its tick log. wrap: of its command, for example in a namespace."""

    def __init__(self, *options, hand_script=HAND, wrap=lambda command: command, environment=None):
        self.clients = []
        self.folder = tempfile.TemporaryDirectory()
        self.log = pathlib.Path(self.folder.name) / "ticks.csv"
        hand = pathlib.Path(self.folder.name) / "hand.toml"
        hand.write_text(hand_script)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.address = probe.getsockname()
        # A real-time thread that fills its period, as a sanitized one does on a slow machine, stands still for 50 ms of each second.
        self.process = subprocess.Popen(
            wrap([SERVER, "--listen", "%s:%d" % self.address, "--hand", hand, "--log", self.log, "--status", "false",
                  "--device-option", "friction=0", "--realtime", "off", *options]),
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment)
        while "listening" not in (line := self.process.stderr.readline()):
            if not line:
                raise RuntimeError("the server did not start")

    def stop_for(self, seconds):
        os.kill(self.process.pid, signal.SIGSTOP)
        time.sleep(seconds)
        os.kill(self.process.pid, signal.SIGCONT)

    def ticks(self):
        """Ends the server; its log's rows. `errors` is then what it said on standard error."""
        self.process.terminate()
        self.errors = self.process.communicate(timeout=10)[1]
        with open(self.log, encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for row in rows:
            row["time"] = float(row["time_s"])
            row["force"] = math.hypot(*(float(row[f"command_force_{axis}_N"]) for axis in "xyz"))
        return rows

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for client in self.clients:
            client.socket.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.communicate()
        self.folder.cleanup()


class Client:
    """Speaks the protocol as its document has it, through one socket."""

    def __init__(self, server, nonce=None):
        self.server = server
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        server.clients.append(self)
        self.nonce = nonce or int.from_bytes(os.urandom(8), "little")
        self.hellos = self.sequence = self.session = 0
        self.state = {}
        self.refusals = 0

    def send(self, data):
        self.socket.sendto(data, self.server.address)

    def hello(self, **changes):
        self.hellos += 1
        values = dict(sequence=self.hellos, nonce=self.nonce, q_size=3, q="0 0 0", gravity="0 0 0", X_LH="0 0 0 1 0 0 0",
                      links__count=1, links__total=1, links__0__com="0 0 0", curves__count=0, curves__total=0, clears_fault=1)
        values.update(changes)
        self.send(DOC.encode("hello", **values))

    def answers(self, patience, last=lambda message, values: False):
        """All messages that come within `patience` seconds, or until one is the last."""
        end = time.monotonic() + patience
        found = []
        while (left := end - time.monotonic()) > 0:
            self.socket.settimeout(left)
            try:
                message, values = DOC.decode(self.socket.recv(2000))
            except socket.timeout:
                break
            found.append((message, values))
            if message == "proxy_state":
                self.state = values
            self.refusals += message == "refusal"
            if last(message, values):
                break
        return found

    def ask(self, patience=3, **changes):
        """The welcome or reject that answers a hello, which is repeated as the document has it; None for silence."""
        def answers_it(message, values):
            return message in ("welcome", "reject") and values["nonce"] == changes.get("nonce", self.nonce)
        end = time.monotonic() + patience
        while (left := end - time.monotonic()) > 0:
            self.hello(**changes)
            found = self.answers(min(left, 0.3), answers_it)
            if found and answers_it(*found[-1]):
                return found[-1]
        return None

    def begin(self, **changes):
        message, welcome = self.ask(**changes)
        assert message == "welcome", message
        self.session, self.sequence = welcome["session"], 0
        return welcome

    def update(self, **changes):
        """One update: a wall ahead of the tool."""
        self.sequence += 1
        q = self.state.get("q", (0, 0, 0))
        echo = self.state["step"] if self.state.get("session") == self.session else 0
        values = dict(session=self.session, sequence=self.sequence, echo_step=echo, echo_hold=0, compute_time=0,
                      impulse_step=0, q=" ".join(map(repr, q)), v="0 0 0", ve_period=1 / RATE,
                      bodies__count=0, bodies__total=0, drives__count=0, drives__total=0, contacts__0__b_kind=0,
                      contacts__0__p=f"{WALL} 0 0", contacts__0__n="-1 0 0",
                      contacts__0__separation=repr(WALL - q[0]), contacts__0__v_point="0 0 0",
                      contacts__0__friction=-1)
        values.update(changes)
        self.send(DOC.encode("contact_update", **values))

    def press(self, seconds, meanwhile=lambda: None, **changes):
        """Updates at RATE; `meanwhile` is called once per frame."""
        heard = []
        for _ in range(round(seconds * RATE)):
            self.update(**changes)
            meanwhile()
            heard += self.answers(1 / RATE)
        return heard


class Spoofer:
    """Sends blindly from an address and port that are another's, by a raw socket."""

    def __init__(self, source, target):
        self.source, self.target = source, target
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW)

    def send(self, data):
        addresses = socket.inet_aton(self.source[0]), socket.inet_aton(self.target[0])
        length = 8 + len(data)
        ip = struct.pack("!BBHHHBBH4s4s", 0x45, 0, 20 + length, 0, 0, 64, socket.IPPROTO_UDP, 0, *addresses)
        udp = struct.pack("!HHHH", self.source[1], self.target[1], length, 0)
        self.socket.sendto(ip + udp + data, self.target)


@contextlib.contextmanager
def pressing(*options, seconds=1.0):
    """A server and its client, which has pressed on the wall for a while."""
    with Server(*options) as server:
        client = Client(server)
        client.begin()
        client.press(seconds)
        assert client.state["server"] == 1, client.state
        assert client.state["F_command"][0] < -LIMIT + 0.1, client.state["F_command"]
        yield server, client


def goes_on(ticks, after=0.0):
    """The session in which all ticks from `after` on were running; None if there was another or a pause."""
    rows = [row for row in ticks if row["time"] > after and int(row["step"]) > 0]
    sessions = {row["session"] for row in rows}
    running = all(row["server_state"] in ("arming", "ramping", "active") for row in rows)
    return sessions.pop() if running and len(sessions) == 1 else None


class ForceTest(unittest.TestCase):
    def check_force(self, ticks):
        """Never above the limit, and no faster than the rate limit, except where a fault cuts it."""
        for before, row in zip(ticks, ticks[1:]):
            self.assertLessEqual(row["force"], LIMIT + 1e-9)
            if row["fault"] == "none" and row["server_state"] != "off":
                change = abs(row["force"] - before["force"])
                self.assertLessEqual(change, FASTEST * PERIOD + 1e-9, (before, row))


class Attacks(ForceTest):
    # Silence.

    def test_force_is_gone_100_ms_after_the_last_packet_at_60_hz(self):
        with pressing() as (server, client):
            time.sleep(0.4)
            ticks = server.ticks()
        last = max(row["time"] for row in ticks if row["adopted"] != "0")
        self.assertGreater(max(row["force"] for row in ticks if row["time"] <= last), LIMIT - 0.1)
        gone = min(row["time"] for row in ticks if row["time"] > last and row["force"] < SILENT)
        self.assertLess(gone - last, 0.1)
        self.check_force(ticks)

    def test_a_hello_cannot_buy_a_long_silence(self):
        with Server() as server:
            client = Client(server)
            welcome = client.begin(ve_rate=1e-3)
            client.press(1)
            time.sleep(0.6)
            ticks = server.ticks()
        self.assertLessEqual(welcome["silence_time"], 0.25)
        last = max(row["time"] for row in ticks if row["adopted"] != "0")
        self.assertEqual(max(row["force"] for row in ticks if row["time"] > last + 0.3), 0)

    # Taking over.

    def test_a_hello_from_the_clients_own_address_does_not_replace_its_session(self):
        with pressing(*PATIENT) as (server, client):
            mine = client.session
            answers = client.press(1, meanwhile=lambda: client.hello(nonce=12345))
            ticks = server.ticks()
        self.assertEqual({values["reason"] for message, values in answers if message == "reject"}, {2})
        self.assertNotIn("welcome", {message for message, _ in answers})
        self.assertEqual(goes_on(ticks), str(mine))

    def test_a_flood_of_hellos_from_the_clients_address_takes_nothing(self):
        with pressing(*PATIENT) as (server, client):
            def flood():
                for _ in range(200):
                    client.hello(nonce=int.from_bytes(os.urandom(8), "little"), gravity="100 0 0")
            client.press(1, meanwhile=flood)
            ticks = server.ticks()
        self.assertEqual(goes_on(ticks), str(client.session))
        self.check_force(ticks)

    def test_the_sessions_own_hello_again_is_answered_again(self):
        with pressing(*PATIENT) as (server, client):
            message, welcome = client.ask()
        self.assertEqual((message, welcome["session"]), ("welcome", client.session))

    def test_another_client_is_turned_away_until_the_first_is_silent_for_half_a_second(self):
        with pressing() as (server, client):
            other = Client(server)
            self.assertEqual(other.ask()[1]["reason"], 2)
            time.sleep(0.6)
            self.assertEqual(other.ask()[0], "welcome")

    # Ending.

    def test_goodbyes_with_ids_that_follow_from_known_ones_end_nothing(self):
        def follows(number):  # what earlier servers drew: SplitMix64
            number = (number + 0x9E3779B97F4A7C15) % 2**64
            number = (number ^ number >> 30) * 0xBF58476D1CE4E5B9 % 2**64
            number = (number ^ number >> 27) * 0x94D049BB133111EB % 2**64
            return number ^ number >> 31
        with Server(*PATIENT) as server:
            spy = Client(server)
            known = spy.begin()["session"]
            spy.send(DOC.encode("goodbye", session=known, sequence=1))
            time.sleep(0.3)
            client = Client(server)
            mine = client.begin()["session"]
            self.assertNotIn(mine, (known + 1, follows(known)))
            guesses = [known, known + 1, follows(known), follows(follows(known)), 1, 2**64 - 1]
            def guess():
                for session in guesses:
                    client.send(DOC.encode("goodbye", session=session, sequence=2**40))
            client.press(1, meanwhile=guess)
            ticks = server.ticks()
        self.assertEqual(goes_on([row for row in ticks if row["session"] != str(known)]), str(mine))

    def test_blind_hellos_and_goodbyes_with_the_clients_address_forged_change_nothing(self):
        with pressing(*PATIENT) as (server, client):
            try:
                blind = Spoofer(client.socket.getsockname(), server.address)
            except PermissionError:
                self.skipTest("raw sockets need CAP_NET_RAW")
            self.addCleanup(blind.socket.close)
            sent = 0

            def attack():
                nonlocal sent
                for _ in range(100):
                    number = int.from_bytes(os.urandom(8), "little") | 1
                    blind.send(DOC.encode("hello", sequence=number, nonce=number, gravity="100 0 0"))
                    blind.send(DOC.encode("goodbye", session=number, sequence=2**40))
                    sent += 2
            dropped = client.state["dropped"]
            client.press(1, meanwhile=attack)
            self.assertGreater(client.state["dropped"] - dropped, sent / 10)  # they do arrive
            ticks = server.ticks()
        self.assertEqual(goes_on(ticks), str(client.session))
        self.check_force(ticks)

    # Absurd numbers.

    def test_what_a_hello_may_demand_is_bounded(self):
        with Server() as server:
            client = Client(server)
            for changes in ({"gravity": "0 0 1e6"}, {"gravity": "0 -9810 0"}, {"links__0__mass": 1e4},
                            {"ve_rate": 1e9}, {"epsilon": 100}, {"q": "1e9 0 0"}, {"tool_length": 1e9},
                            {"links__0__com": "1e9 0 0"}, {"links__0__X_PJ": "1e9 0 0 1 0 0 0"}):
                with self.subTest(**changes):
                    message, answer = client.ask(**changes)
                    self.assertEqual((message, answer["reason"]), ("reject", 3))

    def test_numbers_beyond_any_place_are_refused(self):
        absurd = ({"contacts__0__v_point": "1e30 0 0"}, {"contacts__0__p": "1e200 0 0"}, {"v": "1e200 0 0"},
                  {"contacts__0__separation": "-1e200"}, {"q": "1e200 0 0"}, {"compute_time": 1e200},
                  {"echo_hold": 1e200}, {"ve_period": 1e200}, {"contacts__0__friction": 1e30},
                  {"contacts__0__load": 1e30}, {"contacts__0__n": "1e200 0 0"},
                  {"bodies__count": 1, "bodies__total": 1, "bodies__0__W": " ".join(["1e200"] * 21)})
        with pressing() as (server, client):
            for changes in absurd:
                with self.subTest(**changes):
                    client.refusals = 0
                    client.press(0.15, **changes)
                    client.press(0.1)
                    self.assertGreater(client.refusals, 0)
            ticks = server.ticks()
        self.assertEqual({row["fault"] for row in ticks}, {"none"})
        self.assertEqual({row["session"] for row in ticks if int(row["step"]) > 0}, {str(client.session)})
        self.check_force(ticks)

    def test_a_wall_faster_than_any_hand_is_a_fault_without_force(self):
        with pressing() as (server, client):
            client.press(0.5, contacts__0__v_point="-900 0 0", contacts__0__separation=0.0005,
                         compute_time=0.001)
            ticks = server.ticks()
        self.assertEqual((ticks[-1]["server_state"], ticks[-1]["fault"]), ("fault", "implausible"))
        self.assertEqual(ticks[-1]["force"], 0)
        self.assertTrue(all(abs(float(row["proxy_x_m"])) < 3 for row in ticks))
        self.check_force(ticks)

    def test_one_update_with_the_last_sequence_does_not_silence_the_client(self):
        with pressing(*PATIENT) as (server, client):
            client.update(sequence=2**64 - 1)
            client.press(0.5)
            ticks = server.ticks()
        self.assertEqual(goes_on(ticks), str(client.session))

    # Faults.

    def test_a_fault_stays_through_a_short_and_a_long_stop_until_it_is_cleared_here(self):
        for stop in (0.35, 2):
            with self.subTest(stop=stop), pressing() as (server, client):
                server.stop_for(stop)
                client.press(0.3)
                self.assertEqual((client.state["server"], client.state["fault"]), (3, 2))
                time.sleep(0.7)  # the client counts as gone
                client.nonce += 1
                message, answer = client.ask(clears_fault=0)
                self.assertEqual((message, answer.get("reason")), ("reject", 4))
                client.nonce += 1
                self.assertEqual(client.ask(clears_fault=1)[1].get("reason"), 4)
                os.kill(server.process.pid, signal.SIGRTMIN)
                time.sleep(0.05)
                client.nonce += 1
                self.assertEqual(client.ask(clears_fault=1)[0], "welcome")
                client.session = client.ask()[1]["session"]
                client.sequence, client.state = 0, {}
                client.press(0.5)
                self.assertEqual((client.state["server"], client.state["fault"]), (1, 0))

    def test_an_operators_stop_cuts_the_force_until_it_is_cleared_here(self):
        with pressing() as (server, client):
            os.kill(server.process.pid, signal.SIGUSR2)
            client.press(0.3)
            self.assertEqual((client.state["server"], client.state["fault"]), (3, 5))
            self.assertEqual(set(client.state["F_command"]), {0})
            time.sleep(0.6)
            client.nonce += 1
            self.assertEqual(client.ask(clears_fault=0)[1]["reason"], 4)
            client.nonce += 1
            self.assertEqual(client.ask(clears_fault=1)[1]["reason"], 4)  # no packet ends it
            os.kill(server.process.pid, signal.SIGRTMIN)
            time.sleep(0.05)
            client.begin()
            client.state = {}
            client.press(0.5)
            self.assertEqual((client.state["server"], client.state["fault"]), (1, 0))

    # Impacts.

    def test_an_impact_changes_the_force_no_faster_than_the_limit(self):
        with pressing("--restitution", "0.5", "--device-option", "mass=0.3", seconds=2) as (server, _):
            ticks = server.ticks()
        self.check_force(ticks)


if __name__ == "__main__":
    SERVER, DOC = sys.argv[1], Document(sys.argv[2])
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
