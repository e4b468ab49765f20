#!/usr/bin/env python3
"""The fake of Haply's Inverse Service, called as public clients call the real one."""

import base64
import json
import os
import pathlib
import socket
import subprocess
import sys
import unittest

import haply_service_fake as fake

PROGRAM = pathlib.Path(fake.__file__)


class Client:
    """A WebSocket client of a few lines, with masks as the standard wants."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=20)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
        self.file = self.socket.makefile("rb")
        self.status = self.file.readline()
        while self.file.readline().strip():
            pass
        self.pings = 0

    def send(self, message):
        self.socket.sendall(fake.frame(json.dumps(message).encode(), mask=os.urandom(4)))

    def receive(self):
        while True:
            first, second = self.file.read(2)
            size = int.from_bytes(self.file.read(2), "big") if second == 126 else second
            payload = self.file.read(size)
            if first & 0x0F == 9:
                self.pings += 1
                self.socket.sendall(fake.frame(payload, 10, os.urandom(4)))
            elif first & 0x0F == 1:
                return json.loads(payload)

    def push(self, x=0.0, key="vector"):
        force = {key: {"x": x, "y": 0.0, "z": 0.0}}
        self.send({"inverse3": [{"device_id": "04EA", "commands": {"set_cursor_force": force}}]})
        return self.receive()

    def close(self):
        self.file.close()
        self.socket.close()


class Program:
    """The fake as a process."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen(
            [sys.executable, PROGRAM, "--port=0", "--events-port=0", "--http-port=0", *arguments],
            stdout=subprocess.PIPE, text=True)
        self.ports = [int(word) for word in self.process.stdout.readline().split()[1:]]

    def http(self, method, path, body=None, port=0):
        text = json.dumps(body) if body is not None else ""
        with socket.create_connection(("127.0.0.1", self.ports[port]), timeout=20) as connection:
            connection.sendall(f"{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: "
                               f"{len(text)}\r\n\r\n{text}".encode())
            head, _, body = connection.makefile("rb").read().partition(b"\r\n\r\n")
        return int(head.split()[1]), json.loads(body)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()


def in_virtual_time(*arguments, reading=""):
    """A service whose clock is moved by hand: [seconds]."""
    clock = [0.0]
    service = fake.Service(fake.parsed(arguments), fake.Readings(reading), lambda: clock[0])
    return service, clock


def order(x, key="vector", **more):
    force = {key: {"x": x, "y": 0.0, "z": 0.0}}
    return {"inverse3": [{"device_id": "04EA", "commands": {"set_cursor_force": force, **more}}]}


PROBE = {"inverse3": [{"device_id": "04EA", "commands": {"probe_position": {}}}]}


def transcript(reading):
    """Messages of fixed sessions with all kinds of devices, to compare two readings."""
    said = []
    for arguments in (("--force-scale=0.5", "--scale=2"), ("--version=3.1", "--grip=wired"),
                      ("--device=minverse", "--grip=list")):
        service, clock = in_virtual_time(*arguments, reading=reading)
        session = service.open_session()
        said.append(service.message(session))
        service.fake({"press": "b"})
        for i, message in enumerate([order(1.0), order(1.0), order(1.0, "values"), PROBE, order(0.0)]
                                    + [order(0.5)] * 4 + [{"session": {}}]):
            service.take(session, message)
            clock[0] += 0.02 if i == 8 else 0.001
            said.append(service.message(session))
        for path in ("/version", "/settings/devices/force_scale"):
            said.append(service.http("GET", path, {}))
        said.append(service.event({"safety_type": "stability_ceiling"}))
    return json.dumps(said)


class HaplyServiceFake(unittest.TestCase):
    def test_inventory_first_then_one_answer_per_message(self):
        with Program() as program:
            client = Client(program.ports[0])
            self.assertIn(b"101", client.status)
            first = client.receive()
            self.assertEqual(first["inverse3"][0]["config"]["type"], "inverse3")
            self.assertEqual(first["inverse3"][0]["device_id"], "04EA")
            self.assertTrue(first["inverse3"][0]["status"]["ready"])
            for _ in range(20):
                answer = client.push()
                self.assertNotIn("config", answer["inverse3"][0])
                self.assertEqual(answer["session_id"], first["session_id"])
                self.assertEqual(set(answer["wireless_verse_grip"][0]["state"]["buttons"]), set("abc"))
            client.send({"session": {"force_render_full_state": {}}})
            self.assertIn("config", client.receive()["inverse3"][0])
            client.close()

    def test_a_force_moves_the_handle_and_is_forgotten(self):
        service, clock = in_virtual_time()
        session = service.open_session()
        service.message(session)
        for _ in range(1000):
            service.take(session, order(1.5))
            clock[0] += 1e-3
            answer = service.message(session)
        state = answer["inverse3"][0]["state"]
        self.assertAlmostEqual(state["cursor_position"]["x"], 1.5 / 300, delta=1e-5)
        self.assertEqual(state["current_cursor_force"]["x"], 1.5)
        self.assertEqual(state["control_mode"], "force")
        clock[0] += 0.2
        state = service.message(session)["inverse3"][0]["state"]
        self.assertEqual(state["control_mode"], "idle")
        self.assertEqual(service.fake({})["force"], [0.0] * 3)

    def test_scales_change_what_is_reported_and_given(self):
        service, clock = in_virtual_time("--scale=2", "--mount-scale=3", "--force-scale=0.5")
        service.fake({"hand": [0.01, 0.0, 0.0]})
        for _ in range(10):
            clock[0] += 0.1
            service.handle.catch_up()
        session = service.open_session()
        first = service.message(session)["inverse3"][0]
        self.assertAlmostEqual(first["state"]["cursor_position"]["x"], 0.06, delta=1e-4)
        self.assertEqual(first["state"]["transform"]["scale"]["x"], 2)
        self.assertEqual(first["config"]["mount"]["scale"]["x"], 3)
        service.take(session, order(2.0))
        self.assertEqual(service.fake({})["force"][0], 1.0)

    def test_grips_have_the_buttons_of_their_kind(self):
        for kind, key, field, down in (("wireless", "wireless_verse_grip", "buttons",
                                        {"a": True, "b": False, "c": False}),
                                       ("wired", "verse_grip", "button", True),
                                       ("list", "wireless_verse_grip", "buttons", [True, False, False]),
                                       ("custom", "custom_verse_grip", "buttons",
                                        [True, False, False])):
            service, _ = in_virtual_time(f"--grip={kind}")
            service.fake({"press": "a"})
            self.assertEqual(service.message(service.open_session())[key][0]["state"][field], down)

    def test_events_settings_and_version_by_http(self):
        with Program() as program:
            listener = Client(program.ports[1])
            program.http("POST", "/fake", {"event": {"safety_type": "fod_stage_changed"}})
            event = listener.receive()
            self.assertEqual(event["data"]["safety_type"], "fod_stage_changed")
            listener.close()
            self.assertEqual(program.http("GET", "/version")[1]["git_tag"], "3.5.0")
            path = "/settings/devices/force_scale"
            self.assertEqual(program.http("POST", path, {"value": 0.25})[0], 200)
            self.assertEqual(program.http("GET", path)[1], {"ok": True, "data": 0.25})
            self.assertEqual(program.http("GET", "/nothing")[0], 404)
        with Program("--reading=http:other") as program:
            self.assertEqual(program.http("GET", "/version")[0], 426)
            self.assertEqual(program.http("GET", "/version", port=2)[0], 200)

    def test_pings_are_sent_in_one_reading(self):
        with Program("--reading=pings:sent") as program:
            client = Client(program.ports[0])
            client.receive()
            while client.pings == 0:
                client.push()
            client.close()

    def test_each_doubtful_sentence_changes_what_a_client_meets(self):
        likely = transcript("")
        self.assertEqual(likely, transcript("first"))
        for name, (_, second, *_) in fake.DOUBTS.items():
            if name in ("http", "pings"):  # Of the servers; above.
                continue
            self.assertFalse(likely == transcript(f"{name}:{second}"), name)
        with self.assertRaises(SystemExit):
            fake.Readings("hold:forever")


if __name__ == "__main__":
    unittest.main()
