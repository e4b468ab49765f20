#!/usr/bin/env python3
"""What someone without the key can do to a sealed session: nothing.

Usage: sealed_test.py FOLDER_OF_PROGRAMS SOURCE [unittest arguments]

The real programs on loopback. A relay between client and server records every packet and sends others into
the session, from the client's own address and port or from elsewhere. What the server did is read from its
tick log. Random choices come from a seed that is printed; HLM_SEED sets it.
"""

import os
import pathlib
import random
import re
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest

PROGRAMS, SOURCE = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
sys.path.insert(0, str(SOURCE / "tests" / "system"))
import attacks_test  # noqa: E402

attacks_test.SERVER = PROGRAMS / "haptic_server"
WORLD = SOURCE / "worlds" / "testbed.sdf"
SEED = int(os.environ.get("HLM_SEED", "1"))
PATIENCE = 15  # s
INITIATION, SEALED = 1, 3
# Columns of the tick log that say nothing about the state.
PACE = {"time", "time_s", "lateness_s", "execution_s", "overruns", "datagrams", "dropped"}


class Relay:
    """Passes packets between one client and a server, and keeps them."""

    def __init__(self, server):
        self.server = server
        self.inside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)  # towards the server
        self.outside = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        for side in (self.inside, self.outside):
            side.bind(("127.0.0.1", 0))
        self.address = "127.0.0.1:%d" % self.outside.getsockname()[1]
        self.client = None
        self.passed = []  # from the client
        self.holds = None  # called with each of its packets: whether it stays here
        self.stopping = False
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while not self.stopping:
            for ready in select.select([self.inside, self.outside], [], [], 0.05)[0]:
                data, sender = ready.recvfrom(2000)
                if ready is self.inside:
                    self.outside.sendto(data, self.client)
                    continue
                self.client = sender
                self.passed.append(data)
                if not (self.holds and self.holds(data)):
                    self.send(data)

    def send(self, data):
        """As the client would, from its address and port as the server sees them."""
        self.inside.sendto(data, self.server)

    def close(self):
        self.stopping = True
        self.thread.join()
        self.inside.close()
        self.outside.close()


class Client:
    """ve_client, and what it says."""

    def __init__(self, address, *options):
        self.process = subprocess.Popen(
            [PROGRAMS / "ve_client", "--server", address, "--world", WORLD, *options],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        self.lines = []
        self.reader = threading.Thread(target=lambda: self.lines.extend(iter(self.process.stderr.readline, "")))
        self.reader.start()

    def said(self, text, patience=PATIENCE):
        """Whether it says that in time."""
        end = time.monotonic() + patience
        while not any(text in line for line in self.lines):
            if time.monotonic() > end:
                return False
            time.sleep(0.02)
        return True

    def end(self, kill=False):
        if self.process.poll() is None:
            self.process.kill() if kill else self.process.terminate()
        self.process.wait(timeout=PATIENCE)
        self.reader.join()
        self.process.stderr.close()


def changed(data):
    """The packet with one bit changed."""
    bit = random.randrange(8 * len(data))
    copy = bytearray(data)
    copy[bit // 8] ^= 1 << bit % 8
    return bytes(copy)


class Sealed(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        print(f"seed {SEED}", file=sys.stderr)
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.keys = []
        for name in ("right.key", "wrong.key"):
            cls.keys.append(pathlib.Path(folder.name) / name)
            subprocess.run([PROGRAMS / "haptic_keygen", cls.keys[-1]], check=True)
        cls.record_session()

    @classmethod
    def record_session(cls):
        """All packets of a client, from its first to its goodbye, and the server that it spoke to."""
        cls.old_server = cls.enterClassContext(attacks_test.Server("--key-file", cls.keys[0]))
        relay = Relay(cls.old_server.address)
        client = Client(relay.address, "--key-file", cls.keys[0])
        assert client.said("session with"), client.lines
        time.sleep(2)
        client.end()
        time.sleep(0.2)
        relay.close()
        cls.recorded = relay.passed

    def setUp(self):
        random.seed(SEED)

    def server(self, *options):
        # A stall of the machine is neither silence nor a fault here.
        return self.enterContext(attacks_test.Server("--key-file", self.keys[0], "--silence-time", "0.4",
                                                     "--max-gap", "5", *options))

    def client(self, address, *options):
        client = Client(address, *options)
        self.addCleanup(client.end)
        return client

    def session(self):
        """A server, its client and the relay between them, in session for a while."""
        server = self.server()
        relay = Relay(server.address)
        self.addCleanup(relay.close)
        client = self.client(relay.address, "--key-file", self.keys[0])
        self.assertTrue(client.said("session with"), client.lines)
        time.sleep(1)
        return server, client, relay

    def check_undisturbed(self, ticks, injected):
        """One session without a pause, each update taken once and in order, and nothing but what was injected
        dropped."""
        in_session = [row for row in ticks if int(row["step"]) > 0]
        self.assertEqual(len({row["session"] for row in in_session}), 1)
        self.assertEqual({row["server_state"] for row in in_session}, {"arming", "ramping", "active"})
        self.assertEqual({row["fault"] for row in ticks}, {"none"})
        adopted = [int(row["adopted"]) for row in ticks if row["adopted"] != "0"]
        self.assertGreater(len(adopted), 60)
        self.assertEqual(adopted, sorted(set(adopted)))
        self.assertLessEqual(adopted[-1] - adopted[0] + 1 - len(adopted), 3)
        self.assertEqual(int(ticks[-1]["dropped"]), injected)

    def check_still(self, ticks, since=0.0):
        """From then on no signal of the server changed."""
        rows = [row for row in ticks if row["time"] > since]
        self.assertGreater(len(rows), 500)
        for column in set(rows[0]) - PACE:
            self.assertEqual({row[column] for row in rows}, {rows[0][column]}, column)
        self.assertEqual(rows[0]["server_state"], "off")

    def variants(self, packets):
        """The packets whole, in parts, backwards, cut short, altered."""
        yield from packets
        yield from packets[::2]
        yield from reversed(packets)
        yield from (packet[: random.randrange(len(packet))] for packet in packets)
        yield from map(changed, packets)

    def send_slowly(self, packets, *senders):
        """Each packet by each sender, slowly enough that the system drops none. How many were sent."""
        count = 0
        for packet in packets:
            for send in senders:
                send(packet)
                count += 1
            if count % 32 == 0:
                time.sleep(0.004)
        time.sleep(0.2)
        return count

    def elsewhere(self, server):
        other = self.enterContext(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
        return lambda packet: other.sendto(packet, server.address)

    def test_recorded_packets_have_types_and_no_readable_message(self):
        types = [packet[3] for packet in self.recorded]
        self.assertEqual({packet[:3] for packet in self.recorded}, {b"HLS"})
        self.assertEqual(set(types), {INITIATION, SEALED})
        self.assertNotIn(b"HLMI", b"".join(self.recorded))

    def test_a_session_replayed_into_another_moves_nothing_and_ends_nothing(self):
        server, _, relay = self.session()
        recorded = [packet for packet in self.recorded if packet[3] == SEALED]
        injected = self.send_slowly(self.variants(recorded), relay.send, self.elsewhere(server))
        time.sleep(0.5)
        self.check_undisturbed(server.ticks(), injected)

    def test_a_session_replayed_into_itself_moves_nothing_and_ends_nothing(self):
        server, _, relay = self.session()
        injected = self.send_slowly(self.variants(list(relay.passed)), relay.send, self.elsewhere(server))
        injected += self.send_slowly(list(relay.passed)[-60:], self.elsewhere(server))
        time.sleep(0.5)
        self.check_undisturbed(server.ticks(), injected)

    def test_a_packet_held_back_changes_nothing_when_it_comes(self):
        server, _, relay = self.session()
        held = []

        def hold(packet):
            held.append(packet)
            return len(held) == 1

        relay.holds = hold
        time.sleep(0.4)
        relay.send(held[0])
        self.elsewhere(server)(held[0])
        time.sleep(0.4)
        relay.holds = None
        self.check_undisturbed(server.ticks(), 2)

    def test_an_idle_server_stays_as_it_is_whatever_is_replayed(self):
        server = self.server()
        time.sleep(0.3)
        sent = self.send_slowly(self.variants(self.recorded), self.elsewhere(server), self.elsewhere(server))
        time.sleep(0.5)
        ticks = server.ticks()
        self.check_still(ticks)
        # One old first message is answered, which begins nothing.
        self.assertGreaterEqual(int(ticks[-1]["dropped"]), sent - 2)

    def test_the_server_of_a_session_that_is_over_stays_as_it_is(self):
        # Its own session's packets, from other ports: that of its client is gone.
        begin = time.monotonic()
        sent = self.send_slowly(self.variants(self.recorded), self.elsewhere(self.old_server))
        time.sleep(0.5)
        spent = time.monotonic() - begin
        ticks = self.old_server.ticks()
        self.check_still(ticks, ticks[-1]["time"] - spent)
        self.assertEqual(int(ticks[-1]["dropped"]), sent)

    def test_garbage_at_high_rate_ends_nothing(self):
        server, _, _ = self.session()
        send = self.elsewhere(server)
        kinds = [b"HLS\x01" + os.urandom(52), b"HLS\x03" + os.urandom(600), os.urandom(1200), b"HLMI" + os.urandom(300)]
        end = time.monotonic() + 1.5
        while time.monotonic() < end:
            for kind in kinds:
                for _ in range(24):
                    send(kind)
            time.sleep(0.002)
        ticks = server.ticks()
        self.assertIsNotNone(attacks_test.goes_on([row for row in ticks if row["time"] < ticks[-1]["time"]]))
        self.assertGreater(int(ticks[-1]["dropped"]), 5000)
        lines = [line for line in server.errors.splitlines() if "dropped datagrams" in line]
        self.assertTrue(1 <= len(lines) <= 5, lines)
        for reason in ("wrong key", "unsealed", "handshake rate"):
            self.assertIn(reason, server.errors)

    def test_clients_without_the_key_learn_what_may_be_missing_and_the_server_says_what_it_drops(self):
        server, _, _ = self.session()
        address = "%s:%d" % server.address
        wrong = self.client(address, "--key-file", self.keys[1])
        self.assertTrue(wrong.said("wrong.key"), wrong.lines)
        self.assertTrue(wrong.said("does not answer"))
        keyless = self.client(address)
        self.assertTrue(keyless.said("--key-file"), keyless.lines)
        time.sleep(1.2)
        self.assertIsNotNone(attacks_test.goes_on(server.ticks()))
        self.assertRegex(server.errors, r"dropped datagrams: .*wrong key")
        self.assertRegex(server.errors, r"dropped datagrams: .*unsealed")

    def test_a_server_without_a_key_says_that_a_client_has_one(self):
        server = self.enterContext(attacks_test.Server())
        client = self.client("%s:%d" % server.address, "--key-file", self.keys[0])
        self.assertTrue(client.said("or it has none"), client.lines)
        time.sleep(1)
        self.check_still(server.ticks())
        self.assertRegex(server.errors, r"dropped datagrams: \d+ sealed")

    def test_a_second_client_is_told_busy_and_takes_over_when_the_first_is_dead(self):
        server, first, _ = self.session()
        second = self.client("%s:%d" % server.address, "--key-file", self.keys[0])
        self.assertTrue(second.said("busy with another client"), second.lines)
        first.end(kill=True)
        self.assertTrue(second.said("began", 3), second.lines)
        server.ticks()
        self.assertEqual(len(re.findall("session .* begins", server.errors)), 2)

    def test_a_client_finds_its_server_again_after_a_restart(self):
        server, client, relay = self.session()
        self.assertTrue(client.said("connected"))
        port = "127.0.0.1:%d" % server.address[1]
        server.process.kill()
        server.process.wait()
        client.lines.clear()
        again = subprocess.Popen([PROGRAMS / "haptic_server", "--listen", port, "--key-file", self.keys[0],
                                  "--status", "false"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(again.wait)
        self.addCleanup(again.kill)
        self.assertTrue(client.said("began", 5), client.lines)
        self.assertIsNotNone(relay.client)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
