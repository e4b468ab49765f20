// What the force sounds like: a hum that grows with F_env, for a hand that feels nothing.

const FULL_FORCE = 8;    // N
const LOUDEST = 0.12;

export class Sound {
  /** `pan`: from -1, the left ear, to 1. */
  constructor(pan = 0) {
    this.pan = pan;
  }

  setOn(on) {
    if (on && !this.context) this.#start();
    if (on) this.context.resume();
    else this.context?.suspend();
  }

  /** `force` in N; `colliding` adds brightness. */
  update(force, colliding) {
    if (this.context?.state !== 'running') return;
    const loudness = Math.min(1, force / FULL_FORCE);
    const now = this.context.currentTime;
    this.gain.gain.setTargetAtTime(LOUDEST * Math.sqrt(loudness), now, 0.02);
    this.tone.frequency.setTargetAtTime(90 + 220 * loudness + (colliding ? 120 : 0), now, 0.02);
  }

  #start() {
    this.context = new AudioContext();
    this.gain = new GainNode(this.context, { gain: 0 });
    this.tone = new OscillatorNode(this.context, { type: 'triangle', frequency: 90 });
    const place = new StereoPannerNode(this.context, { pan: this.pan });
    this.tone.connect(this.gain).connect(place).connect(this.context.destination);
    this.tone.start();
  }
}
