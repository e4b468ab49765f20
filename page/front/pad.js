// How a gamepad or a 3-D mouse becomes the hand.

import { Vector3 } from 'three';

const IDLE = 0.12;               // of an axis that nobody moves
const MOVE_PER_SECOND = 0.12;    // m, at full swing
const TURN_PER_SECOND = Math.PI / 2;
const HOLD = 0, LET_GO = 1;      // buttons
const LONGEST_STEP = 0.1;        // s
const SPACE_MOUSE = /3dconnexion|spacemouse|spacenavigator|space ?pilot|046d.*c6[0-9a-f]{2}|256f/i;

/** What a gamepad asks for: shift and turn along the view's right, up and away, each -1 to 1; hold, letGo. `plan`: the
 *  scene is seen from above. */
export function wishOf({ id, axes, buttons }, plan) {
  const pressed = (i) => Boolean(buttons[i]?.pressed);
  const at = (i) => (Math.abs(axes[i] ?? 0) < IDLE ? 0 : Math.sign(axes[i]) * ((Math.abs(axes[i]) - IDLE) / (1 - IDLE)) ** 2);
  const value = (i) => buttons[i]?.value ?? 0;
  const wish = SPACE_MOUSE.test(id) && axes.length >= 6 ? ofSpaceMouse(at, plan) : {
    shift: [at(0), -at(1), -at(3)],
    turn: [value(6) - value(7), Number(pressed(5)) - Number(pressed(4)), at(2)],
  };
  return { ...wish, hold: pressed(HOLD), letGo: pressed(LET_GO) };
}

/** Its axes point right, to the person and down, and it turns about them: x y z, then the rotations. */
function ofSpaceMouse(at, plan) {
  const [x, y, z, rx, ry, rz] = [0, 1, 2, 3, 4, 5].map(at);
  return plan ? { shift: [x, -y, z], turn: [rx, -ry, rz] } : { shift: [x, -z, -y], turn: [rx, -rz, -ry] };
}

export class Pad {
  constructor(hand, scene) {
    Object.assign(this, { hand, scene, steppedAt: 0, holds: false });
  }

  /** At each picture; `now` in ms. */
  step(now) {
    const elapsed = Math.min((now - this.steppedAt) / 1000, LONGEST_STEP);
    this.steppedAt = now;
    const pads = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.connected);
    if (pads.length === 0 && !this.holds) return;
    const wishes = pads.map((pad) => wishOf(pad, this.scene.view?.mode === 'plan'));
    if (wishes.some(({ letGo }) => letGo)) this.hand.release();
    const busy = wishes.filter(({ shift, turn, hold }) => hold || [...shift, ...turn].some(Boolean));
    if (this.#grips(busy.length > 0)) busy.forEach((wish) => this.#move(wish, elapsed));
  }

  /** Whether the pad holds the hand. One that was taken from it must be let go before it grips again. */
  #grips(busy) {
    if (busy && !this.holds) {
      this.holds = true;
      this.hand.grab('pad');
    } else if (!busy && this.holds) {
      this.holds = false;
      if (this.hand.held) this.hand.letGo('pad');
    }
    return this.holds && this.hand.held;
  }

  #move({ shift, turn }, elapsed) {
    const { right, up, away } = this.scene.viewAxes();
    const axes = [right, up, away];
    const planar = Boolean(this.scene.world.planar);
    const step = new Vector3();
    axes.forEach((axis, i) => {
      if (planar && i === 2) return;
      step.addScaledVector(axis, shift[i] * MOVE_PER_SECOND * elapsed);
    });
    this.hand.moveBy(...step.toArray());
    axes.forEach((axis, i) => {
      if (turn[i] && (!planar || i === 2)) this.hand.turnBy(turn[i] * TURN_PER_SECOND * elapsed, axis);
    });
  }
}
