// What every servo tick of the last 60 s was: a ring of float32 columns, addressed by step.

export const TICK_WIDTH = 16;

// The columns of a tick as it comes, then what only frames carry, noted with each tick.
export const COLUMN_NAMES = [
  'F_env_N', 'F_command_N', 'F_hand_N', 'command_torque_Nm', 'smallest_separation_m',
  'device_proxy_m', 'proxy_tool_m', 'lateness_s', 'execution_of_tick_before_s', 'contacts_age_s',
  'active', 'predicted', 'F_env_x_N', 'F_env_y_N', 'F_env_z_N', 'adopted', 'round_trip_s',
];

export class TickStore {
  constructor(rate, seconds = 60) {
    this.rate = rate;
    this.capacity = Math.round(rate * seconds);
    this.columns = COLUMN_NAMES.map(() => new Float32Array(this.capacity));
    this.received = 0;
    this.lost = 0;
    this.oldest = 0;      // first step kept
    this.next = 0;        // step after the newest
    this.expecting = false;
  }

  get lastStep() {
    return this.next - 1;
  }

  /** After a break that is nobody's fault: the next step may be any. */
  expectAnything() {
    this.expecting = false;
  }

  /** Takes the rows of one packet; steps that never came are left as NaN. */
  append(firstStep, rows, roundTrip) {
    this.#skipTo(firstStep);
    const count = rows.length / TICK_WIDTH;
    for (let column = 0; column < TICK_WIDTH; ++column) {
      const values = this.columns[column];
      for (let i = 0, at = firstStep % this.capacity; i < count; ++i) {
        values[at] = rows[i * TICK_WIDTH + column];
        if (++at === this.capacity) at = 0;
      }
    }
    this.#fill(this.columns[TICK_WIDTH], firstStep, firstStep + count, roundTrip);
    this.received += count;
    this.#advance(firstStep + count);
  }

  at(column, step) {
    return step >= this.oldest && step < this.next
      ? this.columns[column][step % this.capacity] : NaN;
  }

  /** The kept values of the column of that name, oldest first; NaN where ticks were lost. */
  valuesOf(name) {
    const column = COLUMN_NAMES.indexOf(name);
    return Array.from({ length: this.next - this.oldest }, (_, i) => this.at(column, this.oldest + i));
  }

  /** A copy that no later tick overwrites. */
  snapshot() {
    const copy = Object.create(TickStore.prototype);
    return Object.assign(copy, this, { columns: this.columns.map((values) => values.slice()) });
  }

  #skipTo(step) {
    const gap = step - this.next;
    if (gap > 0 && this.expecting) this.lost += gap;
    this.expecting = true;
    if (gap < 0 || gap >= this.capacity || this.next === this.oldest) {
      this.oldest = this.next = step;
    } else if (gap > 0) {
      for (const values of this.columns) this.#fill(values, this.next, step, NaN);
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
  const parts = [`step,time_s,${COLUMN_NAMES.join(',')}\n`];
  const write = (value) => (Number.isNaN(value) ? '' : Number(value.toPrecision(7)));
  for (let from = store.oldest; from < store.next; from += 2000) {
    const lines = [];
    for (let step = from; step < Math.min(from + 2000, store.next); ++step) {
      const row = store.columns.map((values) => values[step % store.capacity]);
      if (Number.isNaN(row[0])) continue;  // lost
      lines.push(`${step},${(step / store.rate).toFixed(6)},${row.map(write).join(',')}\n`);
    }
    parts.push(lines.join(''));
    await new Promise((resolve) => setTimeout(resolve));
  }
  return parts;
}
