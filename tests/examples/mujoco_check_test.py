#!/usr/bin/python3
"""haptic.mujoco.check(): every field of MuJoCo that decides a contact is used or named.

Usage: mujoco_check_test.py PACKAGE_FOLDER [TEST …], with a Python that has MuJoCo; no server and no library is needed.
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest
import warnings

PACKAGE = str(pathlib.Path(sys.argv[1]).resolve())
sys.path.insert(0, PACKAGE)

import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402
from haptic_local_model import _mujoco_bodies as bodies, _mujoco_check as table  # noqa: E402
from haptic_local_model._mujoco_changes import Changes  # noqa: E402
from haptic_local_model._mujoco_shapes import Parts, Shapes  # noqa: E402

VERSION = tuple(map(int, mujoco.__version__.split(".")[:2]))
PREFIXES = tuple("geom_ pair_ exclude_ body_ jnt_ dof_ eq_ tendon_ actuator_ flex_ hfield_ mesh_".split())
VERSIONS = "3.0", "3.17", "4.0"  # of tests/examples/CMakeLists.txt
SCENE = """
<mujoco><option {option}>{flags}</option>{top}<worldbody><geom name="floor" type="plane" size="1 1 1" {floor}/>
<body name="tool" pos="0 0 .5"><freejoint/><geom name="ball" size=".02" {ball}/>{on_tool}</body>
<body name="cube" pos="1 0 .5"><freejoint/><geom name="box" type="box" size=".05 .05 .05" {box}/><site name="on_cube"/></body>
{world}</worldbody>{rest}</mujoco>"""
LID = """<body name="lid" pos="2 0 .5"><joint name="hinge" {joint}/><geom name="lid" type="box" size=".1 .1 .01"/>
<site name="on_lid"/>{more}</body>"""


def loaded(**parts):
    names = "option flags top floor ball on_tool box world rest".split()
    return mujoco.MjModel.from_xml_string(SCENE.format(**{name: parts.get(name, "") for name in names}))


def lid(joint="", more=""):
    return LID.format(joint=joint, more=more)


def found(tool="tool", **parts):
    return haptic.mujoco.check(loaded(**parts), tool, mujoco)


def fields(tool="tool", **parts):
    """Of the fields that are not used as they are: status and names."""
    return {each.field: (each.status, each.names) for each in found(tool, **parts) if each.field != "body"}


def reasons(tool="tool", **parts):
    """Of each body why it is moved ahead, or that it is held."""
    return {name: each.says if each.status == table.AHEAD else table.HELD
            for each in found(tool, **parts) if each.field == "body" for name in each.names}


class Table(unittest.TestCase):
    def setUp(self):
        self.rows = [name for row in table.ROWS for name in (row.fields + " " + row.beside).split()]
        self.known = {*self.rows, *table.USED, *table.NO_MATTER}
        model = mujoco.MjModel.from_xml_string("<mujoco/>")
        self.there = {name for name in dir(model) if name.startswith(PREFIXES) and isinstance(getattr(model, name), np.ndarray)}
        self.there |= {"opt." + name for name in dir(model.opt) if not name.startswith("_")}

    def test_every_field_of_this_version_is_in_it(self):
        self.assertEqual(sorted(self.there - self.known), [])

    def test_it_names_nothing_that_no_version_has(self):
        stored = {}
        for version in VERSIONS:
            python = pathlib.Path(sys.executable).parents[2] / f"mujoco-{version}" / "bin" / "python"
            script = ("import mujoco; m = mujoco.MjModel.from_xml_string('<mujoco/>'); "
                      "print(*dir(m), *('opt.' + name for name in dir(m.opt)), "
                      "*(name[2:] for each in (mujoco.mjtDisableBit, mujoco.mjtEnableBit) for name in dir(each)))")
            stored[version] = set(subprocess.run([python, "-c", script], check=True, capture_output=True, text=True).stdout.split())
        self.assertEqual(sorted(self.known - set().union(*stored.values())), [])
        flags = {*table.FLAGS_USED, *table.FLAGS_WITHOUT_EFFECT, *table.FLAGS_NO_MATTER}
        self.assertEqual(sorted(flags - set().union(*stored.values())), [])

    def test_every_flag_of_this_version_is_in_it(self):
        there = {name[2:] for each in (mujoco.mjtDisableBit, mujoco.mjtEnableBit) for name in dir(each)
                 if name.startswith(("mjDSBL_", "mjENBL_"))}
        flags = {*table.FLAGS_USED, *table.FLAGS_WITHOUT_EFFECT, *table.FLAGS_NO_MATTER}
        self.assertEqual(sorted(there - flags), [])

    def test_no_field_has_two_statuses(self):
        lists = set(self.rows) - {"geom_type"}, set(table.USED), set(table.NO_MATTER)
        self.assertEqual(sum(map(len, lists)), len(set.union(*lists)))


class Fields(unittest.TestCase):
    def test_of_a_plain_model_all_is_used(self):
        self.assertEqual(found(), [table.Finding(table.HELD, "body", ["cube"], "by the server, while the hand carries it")])

    def test_torsional_and_rolling_friction_are_not_felt(self):
        for condim in (4, 6):
            self.assertEqual(fields(ball=f'condim="{condim}"'), {"geom_condim": ("approximate", ["ball"])})
        self.assertEqual(fields(ball='condim="1"', floor='condim="1"', box='condim="1"'), {})

    def test_a_smooth_geom_on_a_rougher_one_is_named(self):
        self.assertEqual(fields(ball='condim="1"', box='friction=".3"'), {"geom_condim": ("approximate", ["ball"])})

    def test_softness_and_margins_are_not_felt(self):
        for text, field in (('solref=".01 1"', "geom_solref"), ('solimp=".8 .95 .001"', "geom_solimp"),
                            ('solmix="2"', "geom_solmix"), ('margin=".001"', "geom_margin"), ('gap=".001"', "geom_gap")):
            self.assertEqual(fields(floor=text), {field: ("ignored", ["floor"])})
        if VERSION >= (3, 17):
            self.assertEqual(fields(floor='adhesion="3"'), {"geom_adhesion": ("ignored", ["floor"])})
            self.assertEqual(fields(floor='surfacevel="1 0 0 0 0 0"'), {"geom_surfacevel": ("ignored", ["floor"])})

    def test_of_a_geom_that_touches_nothing_nothing_is_said(self):
        self.assertEqual(fields(ball='contype="0" conaffinity="0" condim="6" margin=".01"'), {})

    def test_priority_cone_and_flags_of_contacts_are_used(self):
        self.assertEqual(fields(ball='priority="2"', option='cone="elliptic"'), {})
        self.assertEqual(fields(flags=f'<flag multiccd="{"disable" if VERSION >= (3, 17) else "enable"}"/>'), {})
        self.assertEqual(fields(option='impratio="5"'), {"opt.impratio": ("ignored", [])})

    def test_a_pair_has_its_own(self):
        pair = ('<contact><pair geom1="ball" geom2="floor" condim="6" margin=".001" friction="1 .5 .1 .1 .1" '
                'solreffriction=".1 1"/></contact>')
        expected = {"pair_dim": "approximate", "pair_friction": "approximate", "pair_margin": "ignored",
                    "pair_solreffriction": "ignored"}
        self.assertEqual({field: status for field, (status, names) in fields(rest=pair).items()}, expected)
        self.assertEqual(fields(rest=pair)["pair_dim"][1][0].split(" on "), ["floor", "ball"])

    def test_what_overrides_counts_only_where_it_does(self):
        option = 'o_margin=".001" o_solref=".01 1"'
        self.assertEqual(fields(option=option), {})
        self.assertEqual(sorted(fields(option=option, flags='<flag override="enable"/>')), ["opt.o_margin", "opt.o_solref"])

    def test_a_long_step_is_named(self):
        self.assertEqual(fields(option='timestep=".005"'), {})
        self.assertEqual(fields(option='timestep=".02"'), {"opt.timestep": ("approximate", [])})

    def test_compensation_of_gravity_is_used_but_for_its_torque(self):
        world = '<body pos="2 0 1" gravcomp="1"><freejoint/><geom size=".1"/><body pos="0 0 .2" {}><geom size=".1"/></body></body>'
        self.assertEqual(fields(world=world.format('gravcomp="1"')), {})
        self.assertEqual(list(fields(world=world.format(""))), ["body_gravcomp"])

    def test_stops_of_what_is_held_are_the_server_s(self):
        joint = 'range="-1 1" limited="true" solreflimit=".05 1" margin=".01"'
        self.assertEqual(fields(world=lid(joint)), {"jnt_solref": ("ignored", ["hinge"]), "jnt_margin": ("ignored", ["hinge"])})
        self.assertEqual(fields(world=lid('solreflimit=".05 1"')), {})
        self.assertEqual(fields(world=lid('frictionloss="1" solreffriction=".05 1"')), {"dof_solref": ("ignored", ["hinge"])})

    def test_dry_friction_of_the_tool_is_not_felt(self):
        model = loaded()
        model.dof_frictionloss[:6] = 1
        self.assertEqual([each.field for each in haptic.mujoco.check(model, "tool", mujoco)], ["dof_frictionloss", "body"])

    def test_a_flag_without_effect_is_named(self):
        servo = '<actuator><motor joint="hinge"/></actuator>'
        self.assertEqual(list(fields(world=lid(), rest=servo, flags='<flag actuation="disable"/>')), ["opt.disableflags"])
        self.assertEqual(fields(flags='<flag actuation="disable"/>'), {})


class WhoMoves(unittest.TestCase):
    def test_lids_and_cubes_are_held(self):
        self.assertEqual(reasons(world=lid()), {"cube": table.HELD, "lid": table.HELD})

    def test_an_arm_is_moved_ahead_with_what_joints_connect_to_it(self):
        arm = lid(more='<body name="hand" pos="0 0 .2"><joint/><geom size=".02"/></body>')
        self.assertEqual(reasons(world=arm, rest='<actuator><motor joint="hinge"/></actuator>'), {
            "cube": table.HELD, "lid": bodies.ACTUATOR, "hand": f"joints connect it with lid: {bodies.ACTUATOR}"})

    def test_each_reason_is_told(self):
        for says, parts in (
                (bodies.TENDON, {"rest": '<tendon><fixed><joint joint="hinge" coef="1"/></fixed></tendon>'}),
                (bodies.EQUALITY, {"rest": '<equality><joint joint1="hinge"/></equality>'}),
                (bodies.BALL_JOINT, {"joint": 'type="ball"'}), (bodies.SECOND_JOINT, {"more": '<joint axis="1 0 0"/>'}),
                (bodies.COUNTS_TURNS, {"joint": 'stiffness="1"'}), (bodies.FLUID, {"option": 'density="1000"'}),
                (bodies.TOO_MANY, {"more": '<body pos="0 0 1"><joint/><geom size=".02"/>' * 16 + "</body>" * 16})):
            with self.subTest(says):
                parts["world"] = lid(parts.pop("joint", ""), parts.pop("more", ""))
                self.assertEqual(reasons(**parts)["lid"], says)
        self.assertEqual(reasons(on_tool='<body name="tail"><joint/><geom size=".01"/></body>')["tail"], bodies.HANGS_ON_TOOL)
        mocap = '<body name="grip" mocap="true"><body name="finger"><joint/><geom size=".01"/></body></body>'
        self.assertEqual(reasons(world=mocap)["finger"], bodies.HANGS_ON_MOCAP)
        damped = '<body name="float" pos="2 0 1"><joint type="free" damping="1"/><geom size=".1"/></body>'
        self.assertEqual(reasons(world=damped)["float"], bodies.FREE_JOINT)
        self.assertEqual(reasons(box='contype="0" conaffinity="0"')["cube"], bodies.NO_SHAPE)

    def test_what_is_no_line_moves_its_own_joint_alone(self):
        if VERSION >= (3, 17):
            other = lid().replace('"lid"', '"other"').replace('"hinge"', '"other"').replace("on_lid", "on_other")
            found_ = reasons(world=lid('damping="1 2"') + other)
            self.assertEqual((found_["lid"], found_["other"]), (bodies.CURVED, table.HELD))

    def test_an_actuator_of_an_orientation_moves_its_body(self):
        if VERSION >= (3, 17):
            rest = '<actuator><orientation site="on_lid" refsite="on_cube" kp="1"/></actuator>'
            self.assertEqual(reasons(world=lid(), rest=rest), {"lid": bodies.ACTUATOR, "cube": bodies.ACTUATOR})

    def test_beside_a_height_field_nothing_is_held(self):
        top = '<asset><hfield name="hills" nrow="3" ncol="3" size="1 1 .1 .1"/></asset>'
        parts = {"top": top, "world": '<geom name="hills" type="hfield" hfield="hills" pos="0 0 -1"/>'}
        self.assertEqual(fields(**parts), {"geom_type": ("approximate", ["hills"])})
        self.assertEqual(reasons(**parts), {"cube": bodies.NO_SHAPE})

    def test_an_sdf_is_felt_by_mujoco_s_contacts(self):
        model = loaded()
        model.geom_type[0] = int(mujoco.mjtGeom.mjGEOM_SDF)
        of_floor = haptic.mujoco.check(model, "tool", mujoco)[0]
        self.assertEqual((of_floor.status, of_floor.field, of_floor.names), ("approximate", "geom_type", ["floor"]))

    def test_a_flex_is_not_felt(self):
        flex = ('<deformable><flex name="cloth" dim="2" body="world world world" vertex="0 0 2 1 0 2 0 1 2" '
                'element="0 1 2"/></deformable>')
        self.assertEqual(fields(rest=flex), {"flex_dim": ("ignored", ["cloth"])})
        self.assertEqual(reasons(rest=flex), {"cube": bodies.FLEX})

    def test_what_is_held_is_what_a_session_gives_the_server(self):
        arm = lid(more='<body name="hand" pos="0 0 .2"><joint/><geom size=".02"/></body>')
        for rest in ("", '<actuator><motor joint="hinge"/></actuator>',
                     '<equality><weld body1="cube" body2="lid" active="false"/></equality>'):
            model = loaded(world=arm, rest=rest)
            tool, data = model.body("tool").id, mujoco.MjData(model)
            shapes = Shapes(mujoco, model, Parts({tool: 0}))
            given = bodies.Bodies(mujoco, model, [tool], Changes(model)).dynamics(data, shapes.bodies, shapes.carriers)["body"]
            held = [name for name, why in reasons(world=arm, rest=rest).items() if why == table.HELD]
            self.assertEqual(held, [model.body(int(body)).name for body in given])


class Command(unittest.TestCase):
    def run_on(self, text, *options):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder, "model.xml")
            file.write_text(text)
            command = [sys.executable, "-m", "haptic_local_model.mujoco", "check", file, *options]
            return subprocess.run(command, capture_output=True, text=True, env={"PYTHONPATH": PACKAGE}, cwd=folder)

    def test_a_line_for_each(self):
        empty = dict.fromkeys("option flags top floor on_tool box rest".split(), "")
        ran = self.run_on(SCENE.format(**empty, ball='condim="6"', world=lid()))
        self.assertEqual((ran.returncode, ran.stderr), (0, ""))
        self.assertEqual(ran.stdout.splitlines(), [
            "approximate  geom_condim  1: ball             sliding friction is felt, torsional and rolling friction are not",
            "held         body         3: tool, cube, lid  by the server, while the hand carries it"])

    def test_a_plain_model(self):
        empty = dict.fromkeys("option flags top floor ball on_tool box world rest".split(), "")
        ran = self.run_on(SCENE.format(**empty), "--tool", "tool")
        self.assertEqual((ran.returncode, ran.stdout.splitlines()[0]), (0, "all of it is used"))

    def test_what_cannot_be_read_is_said_in_one_line(self):
        for text, options in (("<mujoco><nothing/></mujoco>", ()), ("<mujoco/>", ("--tool", "peg"))):
            ran = self.run_on(text, *options)
            self.assertEqual((ran.returncode, ran.stdout, len(ran.stderr.splitlines())), (2, "", 1))


if __name__ == "__main__":
    warnings.simplefilter("error", DeprecationWarning)
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
