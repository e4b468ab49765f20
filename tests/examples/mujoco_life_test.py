#!/usr/bin/python3
"""haptic.mujoco in the life of a model: it is given back as it was, may be reset, and may change while it is felt.

Usage: mujoco_life_test.py HAPTIC_SERVER LIBHAPTIC PACKAGE_FOLDER [TEST …], as mujoco_python_test.py
"""

import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import mujoco_python_test as session  # noqa: E402  (finds the library and the package)
import haptic_local_model as haptic  # noqa: E402
import mujoco  # noqa: E402
import numpy as np  # noqa: E402

BALL = 'name="ball" type="sphere" size="0.02" margin="0.001" gap="0.0005"'
BOX = 'type="box" size="0.02 0.02 0.02"'
OWN = (0, 0.25, 0.1, 0, 0, 0)  # N: a force of the user's
PUSH = np.array((1.1, 0.3, -0.7, 0.01, 0, 0))  # N, N m: what the hand did to the brick, /s


def scene(tool=BALL, bodies=session.BRICK, height=0.03, rest="", option=""):
    text = session.SCENE.format(step=0.002, height=height, tool=tool, bodies=bodies).replace("</worldbody>", "</worldbody>" + rest)
    return session.loaded(text.replace("<option ", f"<option {option} "))


def alone(model, data, **options):
    """A session that no server answers."""
    return haptic.mujoco.Session(model, data, tool="tool", binding=mujoco, server="127.0.0.1:9", **options)


def contents(model):
    """Every array and number of a model and of its options, as bytes."""
    return {(part is model, name): np.asarray(getattr(part, name)).tobytes() for part in (model, model.opt) for name in dir(part)
            if not name.startswith("_") and isinstance(getattr(part, name), (np.ndarray, int, float))}


class GivenBack(unittest.TestCase):
    PAIR = '<contact><pair geom1="ball" geom2="table" margin="0.002" gap="0.001"/></contact>'

    def test_after_a_session_every_byte_of_the_model_is_as_it_was(self):
        for contacts in ("engine", "shapes"):
            for end in ("close", "with"):
                with self.subTest(contacts=contacts, end=end):
                    model, data = scene(rest=self.PAIR)
                    before = contents(model)
                    touch = alone(model, data, contacts=contacts)
                    if end == "with":
                        touch.__enter__()
                    for has_force in (False, True, False):
                        touch._listing.set_force(has_force)
                        touch._listing.list_early(np.ones(model.ngeom, bool))
                    touch._placed.keep(2)
                    self.assertNotEqual(contents(model), before)
                    touch.close() if end == "close" else touch.__exit__(None, None, None)
                    after = contents(model)
                    self.assertEqual([name for name in before if after[name] != before[name]], [])

    def test_what_the_user_changed_meanwhile_stays(self):
        model, data = scene()
        with alone(model, data, contacts="engine") as touch:
            model.dof_armature[6:9], model.geom_margin[2] = 0.5, 0.003
            touch._listing.set_force(False)
        np.testing.assert_array_equal(model.dof_armature, [0] * 6 + [0.5] * 3 + [0] * 3)
        np.testing.assert_array_equal(model.geom_margin, (0, 0.001, 0.003))

    def test_what_mujoco_derives_of_a_mass_that_the_user_changed_holds_no_body(self):
        model, data = scene()
        with alone(model, data):
            model.body_mass[1] *= 2
            mujoco.mj_setConst(model, mujoco.MjData(model))
        np.testing.assert_array_equal(model.dof_armature, 0)
        self.assertLess(model.dof_M0.max(), 1)  # kg

    def test_a_session_that_cannot_be_changes_nothing(self):
        model, data = scene()
        before = contents(model)
        for wrong in ({"rate": "fast"}, {"gravity": (1, 2)}, {"epsilon": -1}):
            with self.assertRaises(haptic.HapticError):
                alone(model, data, **wrong)
        self.assertEqual(contents(model), before)


class Pushed(unittest.TestCase):
    """What the tool did to the brick is in xfrc_applied from drive() to send(), and then it is not, whatever happened."""

    def left(self, meanwhile, own=OWN):
        """xfrc_applied of the brick after three frames in which it is pushed; meanwhile(model, data): between drive() and
        send(), may return other data."""
        model, data = scene()
        data.xfrc_applied[2] = own
        with alone(model, data, contacts="engine") as touch:
            for _ in range(3):
                touch.touch.impulses = lambda length: {2: PUSH * length}
                steps = touch.drive(data)
                np.testing.assert_allclose(data.xfrc_applied[2], own + PUSH)
                mujoco.mj_step(model, data, steps)
                other = meanwhile(model, data)
                touch.send(data if other is None else other)
                left = np.array(data.xfrc_applied[2])
                data.xfrc_applied[2] = own
                touch._frames._touch.steps = lambda step: 8
        return left

    def test_nothing_is_left_of_it(self):
        def wind(model, data):  # which is there for a while
            data.xfrc_applied[2] += 0.1
            data.xfrc_applied[2] -= 0.1
        cases = {"nothing": (lambda model, data: None, OWN), "a wind": (wind, OWN),
                 "mj_resetData": (mujoco.mj_resetData, np.zeros(6)),
                 "a keyframe": (lambda model, data: mujoco.mj_resetDataKeyframe(model, data, 0), np.zeros(6)),
                 "new data": (lambda model, data: mujoco.MjData(model), OWN),
                 "an environment that clears": (lambda model, data: data.xfrc_applied.fill(0), np.zeros(6)),
                 "a user who sets": (lambda model, data: data.xfrc_applied.__setitem__(2, 0.4), np.full(6, 0.4))}
        for name, (meanwhile, due) in cases.items():
            with self.subTest(name):
                np.testing.assert_allclose(self.left(meanwhile), due, atol=1e-12)

    def test_where_it_was_cleared_the_brick_s_acceleration_is_without_it(self):
        model, data = scene()
        with alone(model, data, contacts="engine") as touch:
            touch.touch.impulses = lambda length: {2: PUSH * length}
            for cleared in (False, True):
                touch.drive(data)
                if cleared:
                    data.xfrc_applied[:] = 0
                mujoco.mj_forward(model, data)
                np.testing.assert_allclose(touch._bodies(data, [2])["acceleration"][0][:3], (0, 0, -session.GRAVITY), atol=1e-5)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:], verbosity=2)
