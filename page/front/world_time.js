// The world's time beside the hand's: pause, a single step, slow motion.

const SLOW = 0.25, LEAST = 0.1;

export class WorldTime {
  /** `box` has the buttons pause, step and slow in it. */
  constructor(box, send) {
    Object.assign(this, { box, send, pace: 1, slow: false });
    [this.pause, this.step, this.slower] = box.querySelectorAll('button');
    this.pause.onclick = () => this.#ask(this.still ? this.#usual : 0);
    this.step.onclick = () => send({ type: 'step' });
    this.slower.onclick = () => {
      this.slow = !this.slow;
      if (!this.still) this.#ask(this.#usual);
      this.#press(this.slower, this.slow);
    };
  }

  get still() {
    return this.pace < LEAST;
  }

  get #usual() {
    return this.slow ? SLOW : 1;
  }

  #ask(pace) {
    this.send({ type: 'environment', pace });
  }

  #press(button, on) {
    button.setAttribute('aria-pressed', String(on));
  }

  /** The pace in effect; none: another engine's world. */
  show(pace) {
    this.box.hidden = pace === undefined;
    if (pace === undefined || pace === this.pace) return;
    this.pace = pace;
    if (!this.still) this.slow = pace < 1;
    this.#press(this.pause, this.still);
    this.#press(this.slower, this.slow);
    this.step.disabled = !this.still;
  }
}
