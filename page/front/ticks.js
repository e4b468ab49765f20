// What every servo tick of the last 60 s was: a ring of float32 columns by name, addressed by step. Steps
// count on from session to session.

// What only frames carry, noted with each tick.
const BREAK_SECONDS = 0.1;   // between two sessions
const ROUND_TRIP = { name: 'round_trip', unit: 's' };

export class TickStore {
  /** `columns`: [{name, unit}] of a tick as it arrives. */
  constructor(rate, columns, seconds = 60) {
    this.rate = rate;
    this.capacity = Math.round(rate * seconds);
    this.arriving = columns.map(({ name }) => name);
    this.schema = [...columns, ROUND_TRIP];
    this.columns = new Map(this.schema.map(({ name }) => [name, new Float32Array(this.capacity)]));
    this.received = 0;
    this.lost = 0;
    this.oldest = 0;      // first step kept
    this.next = 0;        // step after the latest
    this.expecting = false;
    this.session = '';    // name of the present one
    this.begin = 0;       // its step 0
    this.marks = [];      // [step, name] where one began after another
  }

  get lastStep() {
    return this.next - 1;
  }

  /** SI unit of a column; '' for numbers without one. */
  unitOf(name) {
    return this.schema.find((column) => column.name === name)?.unit ?? '';
  }

  /** After a break that is nobody's fault: the next step may be any. */
  expectAnything() {
    this.expecting = false;
  }

  /** Takes `count` rows of consecutive steps; steps that never came are left as NaN. */
  append(stepOfSession, count, rows, roundTrip) {
    const width = this.arriving.length;
    if (rows.length !== count * width) return;
    if (this.begin + stepOfSession < this.next) this.#beginSession(stepOfSession);
    const firstStep = this.begin + stepOfSession;
    this.#skipTo(firstStep);
    this.arriving.forEach((name, column) => {
      const values = this.columns.get(name);
      for (let i = 0, at = firstStep % this.capacity; i < count; ++i) {
        values[at] = rows[i * width + column];
        if (++at === this.capacity) at = 0;
      }
    });
    this.#fill(this.columns.get(ROUND_TRIP.name), firstStep, firstStep + count, roundTrip);
    this.received += count;
    this.#advance(firstStep + count);
  }

  /** NaN where there is no such step, or no such column. */
  at(name, step) {
    return step >= this.oldest && step < this.next
      ? this.columns.get(name)?.[step % this.capacity] ?? NaN : NaN;
  }

  /** The kept values of a column, oldest first; NaN where ticks were lost. */
  valuesOf(name) {
    return Array.from({ length: this.next - this.oldest }, (_, i) => this.at(name, this.oldest + i));
  }

  /** A copy that no later tick overwrites. */
  snapshot() {
    const copies = [...this.columns].map(([name, values]) => [name, values.slice()]);
    return Object.assign(Object.create(TickStore.prototype), this, { columns: new Map(copies) });
  }

  #beginSession(firstStep) {
    const mark = this.next + Math.round(BREAK_SECONDS * this.rate);
    this.begin = mark - firstStep;
    this.expecting = false;
    this.marks = this.marks.filter(([step]) => step >= this.oldest).concat([[mark, this.session]]);
  }

  #skipTo(step) {
    const gap = step - this.next;
    if (gap > 0 && this.expecting) this.lost += gap;
    this.expecting = true;
    if (gap >= this.capacity || this.next === this.oldest) {
      this.oldest = this.next = step;
    } else if (gap > 0) {
      for (const values of this.columns.values()) this.#fill(values, this.next, step, NaN);
      this.#advance(step);
    }
  }

  #fill(values, from, to, value) {
    for (let step = from; step < to; ++step) values[step % this.capacity] = value;
  }

  #advance(next) {
    this.next = next;
    this.oldest = Math.max(this.oldest, next - this.capacity);
  }
}

/** All ticks of `store` as CSV, in parts for a Blob; lets the page breathe between parts. */
export async function csvParts(store) {
  const heading = ({ name, unit }) => (unit ? `${name}_${unit.replaceAll('·', '')}` : name);
  const parts = [`step,time_s,${store.schema.map(heading).join(',')}\n`];
  const write = (value) => (Number.isNaN(value) ? '' : Number(value.toPrecision(7)));
  for (let from = store.oldest; from < store.next; from += 2000) {
    const lines = [];
    for (let step = from; step < Math.min(from + 2000, store.next); ++step) {
      const row = [...store.columns.values()].map((values) => values[step % store.capacity]);
      if (row.every(Number.isNaN)) continue;  // lost
      lines.push(`${step},${(step / store.rate).toFixed(6)},${row.map(write).join(',')}\n`);
    }
    parts.push(lines.join(''));
    await new Promise((resolve) => setTimeout(resolve));
  }
  return parts;
}
