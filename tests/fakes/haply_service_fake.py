#!/usr/bin/env python3
"""A fake of Haply's Inverse Service 3.x with one device, written from texts alone.

Usage: haply_service_fake.py [--port P] [--events-port P] [--http-port P] [--version 3.5|3.1|3.0]
                             [--device inverse3|minverse] [--grip wireless|list|wired|custom|none]
                             [--scale S] [--mount-scale S] [--force-scale S] [--uncalibrated]
                             [--reading NAME:ANSWER,…] [--doubts]

No driver of this project was read. Prints one line, "ready PORT EVENTS_PORT HTTP_PORT", then serves
until it is ended. Port 0 takes any free one. --doubts prints the sentences that can be read in two
ways, with both readings; --reading chooses among them ("first" and "second" stand for all).

Sources, by the short names in DOUBTS:
protocol, simulation, commands, conventions, events, http, settings, mount, sessions, migration,
print: pages of the vendor's documents for 3.5.x (WebSocket protocol, simulation channel, control
commands, JSON conventions, events, HTTP, settings reference, mount and workspace, sessions,
migrating to 3.5, tutorials 01 and 02). v31: page of 3.1.1. callers: sawHaplySDK, Isaac Lab and ROS
nodes in public repositories, one of which quotes states of a real device.

A test reaches what no vendor has by HTTP: POST /fake {"hand": [x, y, z], "press": "a",
"release": "a", "turn": [w, x, y, z], "unplug": true, "calibrate": true, "force_scale": f,
"event": {...}} and GET /fake, which tells the true position, velocity and force of the motors.

Assumed without a text: mass, friction, peak force, how long a force is held, the shape of a list of
buttons, what an uncalibrated device reports.
"""

import argparse
import asyncio
import base64
import hashlib
import json
import struct
import sys
import time

# name: first answer (the likelier one), second answer, what they mean, source
DOUBTS = {
    "force_key": ("both", "own", "'values' and 'vector' are both taken",
                  "3.5 takes 'vector' alone, 3.1 'values' alone: other keys are silently ignored",
                  "commands, conventions; v31, callers"),
    "unchanged": ("sent", "omitted", "each answer has the whole state",
                  "fields that did not change since the last answer are left out",
                  "print: 'partial-update semantics'"),
    "identity": ("sent", "omitted", "transform and mount are whole",
                 "their sub-fields that are the identity are left out", "print"),
    "zeros": ("sent", "omitted", "vectors of zeros are sent",
              "they are the default, so they are left out as the identity is", "print"),
    "status": ("always", "first", "each answer has the status",
               "the inventory alone has it", "simulation, conventions; protocol"),
    "inventory": ("complete", "late", "the first message lists every device",
                  "it may come before the devices: callers ask again by force_render_full_state",
                  "protocol; callers"),
    "grip": ("first", "late", "the grip is in the first message",
             "it appears some answers later", "protocol; callers"),
    "in_use": ("others", "anyone", "in_use is true if another session commands the device",
               "it is true once this session does", "events, device-busy"),
    "hold": ("long", "short", "a force is held for 100 ms without commands",
             "for 5 ms: 'applied once and forgotten'", "commands"),
    "probe": ("keeps", "clears", "a probe leaves the force as it is",
              "a message without a force takes it off", "simulation, probe commands"),
    "echo": ("commanded", "scaled", "current_cursor_force is what was commanded",
             "it is what the motors give, after force_scale", "simulation"),
    "scaled_force": ("same", "divided", "at scale s a force is given as commanded",
                     "it is divided by s: 'in application space'", "commands, mount"),
    "domain": ("cartesian", "undefined", "control_domain is 'cartesian' before any command",
               "it is 'undefined'", "protocol; callers"),
    "extra_keys": ("none", "present", "messages have the known keys alone",
                   "modules add keys of their own, also of other types", "simulation"),
    "numbers": ("floats", "integers", "zero is 0.0", "it is 0", "protocol; callers"),
    "pings": ("none", "sent", "the service sends no pings", "it does, and wants the pongs", "-"),
    "http": ("same", "other", "HTTP has the WebSocket's port",
             "it has one of its own (10000), and the WebSocket's port refuses it", "http, settings"),
    "envelope": ("plain", "wrapped", "GET /version answers with the version itself",
                 "in {ok, data}", "http; conventions"),
    "setting": ("value", "object", "the data of a setting are its value",
                "they are an object with key and value", "settings"),
    "event_name": ("device", "direct", "safety events are 'device-safety-triggered' with a type",
                   "the type is the name", "events"),
    "family": ("inverse3", "own", "a Minverse is listed under 'inverse3'",
               "under 'minverse'", "http, device selectors"),
    "list_buttons": ("flags", "names", "a list of buttons has one bool each",
                     "it has the names of those that are down", "migration"),
}

MASS, FRICTION = 0.15, 0.4  # kg, N·s/m
PEAK = 8.0  # N, of the motors
STEP = 2.5e-4  # s, of the simulated handle
LONGEST_CATCH_UP = 0.2  # s
HOLD = {"long": 0.1, "short": 0.005}  # s
LATE_ANSWERS = 5  # after which what is late appears
PING_EVERY, PONG_WITHIN = 0.2, 2.0  # s
DEVICE, GRIP = "04EA", "61576"
MAGIC = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11"  # RFC 6455


def vector(values):
    return dict(zip("xyz", values))


class Readings:
    def __init__(self, words=""):
        self.second = {name: False for name in DOUBTS}
        for word in filter(None, words.split(",")):
            name, _, answer = word.partition(":")
            if word in ("first", "second"):
                self.second = {name: word == "second" for name in DOUBTS}
            elif name in DOUBTS and answer in DOUBTS[name][:2]:
                self.second[name] = answer == DOUBTS[name][1]
            else:
                raise SystemExit(f"no such reading '{word}'; see --doubts")

    def __getitem__(self, name):
        return DOUBTS[name][self.second[name]]


class Handle:
    """A mass in a hand: a spring of 300 N/m with 5 N·s/m to an anchor; metres, seconds, newtons."""

    def __init__(self, clock):
        self.clock, self.time = clock, clock()
        self.position, self.velocity, self.anchor = [0.0] * 3, [0.0] * 3, [0.0] * 3
        self.force, self.until = [0.0] * 3, 0.0

    def push(self, force, seconds):
        size = sum(f * f for f in force) ** 0.5
        self.force = [f * min(1.0, PEAK / size) if size > 0 else 0.0 for f in force]
        self.until = self.clock() + seconds

    def catch_up(self):
        now = self.clock()
        self.time = max(self.time, now - LONGEST_CATCH_UP)
        while self.time + STEP <= now:
            on = self.time < self.until
            for i in range(3):
                pull = 300 * (self.anchor[i] - self.position[i]) + (self.force[i] if on else 0.0)
                self.velocity[i] = (self.velocity[i] + STEP * pull / MASS) / (
                    1 + STEP * (5 + FRICTION) / MASS)
                self.position[i] += STEP * self.velocity[i]
            self.time += STEP
        if now >= self.until:
            self.force = [0.0] * 3


class Session:
    """One WebSocket of the simulation channel."""

    def __init__(self, number, scale, mount_scale):
        self.number, self.answers = number, 0
        self.scale, self.mount_scale = scale, mount_scale
        self.offset = [0.0] * 3
        self.full = True  # The next message has the configuration.
        self.sent = {}  # By device: the state as it was last sent.


class Service:
    def __init__(self, options, readings, clock=time.monotonic):
        self.options, self.readings = options, readings
        self.handle = Handle(clock)
        self.force_scale = options.force_scale
        self.calibrated = not options.uncalibrated
        self.plugged, self.commander, self.sessions = True, None, 0
        self.buttons = {"a": False, "b": False, "c": False}
        self.orientation = [1.0, 0.0, 0.0, 0.0]  # w, x, y, z
        self.listeners = set()
        self.modern = options.version == "3.5"

    # ------------------------------------------------------------ messages of the simulation channel

    def open_session(self):
        self.sessions += 1
        return Session(self.sessions, self.options.scale, self.options.mount_scale)

    def close_session(self, session):
        if self.commander is session:
            self.commander = None
            self.handle.push([0.0] * 3, 0)

    def take(self, session, message):
        """What one message of a client does; keys that are not known are ignored."""
        general = message.get("session") or {}
        if "force_render_full_state" in general:
            session.full = True
        forced = False
        for group in ("inverse3", "minverse"):
            for device in message.get(group) or []:
                if device.get("device_id") != DEVICE:
                    continue
                self.configure(session, device.get("configure") or {})
                forced = self.command(session, device.get("commands") or {}) or forced
        if not forced and self.readings["probe"] == "clears":
            self.handle.push([0.0] * 3, 0)

    def configure(self, session, configuration):
        scale = configuration.get("mount", {}).get("transform", {}).get("scale")
        if scale:
            session.mount_scale = scale["x"]
        if configuration.get("preset"):
            session.mount_scale = 1.0

    def command(self, session, commands):
        moved = commands.get("set_transform", {}).get("transform", {})
        if moved:
            session.scale = moved.get("scale", {}).get("x", session.scale)
            position = moved.get("position")
            session.offset = [position[k] for k in "xyz"] if position else session.offset
        order = commands.get("set_cursor_force")
        if order is None:
            return False
        keys = ["vector", "values"] if self.modern else ["values", "vector"]
        if self.readings["force_key"] == "own":
            keys = keys[:1]
        wanted = next((order[k] for k in keys if k in order), None)
        if wanted is None or not self.plugged or not self.calibrated:
            return False
        self.commander = session
        by = self.force_scale
        if self.readings["scaled_force"] == "divided":
            by /= session.scale * session.mount_scale
        self.commanded = [float(wanted.get(k, 0.0)) for k in "xyz"]
        self.handle.push([by * f for f in self.commanded], HOLD[self.readings["hold"]])
        return True

    def message(self, session):
        """The inventory, or the answer to one message."""
        self.handle.catch_up()
        late = session.answers < LATE_ANSWERS
        out = {"session_id": session.number} if self.modern else {}
        listed = self.plugged and not (late and self.readings["inventory"] == "late")
        key = "inverse3"
        if self.options.device == "minverse" and self.readings["family"] == "own":
            key = "minverse"
            out["inverse3"] = []
        out[key] = [self.inverse(session)] if listed else []
        out.update(self.grips(session, listed and not (late and self.readings["grip"] == "late")))
        if self.readings["extra_keys"] == "present":
            out["navigation"] = {"enabled": False, "bubbles": [1, "x", None]}
            out["sdf_hfx"] = None
        session.full = False
        session.answers += 1
        return self.whole(out) if self.readings["numbers"] == "integers" else out

    def inverse(self, session):
        scale = session.scale * session.mount_scale
        place = [scale * p + o for p, o in zip(self.handle.position, session.offset)]
        active = any(self.handle.force)
        echoed = self.handle.force
        if active and self.readings["echo"] == "commanded":
            echoed = self.commanded
        state = {
            "cursor_position": vector(place),
            "cursor_velocity": vector([scale * v for v in self.handle.velocity]),
            "angular_position": dict(a0=-30.9, a1=53.9, a2=-6.6),
            "angular_velocity": dict(a0=0.0, a1=0.0, a2=0.0),
            "body_orientation": dict(w=1.0, x=0.0, y=0.0, z=0.0),
            "mode": "force" if active else "idle",
        }
        if self.modern:
            state.update({
                "current_cursor_force": vector(echoed),
                "current_cursor_position": vector([0.0] * 3),
                "current_angular_torques": dict(a0=0.0, a1=0.0, a2=0.0),
                "control_domain": "cartesian" if active else self.readings["domain"],
                "control_mode": "force" if active else "idle",
                "transform": self.transform(session.scale, session.offset),
            })
        device = {"device_id": DEVICE, "state": self.reduced(session, DEVICE, state)}
        if session.full:
            device["config"] = self.configuration(session)
        used = self.commander is not None and (
            self.commander is not session or self.readings["in_use"] == "anyone")
        if session.full or self.readings["status"] == "always":
            device["status"] = dict(calibrated=self.calibrated, in_use=used, power_supply=True,
                                    ready=self.calibrated, started=True)
        return device

    def configuration(self, session):
        config = {
            "type": self.options.device,
            "device_info": dict(major_version=7, minor_version=4, id=DEVICE, device_type=4),
            "gravity_compensation": dict(enabled=True, scaling_factor=1.0),
            "handedness": "right",
            "torque_scaling": dict(enabled=True),
        }
        if self.modern:
            config.update({
                "home_return": dict(enabled=False), "preset": "defaults",
                "basis": dict(permutation="XYZ"),
                "mount": self.transform(session.mount_scale, [0.0] * 3),
                "filters": dict(force_gate=dict(gain=0.3), damping=dict(scalar=0.0)),
            })
        return config

    def transform(self, scale, offset):
        parts = {"position": vector(offset), "rotation": dict(w=1.0, x=0.0, y=0.0, z=0.0),
                 "scale": vector([scale] * 3)}
        if self.readings["identity"] == "omitted":
            identity = {"position": vector([0.0] * 3), "rotation": parts["rotation"],
                        "scale": vector([1.0] * 3)}
            parts = {k: v for k, v in parts.items() if v != identity[k]}
        return parts

    def grips(self, session, listed):
        kind = self.options.grip
        key = {"wired": "verse_grip", "custom": "custom_verse_grip"}.get(kind, "wireless_verse_grip")
        empty = {"verse_grip": [], "wireless_verse_grip": []} if self.modern else {}
        if kind == "none" or not listed:
            return empty
        state = {"orientation": dict(zip("wxyz", self.orientation)), "hall": 0,
                 "transform": self.transform(1.0, [0.0] * 3)}
        if kind == "wired":
            state["button"] = self.buttons["a"]
        elif kind == "wireless":
            state.update(buttons=dict(self.buttons), battery_level=0.8)
        elif self.readings["list_buttons"] == "names":
            state["buttons"] = [name for name, down in self.buttons.items() if down]
        else:
            state["buttons"] = list(self.buttons.values())
        grip = {"device_id": GRIP, "state": self.reduced(session, GRIP, state)}
        if session.full:
            grip["config"] = {"type": key} if kind != "list" else {"type": "wireless_verse_grip",
                                                                   "sub_type": "ruko"}
        if session.full or self.readings["status"] == "always":
            grip["status"] = dict(awake=True, ready=True, started=True)
        return {**empty, key: [grip]}

    def reduced(self, session, device, state):
        """What of a state is sent."""
        before = session.sent.get(device, {})
        session.sent[device] = dict(state)
        if not session.full and self.readings["unchanged"] == "omitted":
            state = {k: v for k, v in state.items() if before.get(k) != v}
        if self.readings["zeros"] == "omitted":
            state = {k: v for k, v in state.items()
                     if not (isinstance(v, dict) and v and not any(v.values()))
                     or k == "buttons"}
        return state

    def whole(self, value):
        if isinstance(value, dict):
            return {k: self.whole(v) for k, v in value.items()}
        if isinstance(value, list):
            return [self.whole(v) for v in value]
        return int(value) if isinstance(value, float) and value.is_integer() else value

    # ------------------------------------------------------------ HTTP and events

    def http(self, method, path, body):
        """Status and JSON of a request."""
        path = path.split("?")[0].rstrip("/")
        if path == "/fake":
            return 200, self.fake(body if method == "POST" else {})
        if path in ("/version", "/3.0/version"):
            version = {"project_name": "haply-inverse-service", "git_tag": self.options.version + ".0",
                       "project_version": self.options.version + ".0.0"}
            return 200, self.wrapped(version)
        if path == "/devices":
            return 200, self.wrapped(self.message(Session(0, 1.0, 1.0)))
        if self.modern and path == "/settings/devices/force_scale":
            if method == "POST":
                self.force_scale = float(body.get("value", body.get("force_scale", 1.0)))
            shape = self.readings["setting"] == "object"
            data = {"key": "devices/force_scale", "value": self.force_scale} if shape else (
                self.force_scale)
            return 200, {"ok": True, "data": data}
        if path == "/force_scale" and method == "POST":
            self.force_scale = float(body.get("force_scale", 1.0))
            return 200, {"ok": True}
        return 404, {"ok": False, "error": f"no route {path}"}

    def wrapped(self, data):
        return {"ok": True, "data": data} if self.readings["envelope"] == "wrapped" else data

    def fake(self, order):
        self.handle.catch_up()
        self.handle.anchor = order.get("hand", self.handle.anchor)
        self.orientation = order.get("turn", self.orientation)
        self.force_scale = order.get("force_scale", self.force_scale)
        self.plugged = self.plugged and not order.get("unplug", False)
        self.calibrated = self.calibrated or order.get("calibrate", False)
        for word, down in (("press", True), ("release", False)):
            if word in order:
                self.buttons[order[word]] = down
        if "event" in order:
            self.tell(self.event(order["event"]))
        return {"position": self.handle.position, "velocity": self.handle.velocity,
                "force": self.handle.force, "force_scale": self.force_scale}

    def event(self, data):
        """A safety event; data has at least safety_type, for example 'stability_ceiling'."""
        direct = self.readings["event_name"] == "direct"
        return {"name": data["safety_type"] if direct else "device-safety-triggered",
                "category": "device", "level": data.get("level", "warning"),
                "data": {"device_family": "inverse", "device_id": DEVICE, **data},
                "message": data["safety_type"].replace("_", " ")}

    def tell(self, event):
        for writer in self.listeners:
            writer.write(frame(json.dumps(event).encode()))


# ---------------------------------------------------------------- WebSocket (RFC 6455), servers


def frame(payload, opcode=1, mask=b""):
    """One whole frame; a client gives four bytes of mask."""
    size = len(payload)
    flag = 0x80 if mask else 0
    head = bytes([0x80 | opcode])
    if size < 126:
        head += bytes([flag | size])
    elif size < 1 << 16:
        head += bytes([flag | 126]) + struct.pack(">H", size)
    else:
        head += bytes([flag | 127]) + struct.pack(">Q", size)
    if mask:
        payload = bytes(b ^ mask[i % 4] for i, b in enumerate(payload))
    return head + mask + payload


async def read_message(reader):
    """Opcode and payload of the next message; control frames come by themselves."""
    opcode, whole = 0, b""
    while True:
        first, second = await reader.readexactly(2)
        size = second & 0x7F
        if size == 126:
            size = struct.unpack(">H", await reader.readexactly(2))[0]
        elif size == 127:
            size = struct.unpack(">Q", await reader.readexactly(8))[0]
        mask = await reader.readexactly(4) if second & 0x80 else b"\0\0\0\0"
        payload = await reader.readexactly(size)
        payload = bytes(b ^ mask[i % 4] for i, b in enumerate(payload))
        if first & 0x0F >= 8:
            return first & 0x0F, payload
        opcode = first & 0x0F or opcode
        whole += payload
        if first & 0x80:
            return opcode, whole


async def read_request(reader):
    """Method, path, headers (names in small letters) and body of an HTTP request."""
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
    method, path, _ = head[0].split(" ", 2)
    headers = {}
    for line in filter(None, head[1:]):
        name, _, value = line.partition(":")
        headers[name.strip().lower()] = value.strip()
    body = await reader.readexactly(int(headers.get("content-length", 0)))
    return method, path, headers, json.loads(body) if body else {}


class Server:
    """The ports of a service."""

    def __init__(self, service):
        self.service = service
        self.ports = []

    async def start(self):
        o = self.service.options
        self.servers = []
        for port, serve in ((o.port, self.simulation), (o.events_port, self.events),
                            (o.http_port, self.plain)):
            server = await asyncio.start_server(
                lambda r, w, serve=serve: self.guarded(serve, r, w), "127.0.0.1", port)
            self.servers.append(server)
            self.ports.append(server.sockets[0].getsockname()[1])

    async def guarded(self, serve, reader, writer):
        try:
            method, path, headers, body = await read_request(reader)
            socket = "websocket" in headers.get("upgrade", "").lower()
            if socket and serve != self.plain:
                accept = base64.b64encode(
                    hashlib.sha1(headers["sec-websocket-key"].encode() + MAGIC).digest())
                writer.write(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n"
                             b"Connection: Upgrade\r\nSec-WebSocket-Accept: " + accept +
                             b"\r\n\r\n")
                await serve(reader, writer)
            else:
                refused = serve == self.events or (
                    serve == self.simulation and self.service.readings["http"] == "other"
                    and not path.startswith("/fake"))
                answer = (426, {"ok": False, "error": "a WebSocket is wanted here"}) if refused else (
                    self.service.http(method, path, body))
                self.reply(writer, *answer)
            await writer.drain()
        except (asyncio.IncompleteReadError, ConnectionError, ValueError, KeyError):
            pass
        finally:
            writer.close()

    def reply(self, writer, status, value):
        body = json.dumps(value).encode()
        writer.write(f"HTTP/1.1 {status} -\r\nContent-Type: application/json\r\nContent-Length: "
                     f"{len(body)}\r\nConnection: close\r\n\r\n".encode() + body)

    async def plain(self, reader, writer):
        raise ValueError("no WebSocket here")

    async def events(self, reader, writer):
        self.service.listeners.add(writer)
        try:
            while (await read_message(reader))[0] != 8:
                pass
        finally:
            self.service.listeners.discard(writer)

    async def ping(self, writer, state):
        while True:
            await asyncio.sleep(PING_EVERY)
            writer.write(frame(b"alive?", 9))
            if time.monotonic() - state["pong"] > PONG_WITHIN:
                writer.close()
                return

    async def simulation(self, reader, writer):
        session = self.service.open_session()
        writer.write(frame(json.dumps(self.service.message(session)).encode()))
        state = {"pong": time.monotonic()}
        pinging = None
        if self.service.readings["pings"] == "sent":
            pinging = asyncio.ensure_future(self.ping(writer, state))
        try:
            while True:
                opcode, payload = await read_message(reader)
                state["pong"] = time.monotonic() if opcode == 10 else state["pong"]
                if opcode == 8:
                    writer.write(frame(payload[:2], 8))
                    return
                if opcode == 9:
                    writer.write(frame(payload, 10))
                if opcode in (1, 2):
                    self.service.take(session, json.loads(payload))
                    writer.write(frame(json.dumps(self.service.message(session)).encode()))
        finally:
            if pinging:
                pinging.cancel()
            self.service.close_session(session)


def parsed(arguments):
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--port", type=int, default=10001)
    parser.add_argument("--events-port", type=int, default=10020)
    parser.add_argument("--http-port", type=int, default=10000)
    parser.add_argument("--version", choices=["3.5", "3.1", "3.0"], default="3.5")
    parser.add_argument("--device", choices=["inverse3", "minverse"], default="inverse3")
    parser.add_argument("--grip", default="wireless",
                        choices=["wireless", "list", "wired", "custom", "none"])
    parser.add_argument("--scale", type=float, default=1.0, help="of the workspace transform")
    parser.add_argument("--mount-scale", type=float, default=1.0)
    parser.add_argument("--force-scale", type=float, default=1.0)
    parser.add_argument("--uncalibrated", action="store_true")
    parser.add_argument("--reading", default="", help="NAME:ANSWER,…, or 'first' or 'second'")
    parser.add_argument("--doubts", action="store_true", help="print what --reading chooses among")
    return parser.parse_args(arguments)


async def serve(options):
    server = Server(Service(options, Readings(options.reading)))
    await server.start()
    print("ready", *server.ports, flush=True)
    await asyncio.gather(*(s.serve_forever() for s in server.servers))


def main():
    options = parsed(sys.argv[1:])
    if options.doubts:
        for name, (first, second, one, other, source) in DOUBTS.items():
            print(f"{name}:{first}|{second}\n    {one};\n    or: {other}  [{source}]")
        return
    try:
        asyncio.run(serve(options))
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
