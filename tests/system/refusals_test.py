#!/usr/bin/env python3
"""What haptic_server answers to hellos and updates that it cannot use, and what its log says of them.

Usage: refusals_test.py HAPTIC_SERVER PROTOCOL.md [unittest arguments]
"""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
import attacks_test  # noqa: E402
from attacks_test import Client, Document, Server, pressing  # noqa: E402

TOOL = 3  # reason of a reject
SILENCE = None
NAN, LARGE = "nan", "1e300"

# What each field of a hello does when it is wrong: a word of the reject's text, or silence.
HELLOS = {
    "ve_rate": {"0": "VE rate", "-1": "VE rate", "1e6": "VE rate", NAN: SILENCE},
    "epsilon": {"-1e-3": "epsilon", "11": "epsilon", NAN: SILENCE},
    "gravity": {"0 101 0": "gravity", "0 nan 0": SILENCE},
    "tool_length": {"0": "length", "1e5": "length", NAN: SILENCE},
    "X_LH": {"0 0 0 2 0 0 0": "length 1", "1e5 0 0 1 0 0 0": "hand frame", "nan 0 0 1 0 0 0": SILENCE},
    "hand_link": {"1": "hand link", "200": "hand link"},
    "q": {"1e5 0 0": "initial configuration", "nan 0 0": SILENCE},
    "clears_fault": {"2": SILENCE},
    "links__0__parent": {"0": "parent", "5": "parent"},
    "links__0__joint": {"7": "joint type", "4": "initial configuration has 3 coordinates"},
    "links__0__X_PJ": {"0 0 0 2 0 0 0": "length 1", "0 0 1e5 1 0 0 0": "joint frame", "inf 0 0 1 0 0 0": SILENCE},
    "links__0__mass": {"-1": "mass", "1e4": "mass", "0": "moves too little", NAN: SILENCE},
    "links__0__com": {"1e5 0 0": "centre of mass", "nan 0 0": SILENCE},
    "links__0__inertia": {"1 1 -1 0 0 0": "negative", "1e7 1 1 0 0 0": "inertia", "1 1 0 0 0 0": "turns too little",
                          "1 1 1e-13 0 0 0": "turns too little", "1 1 -1e-18 0 0 0": "turns too little",
                          "1 1 nan 0 0 0": SILENCE},
}
HINGE = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1"  # the identity, its upper triangle
NEGATIVE = "1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 -1 0 0 1 0 1"


class RefusalsTest(unittest.TestCase):
    def log_after(self, data_of, seconds=2.0):
        """The log of a server whose client sent nothing else than what data_of() makes of each good update."""
        with Server("--silence-time", "0.3") as server:
            client = Client(server)
            client.begin()
            send, client.send = client.send, lambda data: send(data_of(data))
            client.press(seconds)
            server.ticks()
            return server.errors

    def test_each_wrong_field_of_a_hello_gets_its_answer(self):
        with Server() as server:
            client = Client(server)
            for field, wrongs in HELLOS.items():
                for value, word in wrongs.items():
                    with self.subTest(field=field, value=value):
                        client.nonce += 1
                        answer = client.ask(patience=0.3 if word is SILENCE else 2, **{field: value})
                        if word is SILENCE:
                            self.assertIsNone(answer)
                            continue
                        message, values = answer
                        self.assertEqual((message, values["reason"]), ("reject", TOOL))
                        self.assertIn(word, values["text"].decode())
            client.nonce += 1
            self.assertEqual(client.ask()[0], "welcome")

    def test_bytes_after_the_end_refuse_a_datagram_and_within_its_length_do_not(self):
        longer = lambda data: data[:36] + (len(data) + 4).to_bytes(2, "little") + data[38:] + bytes(4)  # noqa: E731
        with Server() as server:
            client = Client(server)
            send = client.send
            client.send = lambda data: send(data + b"\0")
            self.assertIsNone(client.ask(patience=0.3))
            client.send = lambda data: send(longer(data))
            client.begin()
            client.press(0.5)
            self.assertGreater(client.state["updates"], 10)

    def test_the_log_says_why_every_update_is_refused(self):
        tail = lambda data: data + b"\0"                     # noqa: E731
        cut = lambda data: data[:60]                         # noqa: E731
        not_finite = lambda data: data[:40] + b"\xff" * 8 + data[48:]  # noqa: E731
        for change, reason in ((tail, "a length that does not fit"), (cut, "shorter than its header or its length"),
                               (not_finite, "a number is not finite")):
            with self.subTest(reason=reason):
                log = self.log_after(change)
                self.assertIn(f"no force: every update of the client is refused: ", log)
                self.assertIn(reason, log)
                self.assertNotIn("nothing of the client came", log)

    def test_a_client_whose_updates_turn_bad_is_told_from_one_that_is_dead(self):
        with pressing("--silence-time", "0.3") as (server, client):
            client.press(1, v="nan 0 0")
            server.ticks()
        self.assertIn("force fades to zero: every update of the client is refused: a number is not finite", server.errors)
        self.assertNotIn("nothing of the client came", server.errors)

    def test_what_is_dropped_is_logged_while_the_server_runs_once_a_second(self):
        with pressing() as (server, client):
            stranger = Client(server)
            stranger.session = client.session
            client.press(2.5, meanwhile=lambda: (stranger.update(), stranger.send(b"garbage" * 10),
                                                 client.update(v="nan 0 0")))
            server.ticks()
        lines = [line for line in server.errors.splitlines() if "dropped datagrams" in line]
        self.assertIn(len(lines), range(2, 6), server.errors)
        for reason in ("foreign session (", "not ours (", "non-finite ("):
            self.assertIn(reason, server.errors)

    def test_a_body_whose_inverse_inertia_is_negative_refuses_its_update(self):
        with pressing() as (server, client):
            for mobility, refuses in ((HINGE, False), (NEGATIVE, True)):
                client.refusals = 0
                client.press(0.2, bodies__count=1, bodies__total=1, bodies__0__W=mobility)
                self.assertEqual(client.refusals > 0, refuses)
                client.press(0.1)


if __name__ == "__main__":
    attacks_test.SERVER, attacks_test.DOC = sys.argv[1], Document(sys.argv[2])
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2)
