// What the force of one side was like in the last seconds: the figures, and the running plot.

import { decimate } from './decimate.js';
import { colorsOf, penOf } from './contrast_view.js';

export const FORCE = 'F_command';   // what the device was given, N
const WINDOW = 1;                   // s, of force and change
const SHAKE_SECONDS = 2;
export const SWING = 1;                    // N: a smaller turn back does not count
const PLOT_SECONDS = 3;
const FULL = 12.8;                  // N, the limit of force and a little more
const MARGIN = 34;                  // pixels, for the scale's numbers

/** {now, change, deviation, swings} of the latest ticks: the force of the last tenth of a second (N), its greatest less its
 *  least and its standard deviation in the last second (N), and how often it turned back by more than SWING in two. Null
 *  until there is a second of ticks. */
export function figures(store) {
  const last = valuesOf(store, WINDOW);
  if (last.length < 0.8 * WINDOW * store.rate) return null;
  const mean = meanOf(last);
  return {
    now: meanOf(last.slice(-Math.round(store.rate / 10))),
    change: last.reduce((a, b) => Math.max(a, b)) - last.reduce((a, b) => Math.min(a, b)),
    deviation: Math.sqrt(meanOf(last.map((value) => (value - mean) ** 2))),
    swings: countSwings(valuesOf(store, SHAKE_SECONDS)),
  };
}

function valuesOf(store, seconds) {
  const values = [];
  for (let step = Math.max(store.oldest, store.next - seconds * store.rate); step < store.next; ++step) {
    const value = store.at(FORCE, step);
    if (!Number.isNaN(value)) values.push(value);
  }
  return values;
}

const meanOf = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function countSwings(values) {
  let count = 0, rising = null, least = values[0], greatest = values[0];
  for (const value of values) {
    least = Math.min(least, value);
    greatest = Math.max(greatest, value);
    const rises = value - least > SWING, falls = greatest - value > SWING;
    if (!(rises && rising !== true) && !(falls && rising !== false)) continue;
    if (rising !== null) ++count;
    rising = rises && rising !== true;
    least = greatest = value;
  }
  return count;
}

/** The running plot: least and greatest of each column, so that nothing is smoothed away. */
export class Plot {
  constructor(canvas) {
    this.canvas = canvas;
    this.drawnTo = -1;
    new ResizeObserver(() => this.#resize()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.#resize());
    this.#resize();
  }

  draw(store, shakes) {
    if (store.next === this.drawnTo || !this.pen) return;
    this.drawnTo = store.next;
    const { pen, colors, canvas } = this;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const to = store.next, from = to - PLOT_SECONDS * store.rate;
    const x = (seconds) => MARGIN + ((seconds * store.rate - from) / (to - from)) * (width - MARGIN);
    const y = (force) => height * (1 - force / FULL);
    pen.setTransform(this.dots, 0, 0, this.dots, 0, 0);
    pen.clearRect(0, 0, width, height);
    for (const level of [6, 12]) this.#drawLevel(level, y(level), width);
    const [times, values] = decimate(store, [{ column: FORCE, scale: 1 }], from, to, width / 2);
    pen.strokeStyle = shakes ? colors.bad : colors.good;
    pen.lineWidth = 1.8;
    pen.lineJoin = 'round';
    pen.beginPath();
    values.forEach((value, i) => { if (value !== null) pen.lineTo(x(times[i]), Math.min(height - 1, y(value))); });
    pen.stroke();
  }

  #drawLevel(level, y, width) {
    const { pen, colors } = this;
    pen.fillStyle = colors.line;
    pen.fillRect(MARGIN, y, width - MARGIN, 1);
    pen.fillStyle = colors.dim;
    pen.font = '11px system-ui, sans-serif';
    pen.textBaseline = 'middle';
    pen.fillText(`${level} N`, 4, Math.max(6, y));
  }

  #resize() {
    if (!this.canvas.clientWidth || !this.canvas.clientHeight) return;
    [this.pen, this.dots] = penOf(this.canvas);
    this.colors = colorsOf(this.canvas);
    this.drawnTo = -1;
  }
}
