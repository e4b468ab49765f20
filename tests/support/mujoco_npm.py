"""What the tests need of MuJoCo's official Python binding, on MuJoCo 3 from its official JavaScript package: the same
names, shapes and types. Arrays are copies: what is written to them is told before each call, and they are what they
became after it. Steps are taken together, when something is asked for.

HAPTIC_TEST_MUJOCO names the package, a folder of mujoco_npm/node_modules.
"""

import atexit
import json
import os
import pathlib
import struct
import subprocess

import numpy as np

PACKAGE = os.environ["HAPTIC_TEST_MUJOCO"]
FOLDER = pathlib.Path(__file__).resolve().parent / "mujoco_npm"
# Numbers in a row of the arrays that have rows.
COLUMNS = {"body_ipos": 3, "body_iquat": 4, "body_inertia": 3, "geom_pos": 3, "geom_size": 3,
           "geom_friction": 3, "jnt_range": 2, "mesh_vert": 3, "xpos": 3, "xipos": 3, "xfrc_applied": 6, "geom_xpos": 3,
           "geom_xmat": 9, "mocap_pos": 3, "mocap_quat": 4, "actuator_trnid": 2,
           "actuator_gear": 6, "actuator_biasprm": 10}
TYPES = {"Float64Array": np.float64, "Float32Array": np.float32, "Int32Array": np.int32, "Uint8Array": np.uint8}
# Of a contact, in the order in which they are sent.
CONTACT = {"dist": 1, "pos": 3, "frame": 9, "friction": 5, "dim": 1, "geom1": 1, "geom2": 1, "efc_address": 1}

_due = []  # steps that are not taken yet, as (model, data)
_done_with = []  # models and data that nobody has any more
# The compiler that is fast at once: with the better one frames come late for a second.
_node = subprocess.Popen(["node", "--liftoff-only", "serve.js", PACKAGE], cwd=FOLDER, stdin=subprocess.PIPE,
                         stdout=subprocess.PIPE)
atexit.register(_node.communicate)


def _ask(operation, payload=b"", **request):
    """Header and arrays of the reply."""
    text = json.dumps({"operation": operation, "bytes": len(payload), **request}).encode()
    _node.stdin.write(struct.pack("<I", len(text)) + text + payload)
    _node.stdin.flush()
    length, = struct.unpack("<I", _node.stdout.read(4))
    header = json.loads(_node.stdout.read(length))
    if "error" in header:
        raise ValueError(header["error"])
    return header, _node.stdout.read(header["bytes"])


class _Fields:
    """Numbers and arrays of a struct of the engine. Which arrays there are turns out when they are asked for."""

    def __init__(self, *path):
        vars(self).update(path=path, arrays={}, told={}, latest={})

    def __getattr__(self, name):
        _take_steps()
        if name in self.arrays:
            return self.arrays[name]
        if name not in self.latest:
            header, numbers = _ask("read", path=[*self.path, name])
            self.latest[name] = header.get("value")
            if "type" in header:
                array = np.frombuffer(bytearray(numbers), TYPES[header["type"]])
                self.latest[name] = array.reshape(-1, COLUMNS[name]) if name in COLUMNS else array
                if not name.startswith("efc_"):  # Those are as long as constraints are many.
                    self.arrays[name], self.told[name] = self.latest[name], numbers
        if self.latest[name] is None:
            raise AttributeError(name)
        return self.latest[name]

    def __setattr__(self, name, value):
        _take_steps()
        _ask("set", path=[*self.path, name], value=value)
        self.latest.pop(name, None)

    def written(self):
        """Arrays that differ from what the engine has, as (path, bytes)."""
        changed = {name: now for name, array in self.arrays.items() if (now := array.tobytes()) != self.told[name]}
        self.told.update(changed)
        return [([*self.path, name], now) for name, now in changed.items()]

    def take(self, numbers):
        """What the engine made of the arrays. Returns what is left of `numbers`."""
        for name, array in self.arrays.items():
            self.told[name], numbers = numbers[:array.nbytes], numbers[array.nbytes:]
            array.reshape(-1)[:] = np.frombuffer(self.told[name], array.dtype)
        return numbers


class MjModel(_Fields):
    def __init__(self, number):
        super().__init__(number)
        vars(self)["opt"] = _Fields(number, "opt")
        # The package fails to show arrays of bool. This is what the compiler makes of limited="auto".
        vars(self)["jnt_limited"] = np.less(*self.jnt_range.T)

    def __del__(self):
        _done_with.append(self.path[0])

    @classmethod
    def from_xml_path(cls, path):
        return cls.from_xml_string(pathlib.Path(path).read_text())

    @classmethod
    def from_xml_string(cls, xml):
        header, _ = _ask("model", xml=xml, done_with=_done_with)
        _done_with.clear()
        return cls(header["value"])


class _Contacts:
    def __init__(self, rows):
        parts = np.split(rows, np.cumsum([*CONTACT.values()])[:-1], axis=1)
        for (name, columns), part in zip(CONTACT.items(), parts):
            whole = np.int32 if name in ("dim", "geom1", "geom2", "efc_address") else np.float64
            setattr(self, name, part.astype(whole)[:, 0] if columns == 1 else part)


class MjData(_Fields):
    def __init__(self, model):
        super().__init__(_ask("data", model=model.path[0])[0]["value"])

    def __del__(self):
        _done_with.append(self.path[0])

    def __getattr__(self, name):
        if name == "contact":
            _take_steps()
            if name not in self.latest:
                numbers = np.frombuffer(_ask("contacts", data=self.path[0])[1])
                self.latest[name] = _Contacts(numbers.reshape(-1, sum(CONTACT.values())))
        return super().__getattr__(name)


def _take_steps():
    if _due:
        steps = len(_due)
        model, data = _due[0]
        _due.clear()
        _call("mj_step", model, data, times=steps)


def _call(name, model, data, *args, outs=(), times=1):
    _take_steps()
    written = model.written() + model.opt.written() + data.written()
    _, numbers = _ask("call", b"".join(now for _, now in written), name=name, model=model.path[0], data=data.path[0],
                      args=args, times=times, written=[path for path, _ in written],
                      watched=[[*data.path, each] for each in data.arrays])
    data.latest.clear()
    numbers = data.take(numbers)
    for out in outs:
        assert out.flags.c_contiguous and out.dtype == np.float64
        out.reshape(-1)[:] = np.frombuffer(numbers[:out.nbytes])
        numbers = numbers[out.nbytes:]


def mj_versionString():
    return _ask("version")[0]["value"]


def mj_name2id(model, kind, name):
    return _ask("name2id", model=model.path[0], kind=kind, name=name)[0]["value"]


def mj_forward(model, data):
    _call("mj_forward", model, data)


def mj_step(model, data):
    if _due and _due[0] != (model, data):
        _take_steps()
    _due.append((model, data))


def mj_jacBodyCom(model, data, jacp, jacr, body):
    assert jacp.shape == jacr.shape == (3, model.nv)
    _call("mj_jacBodyCom", model, data, {"out": jacp.size}, {"out": jacr.size}, int(body), outs=(jacp, jacr))


def mj_solveM(model, data, x, y):
    assert x.shape == y.shape and x.shape[1] == model.nv
    _call("mj_solveM", model, data, {"out": x.size}, y.ravel().tolist(), outs=(x,))
