"""What of a MuJoCo model the hand feels as MuJoCo has it, what it feels otherwise, and what it does not feel."""

from __future__ import annotations

import argparse
import importlib
import sys
from typing import Any, Callable, Collection, NamedTuple, Optional, Sequence

import numpy as np

import haptic_local_model as haptic
from haptic_local_model._mujoco_bodies import Bodies
from haptic_local_model._mujoco_changes import Changes
from haptic_local_model._mujoco_pairs import Pairs, has_flag
from haptic_local_model._mujoco_shapes import Parts, carriers, have_shapes, version_of
from haptic_local_model._mujoco_tool import find_tool

APPROXIMATE, IGNORED, HELD, AHEAD = "approximate", "ignored", "held", "moved ahead"
_SHOWN = 3  # names in a line


class Row(NamedTuple):
    """Fields that the hand feels otherwise than MuJoCo has them."""
    status: str
    fields: str
    says: str
    neutral: tuple[Any, ...] = ()  #: values of one geom, joint … with which there is nothing to say
    among: str = "all"  #: which geoms, joints … it concerns: a name in _Concerned
    beside: str = ""  #: fields that say more of the same
    most: float = -np.inf  #: nothing to say up to this value either


_SOFT, _SOFTNESS = ((0.02, 1),), ((0.9, 0.95, 0.001, 0.5, 2),)
_STIFFNESS = "the hand feels the server's stiffness; this one acts on what the hand does not hold"
_WHERE = "the hand feels a contact where surfaces meet, not a margin before"
_DIMENSION = "sliding friction is felt, torsional and rolling friction are not"
_STICKS = "the hand does not feel that it sticks"
_FIRST = "the first coefficient counts in both directions"
ROWS = (
    Row(APPROXIMATE, "geom_type", "felt by MuJoCo's own contacts, as it can be given no shape; no body is held beside it",
        (0, 2, 3, 4, 5, 6, 7), "touching", "geom_plugin hfield_adr hfield_data hfield_ncol hfield_nrow hfield_size"),
    Row(APPROXIMATE, "geom_condim pair_dim", _DIMENSION, (1, 3), "touching"),
    Row(APPROXIMATE, "geom_condim", "on a geom with friction that one's coefficient counts, in MuJoCo the larger", (), "smooth"),
    Row(APPROXIMATE, "geom_friction pair_friction", "above 10 it counts as 10", (), "touching", most=10),
    Row(APPROXIMATE, "pair_friction opt.o_friction", _FIRST, (), "uneven"),
    Row(IGNORED, "geom_solref pair_solref", _STIFFNESS, _SOFT, "touching"),
    Row(IGNORED, "geom_solimp pair_solimp", _STIFFNESS, _SOFTNESS, "touching"),
    Row(IGNORED, "geom_solmix", _STIFFNESS, (1,), "touching"),
    Row(IGNORED, "pair_solreffriction", _STIFFNESS, (0,), "touching"),
    Row(IGNORED, "geom_margin geom_gap pair_margin pair_gap", _WHERE, (0,), "touching"),
    Row(IGNORED, "geom_adhesion pair_adhesion", _STICKS, (0,), "touching"),
    Row(IGNORED, "geom_surfacevel", "it carries what MuJoCo moves, neither the tool nor what the hand holds", (0,), "touching"),
    Row(APPROXIMATE, "body_gravcomp", "bodies welded together have unequal ones: the server has their weight, not its torque", (),
        "uneven"),
    Row(IGNORED, "body_plugin", "the plugin pushes it while MuJoCo moves it, not while the hand holds it", (-1,), "held"),
    Row(IGNORED, "jnt_solref", "a stop of what the hand holds is as stiff as the server makes it", _SOFT, "stop"),
    Row(IGNORED, "jnt_solimp", "a stop of what the hand holds is as stiff as the server makes it", _SOFTNESS, "stop"),
    Row(IGNORED, "jnt_margin", "a stop of what the hand holds begins at the end of its range", (0,), "stop"),
    Row(IGNORED, "jnt_springyield", "a spring of what the hand holds does not yield", (0,), "held", "jnt_plasticadr"),
    Row(IGNORED, "dof_solref", "dry friction of what the hand holds is as stiff as the server makes it", _SOFT, "dry"),
    Row(IGNORED, "dof_solimp", "dry friction of what the hand holds is as stiff as the server makes it", _SOFTNESS, "dry"),
    Row(APPROXIMATE, "dof_armature dof_frictionloss", "the hand does not feel the tool's own", (0,), "tool"),
    Row(APPROXIMATE, "tendon_armature actuator_armature", "bodies have it, a tool on it does not", (0,)),
    Row(APPROXIMATE, "actuator_damping actuator_dampingpoly", "it acts by MuJoCo's reports, not between them", (0,)),
    Row(IGNORED, "flex_dim", "a flex is not felt, and no body is held beside it", (), "all",
        """flex_activelayers flex_bending flex_centered flex_conaffinity flex_condim flex_contype flex_damping flex_edge
        flex_edgedamping flex_edgeequality flex_edgestiffness flex_elem flex_elemlayer flex_friction flex_gap flex_internal
        flex_interp flex_margin flex_passive flex_plasticadr flex_plasticmode flex_priority flex_radius flex_rigid flex_selfcollide
        flex_size flex_solimp flex_solmix flex_solref flex_stiffness flex_vert flex_vert0 flex_vertbodyid flex_xvert0 flex_yield
        flex_node flex_node0 flex_nodebodyid flex_shell flex_evpair flex_edgeflap flex_vertmetric flex_cellnum"""),
    Row(APPROXIMATE, "opt.timestep", "what lies loose on the tool as a session begins falls through it", (), most=0.0199),
    Row(IGNORED, "opt.impratio", "it acts between bodies of MuJoCo; friction in the hand is the server's", (1,)),
    Row(IGNORED, "opt.o_solref", _STIFFNESS, _SOFT, "override"),
    Row(IGNORED, "opt.o_solimp", _STIFFNESS, _SOFTNESS, "override"),
    Row(IGNORED, "opt.o_margin", _WHERE, (0,), "override"),
    Row(APPROXIMATE, "opt.disableactuator", "what such actuators would move is not held by the server", (0,)),
)

#: What the session reads, or MuJoCo has worked into what it reads: forces on the tool, poses, velocities, accelerations.
USED = """
geom_type geom_contype geom_conaffinity geom_bodyid geom_dataid geom_priority geom_size geom_pos geom_quat geom_rbound geom_fluid
pair_geom1 pair_geom2 exclude_signature mesh_vert mesh_vertadr mesh_vertnum
body_parentid body_rootid body_weldid body_mocapid body_jntnum body_jntadr body_dofnum body_treeid body_pos body_quat body_ipos
body_iquat body_mass body_inertia
jnt_type jnt_qposadr jnt_dofadr jnt_bodyid jnt_limited jnt_actfrclimited jnt_actgravcomp jnt_pos jnt_axis jnt_stiffness
jnt_stiffnesspoly jnt_range jnt_actfrcrange dof_damping dof_dampingpoly
eq_type eq_obj1id eq_obj2id eq_objtype eq_active0 eq_data eq_solref eq_solimp
tendon_type tendon_adr tendon_num tendon_limited tendon_actfrclimited tendon_range tendon_actfrcrange tendon_margin
tendon_stiffness tendon_stiffnesspoly tendon_damping tendon_dampingpoly tendon_frictionloss tendon_lengthspring tendon_springyield
tendon_plasticadr tendon_solref_lim tendon_solimp_lim tendon_solref_fri tendon_solimp_fri
actuator_trntype actuator_trnid actuator_outadr actuator_outnum actuator_dyntype actuator_gaintype actuator_biastype actuator_dynprm
actuator_gainprm actuator_biasprm actuator_gear actuator_cranklength actuator_ctrllimited actuator_ctrlrange actuator_forcelimited
actuator_forcerange actuator_actlimited actuator_actrange actuator_actearly actuator_delay actuator_plugin actuator_ctrlspec
opt.gravity opt.density opt.viscosity opt.wind opt.cone opt.disableflags opt.enableflags""".split()

#: Appearance, bookkeeping, what is derived of other fields, and how MuJoCo finds and solves what it then reports.
NO_MATTER = """
geom_aabb geom_castshadow geom_group geom_matid geom_rgba geom_sameframe geom_user pair_signature
body_bvhadr body_bvhnum body_conaffinity body_contype body_dofadr body_geomadr body_geomnum body_invweight0 body_margin
body_sameframe body_simple body_subtreemass body_user jnt_actuatorid jnt_group jnt_user
dof_M0 dof_Madr dof_bodyid dof_invweight0 dof_jntid dof_length dof_parentid dof_simplenum dof_treeid
tendon_actuatorid tendon_group tendon_invweight0 tendon_length0 tendon_matid tendon_rgba tendon_treeid tendon_treenum tendon_user
tendon_width
actuator_acc0 actuator_actadr actuator_actnum actuator_ctrladr actuator_ctrlnum actuator_group actuator_history
actuator_historyadr actuator_length0 actuator_lengthrange actuator_user
flex_bendingadr flex_bvhadr flex_bvhnum flex_edgeadr flex_edgenum flex_elemadr flex_elemdataadr flex_elemedge flex_elemedgeadr
flex_elemnum flex_elemtexcoord flex_evpairadr flex_evpairnum flex_flatskin flex_group flex_matid flex_nodeadr flex_nodenum flex_rgba
flex_shelldataadr flex_shellnum flex_stiffnessadr flex_texcoord flex_texcoordadr flex_vertadr flex_vertcell flex_vertedge
flex_vertedgeadr flex_vertedgenum flex_vertnum hfield_pathadr
mesh_bvhadr mesh_bvhnum mesh_extrema mesh_face mesh_faceadr mesh_facenormal mesh_facenum mesh_facetexcoord mesh_graph mesh_graphadr
mesh_normal mesh_normaladr mesh_normalnum mesh_octadr mesh_octnum mesh_pathadr mesh_polyadr mesh_polymap mesh_polymapadr
mesh_polymapnum mesh_polynormal mesh_polynum mesh_polyvert mesh_polyvertadr mesh_polyvertnum mesh_pos mesh_quat mesh_scale
mesh_texcoord mesh_texcoordadr mesh_texcoordnum
opt.apirate opt.ccd_iterations opt.ccd_tolerance opt.integrator opt.iterations opt.jacobian opt.ls_iterations opt.ls_tolerance
opt.magnetic opt.mpr_iterations opt.mpr_tolerance opt.noslip_iterations opt.noslip_tolerance opt.sdf_initpoints opt.sdf_iterations
opt.sleep_tolerance opt.solver opt.tolerance""".split()

#: Flags, by their names in mjtDisableBit and mjtEnableBit. What one without effect disables counts as if it were enabled.
FLAGS_USED = """DSBL_CONSTRAINT DSBL_CONTACT DSBL_DAMPER DSBL_FILTERPARENT DSBL_FRICTIONLOSS DSBL_GRAVITY DSBL_LIMIT DSBL_PASSIVE
DSBL_SPRING ENBL_OVERRIDE ENBL_SLEEP""".split()
FLAGS_WITHOUT_EFFECT = {"DSBL_ACTUATION": ("nu", "what actuators would move is not held by the server"),
                        "DSBL_EQUALITY": ("neq", "what equalities would hold is not held by the server")}
FLAGS_NO_MATTER = """DSBL_AUTORESET DSBL_CLAMPCTRL DSBL_EULERDAMP DSBL_ISLAND DSBL_MIDPHASE DSBL_MULTICCD DSBL_NATIVECCD
DSBL_REFSAFE
DSBL_SENSOR DSBL_WARMSTART ENBL_DIAGEXACT ENBL_ENERGY ENBL_FWDINV ENBL_INVDISCRETE ENBL_IPC ENBL_ISLAND ENBL_MULTICCD
ENBL_SENSORNOISE ENBL_SPECULATIVE""".split()


class Finding(NamedTuple):
    """status: "approximate" or "ignored", of a field; "held" or "moved ahead", of bodies that can be pushed. names: of all
    geoms, joints … concerned; none where it is the whole model."""
    status: str
    field: str
    names: list[str]
    says: str


def check(model: Any, tool: Optional[str] = None, binding: Any = None) -> list[Finding]:
    """What a session with this model approximates or ignores, where that differs from MuJoCo's neutral values; then which bodies
    the server holds while the hand carries them, and which are moved ahead of MuJoCo's reports, and why. tool, binding: as of
    Session; without a tool, what every tool would meet. Raises haptic.HapticError where it cannot be the tool."""
    binding = importlib.import_module("mujoco") if binding is None else binding
    parts = Parts({}) if tool is None else Parts({find_tool(binding, model, tool): 0})
    return findings(binding, model, parts, Changes(model))


def findings(binding: Any, model: Any, parts: Parts, changes: Changes) -> list[Finding]:
    """parts: of the tool; none: none is chosen yet. changes: of a session that runs."""
    of_body, bodies = carriers(model, parts.own(model)), Bodies(binding, model, {*parts.links, *parts.ghosts}, changes)
    pairs = Pairs(binding, model, of_body[model.geom_bodyid], parts.links, version_of(binding))
    tool = next(iter(parts.links), -1)
    try:
        offered, problem = _offered(model, pairs, of_body, tool), []
    except haptic.HapticError as error:
        offered, problem = set(), [Finding(APPROXIMATE, "pair_geom1", [], f"all is felt by MuJoCo's own contacts: {error}")]
    reasons = bodies.reasons(None, offered, of_body)
    concerned = _Concerned(binding, model, pairs, tool, {body for body, reason in reasons.items() if reason is None})
    found = [each for row in ROWS for field in row.fields.split() for each in _of_field(model, row, field, concerned, changes)]
    return found + _of_flags(binding, model) + problem + _of_bodies(model, reasons)


def _offered(model: Any, pairs: Pairs, of_body: np.ndarray, tool: int) -> set[int]:
    """Bodies whose shapes the server gets: none where MuJoCo finds contacts."""
    has_shape, of_geom = have_shapes(model), of_body[model.geom_bodyid]
    if (pairs.touches & ~has_shape).any() or (tool >= 0 and not has_shape[of_geom == tool].any()):
        return set()
    return set(of_geom[pairs.shaped(has_shape).geoms].tolist())


class _Concerned:
    """Which geoms, joints … of a model the rows are about. held: bodies that the server holds."""

    def __init__(self, binding: Any, model: Any, pairs: Pairs, tool: int, held: Collection[int]):
        self._model, self._pairs, self._tool = model, pairs, tool
        self._held = np.isin(model.body_weldid, list(held))
        self._overrides = has_flag(binding.mjtEnableBit, "mjENBL_OVERRIDE", model.opt.enableflags)

    def among(self, name: str, field: str, count: int) -> np.ndarray:
        """Of each of `count` geoms, joints … whether it is one."""
        model, kind = self._model, field.split("_")[0]
        of_kind: dict[str, Callable[[], Any]] = {
            "all": lambda: np.ones(count, bool),
            "touching": lambda: self._pairs.by_masks if kind == "geom" else np.ones(count, bool),
            "smooth": self._smooth,
            "uneven": lambda: self._uneven(field),
            "override": lambda: [self._overrides],
            "tool": lambda: np.asarray(model.dof_bodyid) == self._tool,
            "held": lambda: self._held if kind == "body" else self._held[model.jnt_bodyid],
            "stop": lambda: self._held[model.jnt_bodyid] & (np.asarray(model.jnt_limited) != 0),
            "dry": lambda: self._held[model.dof_bodyid] & (np.asarray(model.dof_frictionloss) > 0)}
        if field == "geom_type":
            return self._pairs.touches
        return np.asarray(of_kind[name](), bool)

    def _smooth(self) -> np.ndarray:
        """Geoms of condim 1 that meet one with friction, but less than they would have themselves."""
        friction, is_smooth = np.asarray(self._model.geom_friction)[:, 0], np.asarray(self._model.geom_condim) == 1
        least = friction[self._pairs.by_masks & ~is_smooth].min(initial=np.inf)
        return self._pairs.by_masks & is_smooth & (friction > least)

    def _uneven(self, field: str) -> Any:
        """Pairs, or the options, with two coefficients of sliding friction; held bodies welded to one compensated otherwise."""
        model = self._model
        if field == "body_gravcomp":
            compensation, root = np.asarray(model.body_gravcomp), np.asarray(model.body_weldid)
            massive = np.asarray(model.body_mass) > 0
            unequal = {i for i in root[massive & self._held] if np.ptp(compensation[massive & (root == i)]) > 0}
            return massive & np.isin(root, list(unequal))
        if field == "opt.o_friction":
            return [self._overrides and model.opt.o_friction[0] != model.opt.o_friction[1]]
        return np.asarray(model.pair_friction)[:, 0] != np.asarray(model.pair_friction)[:, 1]


def _of_field(model: Any, row: Row, field: str, concerned: _Concerned, changes: Changes) -> list[Finding]:
    part, name = (model.opt, field[4:]) if field.startswith("opt.") else (model, field)
    if not hasattr(part, name):
        return []  # in this version
    values = np.asarray(getattr(part, name))[None] if part is not model else changes.read(model, name)
    if len(values) == 0:
        return []
    values = values.reshape(len(values), -1)
    differs = (values > row.most).any(axis=1)
    for neutral in row.neutral:
        differs &= ~np.isclose(values, neutral, rtol=1e-9, atol=0).all(axis=1)
    chosen = np.flatnonzero(differs & concerned.among(row.among, field, len(values)))
    if len(chosen) == 0:
        return []
    return [Finding(row.status, field, [] if part is not model else _names(model, field.split("_")[0], chosen), row.says)]


def _of_flags(binding: Any, model: Any) -> list[Finding]:
    return [Finding(APPROXIMATE, "opt.disableflags", [], says) for flag, (count, says) in FLAGS_WITHOUT_EFFECT.items()
            if getattr(model, count) > 0 and has_flag(binding.mjtDisableBit, "mj" + flag, model.opt.disableflags)]


def _of_bodies(model: Any, reasons: dict[int, Any]) -> list[Finding]:
    groups: dict[tuple[str, str], list[int]] = {}
    for body, reason in reasons.items():
        if reason is None:
            groups.setdefault((HELD, "by the server, while the hand carries it"), []).append(body)
            continue
        joined = "" if reason.body == body else f"joints connect it with {_names(model, 'body', [reason.body])[0]}: "
        groups.setdefault((AHEAD, joined + reason.why), []).append(body)
    ordered = sorted(groups.items(), key=lambda group: group[0][0] != HELD)
    return [Finding(status, "body", _names(model, "body", bodies), says) for (status, says), bodies in ordered]


def _names(model: Any, kind: str, which: Any) -> list[str]:
    """Of those numbers in the model; of degrees of freedom those of joints, of pairs those of geoms."""
    if kind == "dof":
        return list(dict.fromkeys(_names(model, "jnt", np.asarray(model.dof_jntid)[which])))
    if kind == "pair":
        sides = (_names(model, "geom", np.asarray(each)[which]) for each in (model.pair_geom1, model.pair_geom2))
        return [" on ".join(pair) for pair in zip(*sides)]
    address = getattr(model, f"name_{kind}adr")
    given = [bytes(model.names)[int(address[i]):].split(b"\0", 1)[0].decode(errors="replace") for i in which]
    return [name or f"{'joint' if kind == 'jnt' else kind} {int(i)}" for i, name in zip(which, given)]


def _table(found: list[Finding]) -> str:
    """A line for each, in columns."""
    rows = []
    for each in found:
        names = ", ".join(each.names[:_SHOWN]) + ", …" * (len(each.names) > _SHOWN)
        rows.append((each.status, each.field, f"{len(each.names)}: {names}" if each.names else "-", each.says))
    widths = [max(map(len, column)) for column in zip(*rows)][:3]
    return "\n".join("  ".join([*(text.ljust(width) for text, width in zip(row, widths)), row[3]]) for row in rows)


def _read(binding: Any, file: str) -> Any:
    load = binding.MjModel.from_binary_path if file.endswith(".mjb") else binding.MjModel.from_xml_path
    try:
        return load(file)
    except Exception as error:
        raise haptic.HapticError(f"{file}: {' '.join(str(error).split())}") from error


def main(arguments: Optional[Sequence[str]] = None) -> int:
    parser = argparse.ArgumentParser(prog="python3 -m haptic_local_model.mujoco", description="MuJoCo in the hand.")
    check_of = parser.add_subparsers(dest="command", required=True).add_parser(
        "check", help="what of a model the hand feels otherwise than MuJoCo has it, and which bodies the server holds")
    check_of.add_argument("model", help="a file in MuJoCo's XML, URDF or .mjb")
    check_of.add_argument("--tool", help="body that the hand is to hold; default: what every tool would meet")
    given = parser.parse_args(arguments)
    try:
        binding = importlib.import_module("mujoco")
        found = check(_read(binding, given.model), given.tool, binding)
    except ImportError:
        print("there is no module mujoco: pip install 'haptic-local-model[mujoco]'", file=sys.stderr)
        return 2
    except haptic.HapticError as error:
        print(error, file=sys.stderr)
        return 2
    if not any(each.status in (APPROXIMATE, IGNORED) for each in found):
        print("all of it is used")
    if found:
        print(_table(found))
    return 0
