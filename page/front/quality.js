// How much the picture may cost: lowered where frames take too long, raised again where they do not.

const SLOW_MS = 1000 / 32;
const QUICK_MS = 1000 / 52;
const WINDOW = 40;              // pictures that are looked at together,
const WINDOW_MS = 1000;         // or fewer in so long
const PATIENCE = 2;             // slow windows before the level is lowered: one is a hiccup
const CALM_WINDOWS = 12;        // quick ones before the next level is tried
const PAUSE_MS = 250;           // a longer wait for a picture is none of its cost: a hidden page, a new scene

/** The dearest level last. `scale`: of the pixels. */
export const LEVELS = [
  { name: 'coarse', shadows: false, scale: 0.6 },
  { name: 'plain', shadows: false, scale: 1 },
  { name: 'shadows', shadows: true, scale: 1 },
];

export class Quality {
  /** `change(level)` is called with one of LEVELS when another one is due. */
  constructor(change) {
    this.change = change;
    this.automatic = true;
    this.renew();
  }

  get level() {
    return LEVELS[this.at];
  }

  /** For another scene: the best level is tried again. */
  renew() {
    this.ceiling = LEVELS.length - 1;
    this.#go(this.ceiling);
  }

  /** Keeps to a level, by its name; without one it goes by the time again. */
  keep(name) {
    this.automatic = !name;
    if (name) this.#go(LEVELS.findIndex((level) => level.name === name));
  }

  /** A picture was due at `now`, ms, and `drawn` if anything had changed. */
  count(now, drawn) {
    const interval = now - this.last;
    this.last = now;
    if (!drawn || !(interval < PAUSE_MS)) return;
    this.sum += interval;
    if (++this.pictures < WINDOW && this.sum < WINDOW_MS) return;
    const mean = this.sum / this.pictures;
    this.sum = this.pictures = 0;
    this.slow = mean > SLOW_MS ? this.slow + 1 : 0;
    this.calm = mean < QUICK_MS ? this.calm + 1 : 0;
    if (this.automatic) this.#adapt();
  }

  #adapt() {
    if (this.slow >= PATIENCE && this.at > 0) {
      if (this.raised) this.ceiling = this.at - 1;     // It was tried, and is too dear.
      this.#go(this.at - 1);
    } else if (this.calm >= CALM_WINDOWS && this.at < this.ceiling) {
      this.#go(this.at + 1);
      this.raised = true;
    }
  }

  #go(at) {
    const changed = at !== this.at;
    this.at = at;
    this.sum = this.pictures = this.slow = this.calm = 0;
    this.raised = false;
    if (changed) this.change(this.level);
  }
}
