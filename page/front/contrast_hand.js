// One hand on both handles: that of the person at the page, or one that presses until there is one.

import { Hand } from './hand.js';

const PRESSED = 0.045;      // m: y of the target, 25 mm below a handle that touches: 5 N
const SWAY = 0.022;         // m, to and fro along the floor
const SWAY_SECONDS = 6;
const APPROACH_SECONDS = 1;
const WAIT_MS = 4000;       // after a person let go
const REACH = { x: 0.06, above: -0.03, below: 0.075 };   // m: the hand stays in the picture

/** The picture that the pointer is in, as Hand wants it. */
class Stage {
  constructor(views) {
    this.views = views;
    this.active = views.at(-1);
  }

  get live() { return this.views.every((view) => view.live); }
  get frame() { return this.active.frame; }
  get world() { return this.active.world; }
  viewAxes() { return this.active.viewAxes(); }

  picks(clientX, clientY, touch) {
    const view = this.views.find((each) => each.contains(clientX, clientY));
    if (!view?.picks(clientX, clientY, touch)) return false;
    this.active = view;
    return true;
  }

  pointInPlane(clientX, clientY) {
    return this.active.pointInPlane(clientX, clientY);
  }
}

export class SharedHand extends Hand {
  /** `send(message)` reaches both sides. */
  constructor(surface, views, send, changed) {
    super(surface, new Stage(views), send, changed);
    this.presses = false;
    this.freeAt = -Infinity;
    this.movedAt = -Infinity;   // when the target last rose or sank, or was taken
  }

  /** Whether the hand is that of a person. */
  get personal() {
    return this.held && !this.holders.has('script');
  }

  /** A person takes the handles from the script where they are. */
  grab(holder) {
    if (holder !== 'script' && this.holders.has('script')) super.release();
    this.movedAt = performance.now();
    return super.grab(holder);
  }

  release(holder) {
    if (this.personal) this.freeAt = performance.now() + WAIT_MS;
    super.release(holder);
  }

  moveBy(dx, dy, dz) {
    if (!this.held) return;
    if (Math.abs(dy) > 1e-6) this.movedAt = performance.now();
    super.moveBy(dx, dy, dz);
    const [x, y] = this.position;
    this.position[0] = Math.min(REACH.x, Math.max(-REACH.x, x));
    this.position[1] = Math.min(REACH.below, Math.max(REACH.above, y));
  }

  /** Whether the script may press while nobody holds. */
  setPresses(on) {
    this.presses = on;
    if (on) this.freeAt = -Infinity;
    else this.release('script');
  }

  /** What the script does now; ms, of each picture. */
  lead(now) {
    if (!this.holders.has('script')) {
      const may = this.presses && !this.held && !document.hidden && now > this.freeAt;
      if (!may || !this.grab('script')) return;
      this.begin = now;
      this.from = this.position.slice();
    }
    const t = (now - this.begin) / 1000;
    const share = smooth(Math.min(1, t / APPROACH_SECONDS));
    const turn = 2 * Math.PI * Math.max(0, t - APPROACH_SECONDS) / SWAY_SECONDS;
    const at = [this.from[0] * (1 - share) + SWAY * Math.sin(turn), this.from[1] + share * (PRESSED - this.from[1])];
    this.moveBy(at[0] - this.position[0], at[1] - this.position[1], 0);
  }
}

/** From 0 to 1 without a jerk. */
const smooth = (t) => t * t * t * (10 - 15 * t + 6 * t * t);
