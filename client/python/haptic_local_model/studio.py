"""A model in MuJoCo Studio, in the hand, without a line of code.

    python3 -m haptic_local_model.studio --model=scene.xml             # a window; --gfx=web: the browser
    python3 -m mujoco.studio.viewer --model=scene.xml --plugins=FILE   # FILE: what the line above prints with --file

A double click on a body with a free joint puts it in the hand, one on a robot's gripper puts that there, and the arm follows; another
one changes hands. A button closes and opens the jaws. The hand is a device, where a
haptic_server runs, or the mouse: Ctrl and the right button move the body, Ctrl and the left one turn it. A model without either
gets a small ball, which is in the hand from the start. An arrow is the force.

While the world is paused, scrubbed, slower than real time or no longer looked at in the browser, there is no hand: the force
fades within 0.1 s, the model is as it was, and later it begins anew from where the body is then, slowly. So it is after a reset.

Needs mujoco 4.0 with its Studio: Python 3.12 for a window, 3.11 for the browser.
"""

from __future__ import annotations

import argparse
import dataclasses
import logging
import os
import sys
import time
from typing import Any, Callable, Optional

import mujoco
import numpy as np
from mujoco.studio import messages, plugin, sim
from mujoco.studio.dear_imgui import dear_imgui as imgui

import haptic_local_model as haptic
from haptic_local_model._mujoco_shapes import carriers
from haptic_local_model._mujoco_gripper import palm_of
from haptic_local_model.mujoco import Session

if __name__.startswith("studio_plugins."):  # Studio has put this folder, with a newton.py and a drake.py, where all look.
    sys.path[:] = [each for each in sys.path if each != os.path.dirname(os.path.abspath(__file__))]

PERIOD = 1 / 60  # s, of a frame
PROBE = "haptic_ball"
_ARROW = 0.02  # of the model's extent, for each N
_COLOUR = np.array((0.95, 0.5, 0.1, 1), np.float32)
_PANEL = (230, 40)  # pixels: where it is at first, beside Studio's own
_FULL_SPEED = 100  # %
_WORDS = {"fault": "a fault, as 2 m away from where it began: pause, and go on; with a server of your own, haptic_doctor clear"}
_FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclasses.dataclass(frozen=True)
class WantedSnapshot(messages.Snapshot):
    """What the person at the viewer wants. body: the number of the selected one, 0: none. pose: where the mouse draws it, as
    position and w, x, y, z of the body's frame; empty: it does not. seen: somebody looks."""
    body: int = 0
    pose: tuple[float, ...] = ()
    seen: bool = False


@dataclasses.dataclass(frozen=True)
class FeltSnapshot(messages.Snapshot):
    """What the hand feels: force, N, at a point of the world, m; what is to be said; and the number of the body, 0: none."""
    text: str = ""
    force: tuple[float, ...] = (0, 0, 0)
    point: tuple[float, ...] = (0, 0, 0)
    body: int = 0


class LetGoEvent(messages.Event):
    """Nothing shall be in the hand until another body is selected."""


class JawsEvent(messages.Event):
    """The jaws shall close, or open again."""


class Hand(plugin.SimPlugin):
    """Steps the world at the hand's pace while there is a hand, in place of Studio's StepControl."""

    _touch: Optional[Session] = None
    _body = 0  # That is to be in the hand, of a gripper the palm; 0: none.
    _closes: Optional[bool] = None  # Its jaws, by the button; None: the device leads them.
    _held_name = _path = ""
    _selected = 0  # By the last double click.
    _wanted = WantedSnapshot()
    _paused, _speed = False, float(_FULL_SPEED)  # %
    _problem = ""
    _next = 0.0  # s: when the next frame begins
    _felt = FeltSnapshot()

    @messages.handler
    def on_load_model(self, event: messages.LoadModelEvent) -> bool:
        """A model without a body for the hand gets one. True: it is loaded."""
        path = event.path or self.handle.model_path
        if not path.endswith((".xml", ".urdf")):
            return False
        try:
            model = _with_body_to_hold(path)
        except (ValueError, OSError):  # Studio says what is wrong with it.
            return False
        self.handle.set_model(model, path=path)
        return True

    @messages.handler
    def on_post_model(self, event: messages.PostModelEvent) -> None:
        """The body of the same name stays in the hand where a model is loaded again."""
        self._end()
        names = (self._held_name, PROBE) if event.path == self._path else (PROBE,)
        found = [mujoco.mj_name2id(event.model, mujoco.mjtObj.mjOBJ_BODY, name) for name in names if name]
        if event.path != self._path:  # Studio runs it at full speed.
            self._paused, self._speed = False, float(_FULL_SPEED)
        self._path, self._problem, self._selected = event.path, "", 0
        self._hold(event.model, next((body for body in found if body > 0 and (
            is_free(event.model, body) or palm_of(mujoco, event.model, body) == body)), 0))

    @messages.handler
    def on_reset(self, event: messages.ResetEvent) -> None:
        self._end()

    @messages.handler
    def on_step_control(self, event: messages.StepControlSnapshot) -> None:
        self._paused, self._speed = event.pause_state != sim.PauseState.UNPAUSED, event.speed

    @messages.handler
    def on_pause(self, event: messages.RequestPauseEvent) -> None:
        self._paused = event.pause_state != sim.PauseState.UNPAUSED

    @messages.handler
    def on_wanted(self, wanted: WantedSnapshot) -> None:
        self._wanted = wanted
        model = self.handle.model
        if model is None or wanted.body == self._selected or wanted.body >= model.nbody:
            return
        self._selected = wanted.body
        if wanted.body == 0:
            return
        body = int(carriers(model)[wanted.body])
        body = palm_of(mujoco, model, wanted.body) or (body if is_free(model, body) else 0)
        if body > 0 and body == self._body:
            return
        self._end()
        self._problem = "" if body > 0 else f"{_name(model, wanted.body)} has no free joint, and is no gripper's"
        self._hold(model, body)

    @messages.handler
    def on_let_go(self, event: LetGoEvent) -> None:
        self._end()
        self._hold(self.handle.model, 0)
        self._problem = ""

    @messages.handler
    def on_jaws(self, event: JawsEvent) -> None:
        if self._touch is not None and self._touch.has_gripper:
            self._closes = self._touch.opening > 0.5 if self._closes is None else not self._closes
            self._touch.move_jaws(0 if self._closes else 1)

    @messages.handler
    def on_exit(self, event: messages.ExitEvent) -> None:
        self._end()

    @messages.handler
    def on_step(self, event: messages.StepEvent) -> bool:
        """One frame. True: the world was stepped."""
        runs = not self._paused and self._speed == _FULL_SPEED and self._wanted.seen and self._body > 0
        if runs:
            try:
                self._frame(event.model, event.data)
            except haptic.HapticError as error:
                self._end()
                self._hold(event.model, 0)
                self._problem, runs = str(error), False
        elif self._touch is not None:
            self._end()
        self._tell(event.model, event.data)
        return runs

    def _frame(self, model: Any, data: Any) -> None:
        if self._touch is None:
            has_jaws = palm_of(mujoco, model, self._body) > 0
            tool, gripper = (None, self._body) if has_jaws else (self._body, None)
            self._touch = Session(model, data, tool=tool, gripper=gripper, period=PERIOD, binding=mujoco)
            self._next = time.monotonic()
        data.xfrc_applied[carriers(model) == self._body] = 0  # The mouse's own spring.
        if self._wanted.pose:
            self._touch.hold(self._wanted.pose[:3], self._wanted.pose[3:])
        else:
            self._touch.release()
        for _ in range(self._touch.drive(data)):
            mujoco.mj_step(model, data)
        self._touch.send(data)
        self._next = max(self._next + PERIOD, time.monotonic())
        time.sleep(max(0, self._next - time.monotonic()))

    def _hold(self, model: Any, body: int) -> None:
        self._closes = None
        self._body, self._held_name = body, _name(model, body) if body > 0 else ""

    def _end(self) -> None:
        if self._touch is not None:
            self._touch.close()
        self._touch = None

    def _tell(self, model: Any, data: Any) -> None:
        """The viewer, where there is news."""
        felt = FeltSnapshot(self._problem or "Double-click a body that can move freely")
        if self._touch is not None:
            touch = self._touch.touch
            text = f"{_name(model, self._body)}: {touch.message or _WORDS.get(touch.server_state, touch.server_state)}"
            felt = FeltSnapshot(text, tuple(touch.force[:3]), tuple(data.xpos[self._body]), self._body)
        elif self._body > 0:
            why = "in the hand at full speed alone, and not while paused" if self._wanted.seen else "nobody looks"
            felt = FeltSnapshot(f"{_name(model, self._body)}: {why}", body=self._body)
        if felt != self._felt:
            self._felt = felt
            self.handle.send_to_viewer(felt)


class HandPanel(plugin.ViewerPlugin):
    """The mouse as a hand, the force as an arrow, and a panel that says how it stands."""

    _felt = FeltSnapshot()
    _browsers: Optional[_Browsers] = None
    _arrow: Any = None

    @messages.handler
    def on_init(self, event: plugin.ViewerInitEvent) -> None:
        if type(event.viewer).__name__ == "WebViewer":
            self._browsers = _Browsers()

    @messages.handler
    def on_felt(self, felt: FeltSnapshot) -> None:
        """What is in the hand without a click is selected, so that the mouse moves it; what is let go of is not."""
        selected = self.viewer.perturb.select
        if felt.body != self._felt.body and (0 in (felt.body, selected) or not self._is_part(selected, felt.body)):
            self.viewer.perturb.select = felt.body
        self._felt = felt

    def _is_part(self, body: int, held: int) -> bool:
        """Whether it moves as a whole with what is held. The mouse moves a gripper by its palm."""
        model = self.viewer.model
        return model is not None and bool(carriers(model)[body] == carriers(model)[held])

    @messages.handler
    def on_post_model(self, event: messages.PostModelEvent) -> None:
        """What was selected in another model is not."""
        self.viewer.perturb.select = 0

    @messages.handler
    def on_update(self, event: messages.UpdateEvent) -> None:
        model, perturb = self.viewer.model, self.viewer.perturb
        if model is None or self.viewer.data is None:
            return
        pose: tuple[float, ...] = ()
        if perturb.select > 0 and perturb.active:
            pose = body_pose(model, perturb.select, perturb.refpos, perturb.refquat, self._felt.body)
        self.viewer.send_to_sim(WantedSnapshot(perturb.select, pose, self._browsers is None or self._browsers.count > 0))
        self._draw(self.viewer.extra_geoms, _ARROW * model.stat.extent)

    @messages.handler
    def on_build_gui(self, event: messages.BuildGuiEvent) -> None:
        imgui.SetNextWindowPos(imgui.Vec2(*_PANEL), imgui.Cond.Appearing)
        if imgui.Begin("Haptics"):
            imgui.TextUnformatted(self._felt.text)
            imgui.TextUnformatted(f"{np.linalg.norm(self._felt.force):.2f} N")
            if imgui.Button("Jaws"):
                self.viewer.send_to_sim(JawsEvent())
            imgui.SameLine()
            if imgui.Button("Let go"):
                self.viewer.perturb.select = 0
                self.viewer.send_to_sim(LetGoEvent())
        imgui.End()

    @messages.handler
    def on_exit(self, event: messages.ExitEvent) -> None:
        if self._browsers is not None:
            self._browsers.close()

    def _draw(self, geoms: Any, scale: float) -> None:
        if self._arrow is not None and any(each is self._arrow for each in geoms):
            geoms[:] = [each for each in geoms if each is not self._arrow]
        self._arrow, force = None, np.array(self._felt.force)
        if np.linalg.norm(force) < 0.05:  # N
            return
        self._arrow, kind = mujoco.MjvGeom(), int(mujoco.mjtGeom.mjGEOM_ARROW)
        mujoco.mjv_initGeom(self._arrow, kind, np.zeros(3), np.zeros(3), np.eye(3).ravel(), _COLOUR)
        point = np.array(self._felt.point)
        mujoco.mjv_connector(self._arrow, kind, 0.3 * scale, point, point + scale * force)
        geoms.append(self._arrow)


class _Browsers(logging.Handler):
    """How many show the page of the web viewer, which says so in its log alone."""

    def __init__(self) -> None:
        super().__init__(logging.INFO)
        self.count = 0
        self._log = logging.getLogger("WebServer")
        self._log.addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        if str(record.msg).startswith("[StateWS] Browser ") and isinstance(record.args, tuple) and record.args:
            self.count = int(record.args[0])  # type: ignore[call-overload]

    def close(self) -> None:
        self._log.removeHandler(self)
        super().close()


def is_free(model: Any, body: int) -> bool:
    """Whether the hand can hold it."""
    return bool(model.body_jntnum[body] == 1 and model.jnt_type[model.body_jntadr[body]] == _FREE)


def body_pose(model: Any, body: int, position: Any, rotation: Any, palm: int = 0) -> tuple[float, ...]:
    """Of the hand that holds what this body is a part of: position, and w, x, y, z. position, rotation: of the body's inertial frame,
    as Studio's mouse has it. palm: of the gripper that is held, or 0."""
    turn, back, arm = np.zeros(4), np.zeros(4), np.zeros(3)
    mujoco.mju_negQuat(back, model.body_iquat[body])
    mujoco.mju_mulQuat(turn, np.array(rotation), back)
    mujoco.mju_rotVecQuat(arm, model.body_ipos[body], turn)
    place = np.array(position) - arm
    while body not in (palm, carriers(model)[body]):  # To what it is welded to.
        mujoco.mju_negQuat(back, model.body_quat[body])
        mujoco.mju_mulQuat(turn, turn.copy(), back)
        mujoco.mju_rotVecQuat(arm, model.body_pos[body], turn)
        place, body = place - arm, int(model.body_parentid[body])
    return (*place.tolist(), *(turn / np.linalg.norm(turn)).tolist())


def _with_body_to_hold(path: str) -> Any:
    """The model of a file; where it has no body that the hand can hold, with a ball above it. Raises what MjSpec does."""
    spec = mujoco.MjSpec.from_file(path)
    model = spec.compile()
    if any(is_free(model, body) or palm_of(mujoco, model, body) > 0 for body in range(1, model.nbody)):
        return model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    solid = np.asarray(model.geom_type) != int(mujoco.mjtGeom.mjGEOM_PLANE)
    top = (np.asarray(data.geom_xpos)[solid, 2] + np.asarray(model.geom_rbound)[solid]).max(initial=0)
    radius = float(np.clip(0.02 * model.stat.extent, 0.005, 0.02))  # m
    place = np.array((*model.stat.center[:2], top + 2 * radius))
    ball = spec.worldbody.add_body(name=PROBE, pos=place, gravcomp=1)
    ball.add_freejoint()
    masks = [int(np.bitwise_or.reduce(getattr(model, name), initial=1)) for name in ("geom_contype", "geom_conaffinity")]
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(radius, 0, 0), pos=np.zeros(3), mass=0.1, rgba=_COLOUR,
                  contype=masks[0] | masks[1], conaffinity=masks[0] | masks[1])
    for key in spec.keys:  # The ball comes last in each.
        if len(key.qpos) > 0:
            key.qpos = np.concatenate([key.qpos, place, (1, 0, 0, 0)])
        if len(key.qvel) > 0:
            key.qvel = np.concatenate([key.qvel, np.zeros(6)])
    return spec.compile()


def _name(model: Any, body: int) -> str:
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body {body}"


def main() -> None:
    """MuJoCo's viewer with this plugin, and the options of both."""
    if sys.argv[1:] == ["--file"]:
        print(__file__)
        return
    from mujoco.studio import viewer
    parser = argparse.ArgumentParser(add_help=False)
    parser.add_argument("--plugins", action="append", default=[])
    given, kept = parser.parse_known_args()
    sys.argv = [sys.argv[0], *kept, "--plugins=" + ",".join([__file__, *filter(None, given.plugins)])]
    viewer.main()


if __name__ == "__main__":
    main()
