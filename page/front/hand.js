// How pointer and keys become the hand: what the target is, and when it is sent.

import * as THREE from 'three';

const SEND_MS = 1000 / 60;
const REPEAT_MS = 200;
const TURN_PER_SECOND = Math.PI / 2;
const MOVE_PER_SECOND = 0.08;   // m
const SETTLE_MS = 500;          // how long frames may still show a hold that this page has ended
const KEYS = { q: 'turnLeft', e: 'turnRight', w: 'tiltAway', s: 'tiltNear', a: 'swingLeft', d: 'swingRight',
               r: 'away', f: 'near', arrowleft: 'left', arrowright: 'right', arrowup: 'up', arrowdown: 'down' };
// About which axis of the view, and which way round it.
const TURNS = { turnLeft: ['away', -1], turnRight: ['away', 1], tiltAway: ['right', -1], tiltNear: ['right', 1],
                swingLeft: ['up', -1], swingRight: ['up', 1] };
// Along which axis of the view, and which way.
const SHIFTS = { left: ['right', -1], right: ['right', 1], up: ['up', 1], down: ['up', -1],
                 near: ['away', -1], away: ['away', 1] };
// What moves the tool out of a planar world.
const SPATIAL = ['tiltAway', 'tiltNear', 'swingLeft', 'swingRight', 'near', 'away'];

export class Hand {
  /** `send(message)` says whether it could; `changed()` is called when held or let go. */
  constructor(surface, scene, send, changed) {
    Object.assign(this, { surface, scene, send, changed });
    this.holders = new Set();    // what holds: pointer, keys, pad, latch
    this.moves = new Set();      // of KEYS' values
    this.position = null;
    this.rotation = new THREE.Quaternion();
    this.latching = false;
    this.sent = [];
    this.#listenToPointer();
    this.#listenToKeys();
    this.stepped = performance.now();
    setInterval(() => this.#step(), SEND_MS + 0.5);
  }

  get held() {
    return this.position !== null;
  }

  get heldByAnother() {
    return !this.held && Boolean(this.scene.frame?.held) && !(performance.now() - this.releasedAt < SETTLE_MS);
  }

  /** [x,y,z, w,x,y,z], or null when nothing is held. */
  get target() {
    const { x, y, z, w } = this.rotation;
    return this.held ? [...this.position, w, x, y, z] : null;
  }

  /** Takes hold of the handle where it is, so that nothing jumps. */
  grab(holder = 'pointer') {
    if (!this.scene.live || !this.scene.world.guidable) return false;
    if (!this.held) {
      const { device } = this.scene.frame;
      this.position = device.slice(0, 3);
      this.rotation.set(device[4], device[5], device[6], device[3]);
      if (!this.#sendTarget(true)) {
        this.position = null;
        return false;
      }
    }
    this.holders.add(holder);
    this.changed();
    return true;
  }

  moveBy(dx, dy, dz) {
    if (!this.held) return;
    this.position[0] += dx;
    this.position[1] += dy;
    this.position[2] += dz;
  }

  /** Turns the target about a unit vector of the world, rad. */
  turnBy(angle, axis = new THREE.Vector3(0, 0, 1)) {
    if (!this.held) return;
    this.rotation.premultiply(new THREE.Quaternion().setFromAxisAngle(axis, angle)).normalize();
  }

  /** One holder lets go; the last one ends the hold. Without an argument, all do. */
  release(holder) {
    if (holder) this.holders.delete(holder);
    else this.holders.clear();
    if (!this.held || this.holders.size > 0) return;
    this.position = null;
    this.moves.clear();
    this.releasedAt = performance.now();
    this.send({ type: 'hand', hold: false });
    this.changed();
  }

  /** Whether the hand stays where it is when the pointer lets go. */
  setLatching(on) {
    this.latching = on;
    if (!on) this.release('latch');
    else if (this.held) this.holders.add('latch');
    this.changed();
  }

  /** Begins or ends one of the moves of KEYS. */
  press(move, on) {
    if (on && this.#isPossible(move) && this.grab('keys')) this.moves.add(move);
    if (!on) {
      this.moves.delete(move);
      if (this.moves.size === 0) this.letGo('keys');
    }
  }

  #isPossible(move) {
    return !this.scene.world?.planar || !SPATIAL.includes(move);
  }

  /** A holder lets go; where the hand keeps holding, it stays. */
  letGo(holder) {
    if (this.latching && this.held) this.holders.add('latch');
    this.release(holder);
  }

  #step() {
    const now = performance.now();
    const elapsed = Math.min((now - this.stepped) / 1000, 0.1);
    this.stepped = now;
    if (!this.held) return;
    this.#moveByKeys(elapsed);
    const moved = this.target.some((value, i) => value !== this.sent[i]);
    if (moved || now - this.sentAt >= REPEAT_MS) this.#sendTarget();
  }

  #moveByKeys(elapsed) {
    const axes = this.scene.viewAxes();
    for (const [move, [axis, sign]] of Object.entries(TURNS)) {
      if (this.moves.has(move)) this.turnBy(sign * TURN_PER_SECOND * elapsed, axes[axis]);
    }
    for (const [move, [axis, sign]] of Object.entries(SHIFTS)) {
      if (!this.moves.has(move)) continue;
      const step = axes[axis].clone().multiplyScalar(sign * MOVE_PER_SECOND * elapsed).toArray();
      this.moveBy(...step);
      this.under = this.under?.map((value, i) => value + step[i]);
    }
  }

  /** `grab`: the hold begins; ve_client ends holds by itself, and then refuses to go on with them. */
  #sendTarget(grab = false) {
    if (!this.send({ type: 'hand', hold: true, grab, target: this.target })) return false;
    this.sent = this.target;
    this.sentAt = performance.now();
    return true;
  }

  #listenToPointer() {
    const { surface } = this;
    // The capture phase is used: what the hand takes must not orbit the camera.
    surface.addEventListener('pointerdown', (event) => this.#pointerDown(event), true);
    surface.addEventListener('pointermove', (event) => this.#pointerMove(event));
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      surface.addEventListener(end, (event) => this.#pointerEnd(event));
    }
    window.addEventListener('blur', () => this.release());
    document.addEventListener('visibilitychange', () => document.hidden && this.release());
  }

  #pointerDown(event) {
    if (event.button !== 0 || this.pointer !== undefined || event.target.tagName !== 'CANVAS') return;
    if (!this.scene.picks(event.clientX, event.clientY, event.pointerType === 'touch')) return;
    if (!this.grab('pointer')) return;
    event.stopPropagation();
    event.target.setPointerCapture(event.pointerId);
    this.pointer = event.pointerId;
    this.under = this.scene.pointInPlane(event.clientX, event.clientY, this.position);
  }

  #pointerMove(event) {
    if (event.pointerId !== this.pointer) {
      if (event.pointerType === 'mouse') this.#showCursor(event);
      return;
    }
    const point = this.scene.pointInPlane(event.clientX, event.clientY, this.under ?? this.position);
    if (point && this.under) this.moveBy(...point.map((value, i) => value - this.under[i]));
    this.under = point ?? this.under;
  }

  #pointerEnd(event) {
    if (event.pointerId !== this.pointer) return;
    this.pointer = this.under = undefined;
    this.letGo('pointer');
  }

  #showCursor(event) {
    const over = event.buttons === 0 && event.target.tagName === 'CANVAS'
      && (this.scene.picks(event.clientX, event.clientY, false) || this.scene.bodyAt(event.clientX, event.clientY));
    if (event.buttons === 0) this.surface.style.cursor = over ? 'grab' : '';
  }

  /** Makes a button a key of its move: held while it is pressed with pointer, Enter or Space. */
  listenToButton(button, move) {
    const presses = (event) => event.key === 'Enter' || event.key === ' ';
    button.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      button.setPointerCapture(event.pointerId);
      this.press(move, true);
    });
    button.addEventListener('keydown', (event) => {
      if (presses(event) && !event.repeat) this.press(move, true);
    });
    button.addEventListener('keyup', (event) => presses(event) && this.press(move, false));
    for (const end of ['lostpointercapture', 'blur']) button.addEventListener(end, () => this.press(move, false));
  }

  #listenToKeys() {
    const moveOf = (event) => KEYS[event.key?.toLowerCase()];    // autofill has no key
    const typing = (event) => event.target.closest('input:not([type=checkbox]), select') || event.ctrlKey
      || event.metaKey || event.altKey;
    window.addEventListener('keydown', (event) => {
      if (typing(event)) return;
      const move = moveOf(event);
      if (move && !event.repeat) this.press(move, true);
      if (this.moves.has(move)) event.preventDefault();   // arrows scroll otherwise
      if (event.key === 'Escape') this.release();
    });
    window.addEventListener('keyup', (event) => {
      const move = moveOf(event);
      if (move && this.moves.has(move)) this.press(move, false);
    });
  }
}
