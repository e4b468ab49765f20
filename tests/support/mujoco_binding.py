"""What the tests need of MuJoCo's official Python binding, which Debian does not have: the same names on
Debian's library. A C compiler says where the fields are.
"""

import ctypes
import subprocess
import tempfile

import numpy as np

# Of a number its type and None; of an array its type, its rows as a size of the model, and numbers in a row.
MODEL = {"nq": ("int", None), "nv": ("int", None), "nbody": ("int", None), "ngeom": ("int", None),
         "body_jntadr": ("int*", "nbody", 1), "body_weldid": ("int*", "nbody", 1),
         "body_dofnum": ("int*", "nbody", 1),
         "body_mass": ("double*", "nbody", 1), "body_ipos": ("double*", "nbody", 3),
         "body_iquat": ("double*", "nbody", 4), "body_inertia": ("double*", "nbody", 3),
         "jnt_type": ("int*", "njnt", 1), "jnt_qposadr": ("int*", "njnt", 1), "jnt_dofadr": ("int*", "njnt", 1),
         "dof_damping": ("double*", "nv", 1), "nu": ("int", None), "actuator_trntype": ("int*", "nu", 1),
         "actuator_biastype": ("int*", "nu", 1), "actuator_trnid": ("int*", "nu", 2), "actuator_gear": ("double*", "nu", 6),
         "actuator_biasprm": ("double*", "nu", 10),
         "dof_armature": ("double*", "nv", 1), "dof_M0": ("double*", "nv", 1), "njnt": ("int", None), "njmax": ("int", None), "geom_bodyid": ("int*", "ngeom", 1),
         "geom_margin": ("double*", "ngeom", 1), "geom_gap": ("double*", "ngeom", 1),
         "geom_pos": ("double*", "ngeom", 3), "geom_rbound": ("double*", "ngeom", 1),
         "geom_size": ("double*", "ngeom", 3), "geom_type": ("int*", "ngeom", 1),
         "geom_contype": ("int*", "ngeom", 1), "geom_conaffinity": ("int*", "ngeom", 1),
         "body_parentid": ("int*", "nbody", 1), "geom_friction": ("double*", "ngeom", 3),
         "geom_priority": ("int*", "ngeom", 1), "geom_dataid": ("int*", "ngeom", 1), "nmesh": ("int", None),
         "nmeshvert": ("int", None), "mesh_vertadr": ("int*", "nmesh", 1), "mesh_vertnum": ("int*", "nmesh", 1),
         "mesh_vert": ("float*", "nmeshvert", 3), "nexclude": ("int", None),
         "exclude_signature": ("int*", "nexclude", 1), "npair": ("int", None), "pair_geom1": ("int*", "npair", 1), "pair_geom2": ("int*", "npair", 1),
         "pair_margin": ("double*", "npair", 1), "pair_gap": ("double*", "npair", 1),
         "jnt_bodyid": ("int*", "njnt", 1), "jnt_limited": ("byte*", "njnt", 1), "nmocap": ("int", None)}
DATA = {"ncon": ("int", None), "time": ("double", None), "qpos": ("double*", "nq", 1), "qvel": ("double*", "nv", 1),
        "xipos": ("double*", "nbody", 3), "xpos": ("double*", "nbody", 3), "xfrc_applied": ("double*", "nbody", 6),
        "qacc_smooth": ("double*", "nv", 1), "efc_force": ("double*", "njmax", 1),
        "geom_xpos": ("double*", "ngeom", 3), "geom_xmat": ("double*", "ngeom", 9),
        "mocap_pos": ("double*", "nmocap", 3), "mocap_quat": ("double*", "nmocap", 4)}
CONTACT = {"dist": ("double", 1), "pos": ("double", 3), "frame": ("double", 9), "friction": ("double", 5),
           "dim": ("int", 1), "geom1": ("int", 1), "geom2": ("int", 1), "efc_address": ("int", 1)}
OPTION = {"timestep": ("double", 1), "gravity": ("double", 3), "cone": ("int", 1)}


def _offsets():
    lines = [f'printf("{kind}.{name} %zu\\n", offsetof({struct}, {name}));'
             for kind, struct, names in (("model", "mjModel", [*MODEL, "opt"]), ("data", "mjData", [*DATA, "contact"]),
                                         ("contact", "mjContact", CONTACT), ("option", "mjOption", OPTION))
             for name in names]
    code = ("#include <mujoco/mujoco.h>\n#include <stddef.h>\n#include <stdio.h>\nint main(void) {"
            + "".join(lines) + 'printf("size %zu\\n", sizeof(mjContact)); return 0; }')
    with tempfile.TemporaryDirectory() as folder:
        program = folder + "/offsets"
        subprocess.run(["cc", "-x", "c", "-", "-o", program], input=code, text=True, check=True)
        printed = subprocess.run([program], stdout=subprocess.PIPE, text=True, check=True).stdout
    return {name: int(offset) for name, offset in (line.split() for line in printed.splitlines())}


_at = _offsets()
_library = ctypes.CDLL("libmujoco.so")
for _name, _result in (("mj_loadXML", ctypes.c_void_p), ("mj_makeData", ctypes.c_void_p)):
    getattr(_library, _name).restype = _result


def _number(address, kind):
    return (ctypes.c_int if kind == "int" else ctypes.c_double).from_address(address)


def _view(address, kind, shape):
    number, dtype = {"int": (ctypes.c_int, np.int32), "byte": (ctypes.c_ubyte, np.uint8),
                     "float": (ctypes.c_float, np.float32), "double": (ctypes.c_double, np.float64)}[kind.rstrip("*")]
    if 0 in shape:
        return np.empty(shape, dtype)
    data = number * int(np.prod(shape))
    return np.frombuffer(data.from_address(address), dtype).reshape(shape)


class _Fields:
    """Attributes that are the struct's own memory."""

    def _read(self, prefix, table, name, sizes):
        kind, rows, *columns = table[name]
        address = self.address + _at[f"{prefix}.{name}"]
        if rows is None:
            return _number(address, kind).value
        target = ctypes.c_void_p.from_address(address).value
        count = getattr(sizes, rows)
        return _view(target, kind, (count,) if columns == [1] else (count, *columns))


class _Option:
    def __init__(self, address):
        self._address = address

    def __getattr__(self, name):
        kind, count = OPTION[name]
        address = self._address + _at[f"option.{name}"]
        return _number(address, kind).value if count == 1 else _view(address, kind, (count,))


class MjModel(_Fields):
    def __init__(self, address):
        self.address = address
        self.opt = _Option(address + _at["model.opt"])

    @classmethod
    def from_xml_path(cls, path):
        error = ctypes.create_string_buffer(1000)
        address = _library.mj_loadXML(str(path).encode(), None, error, len(error))
        if not address:
            raise ValueError(error.value.decode())
        return cls(address)

    def __getattr__(self, name):
        if name not in MODEL:
            raise AttributeError(name)
        return self._read("model", MODEL, name, self)


class _Contacts:
    def __init__(self, address, count):
        self._address, self._count = address, count

    def __getattr__(self, name):
        kind, columns = CONTACT[name]
        numbers = [np.array(_view(self._address + i * _at["size"] + _at[f"contact.{name}"], kind, (columns,)))
                   for i in range(self._count)]
        array = np.array(numbers, np.int32 if kind == "int" else np.float64).reshape(self._count, columns)
        return array[:, 0] if columns == 1 else array


class MjData(_Fields):
    def __init__(self, model):
        self.model = model
        self.address = _library.mj_makeData(ctypes.c_void_p(model.address))

    def __getattr__(self, name):
        if name == "contact":
            address = ctypes.c_void_p.from_address(self.address + _at["data.contact"]).value
            return _Contacts(address, self.ncon)
        if name not in DATA:
            raise AttributeError(name)
        return self._read("data", DATA, name, self.model)


_library.mj_versionString.restype = ctypes.c_char_p


def mj_versionString():
    return _library.mj_versionString().decode()


def _void(thing):
    return ctypes.c_void_p(thing if isinstance(thing, int) else thing.address)


def mj_step(model, data):
    _library.mj_step(_void(model), _void(data))


def mj_forward(model, data):
    _library.mj_forward(_void(model), _void(data))


def mj_name2id(model, kind, name):
    return _library.mj_name2id(_void(model), kind, name.encode())


def mj_jacBodyCom(model, data, jacp, jacr, body):
    assert jacp.flags.c_contiguous and jacr.flags.c_contiguous
    _library.mj_jacBodyCom(_void(model), _void(data), _void(jacp.ctypes.data), _void(jacr.ctypes.data), body)


def mj_solveM(model, data, x, y):
    _library.mj_solveM(_void(model), _void(data), _void(x.ctypes.data), _void(y.ctypes.data), len(y))
