// What is being waited for: the connection, the first world, a chosen scene.

import { write } from './display.js';

const FAILURE_MS = 15000;
const COUNTED_MS = 2000;    // from then on the seconds are counted

export class Loading {
  /** `box` has a sentence and a count of seconds in it. */
  constructor(box) {
    this.box = box;
    [this.sentence, this.count] = box.children;
    this.chosen = null;      // the scene that was asked for last and has not come
    this.earlier = [];       // those before it that may still come
    this.failure = null;
    this.lost = false;       // a connection that there was
    this.world = null;
    this.since = performance.now();
  }

  /** Another scene was asked for. */
  choose(scene) {
    this.failure = null;
    if (scene !== this.chosen) this.since = performance.now();
    if (this.chosen !== null) this.earlier.push(this.chosen);
    this.chosen = scene;
  }

  /** A `world` message: the chosen scene's, or another one that somebody chose later. */
  take(world) {
    const others = world.scene !== this.world?.scene && !this.earlier.includes(world.scene);
    this.world = world;
    if (others || world.scene === this.chosen) this.#end();
  }

  /** The chosen scene will not come. */
  fail(text) {
    if (this.chosen === null) return;
    this.failure = { text: `Scene ${this.chosen} was not loaded: ${text}`, until: performance.now() + FAILURE_MS };
    this.#end();
  }

  opened() {
    this.since = performance.now();
  }

  closed() {
    this.fail('the connection was lost');
    if (this.world && !this.lost) this.since = performance.now();
    this.lost = this.world !== null;
  }

  #end() {
    this.chosen = null;
    this.earlier = [];
  }

  show(open, now = performance.now()) {
    const failure = this.failure?.until > now ? this.failure.text : null;
    const waiting = this.#waiting(open);
    const seconds = Math.floor((now - this.since) / 1000);
    write(this.sentence, waiting ?? failure ?? '');
    write(this.count, waiting && now - this.since >= COUNTED_MS ? ` ${seconds} s` : '');
    this.box.hidden = !waiting && !failure;
    this.box.classList.toggle('failed', !waiting && Boolean(failure));
  }

  #waiting(open) {
    if (!open) return this.lost ? 'The connection is lost. Trying again …' : 'Connecting …';
    if (!this.world) return 'Waiting for the world …';
    return this.chosen === null ? null : `Loading scene ${this.chosen} …`;
  }
}
