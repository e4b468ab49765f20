// What the force of the last second was like: stable, chattering or clipping.

const SECONDS = 1;
const SWING = 5;             // N; a peg that rattles in its hole makes smaller ones all the time
const QUICK = 0.08;          // s; a hand, which shakes at up to 6 Hz, turns the force back more slowly
const CHATTER_SWINGS = 6;    // in a second; a hand that knocks on walls makes up to three
const CLIPPING_SHARE = 0.02; // of the ticks; fewer are a bump
const FORCE_COLUMNS = ['F_env_x', 'F_env_y', 'F_env_z'];
const CLIPPING_LIMITS = ['force', 'torque'];

/** {kind, swings, clipped, ticks} of the latest ticks of `store`; `limits`: what the numbers of its
 *  column `limit` mean. Null without ticks. */
export function judge(store, limits) {
  const to = store.next;
  const from = Math.max(store.oldest, to - SECONDS * store.rate);
  const swings = Math.max(...FORCE_COLUMNS.map((name) => countQuickSwings(store, name, from, to)));
  let clipped = 0, ticks = 0;
  for (let step = from; step < to; ++step) {
    const limit = store.at('limit', step);
    if (Number.isNaN(limit)) continue;
    ++ticks;
    if (CLIPPING_LIMITS.includes(limits[limit])) ++clipped;
  }
  if (ticks === 0) return null;
  return { kind: kindOf(swings, clipped / ticks), swings, clipped, ticks };
}

function kindOf(swings, clippedShare) {
  if (swings >= CHATTER_SWINGS) return 'chattering';
  return clippedShare > CLIPPING_SHARE ? 'clipping' : 'stable';
}

/** How often the value turns back, after it rose or fell by more than SWING, sooner than a hand could. */
function countQuickSwings(store, name, from, to) {
  let quick = 0, rising = null, turnedAt = -Infinity, least = Infinity, greatest = -Infinity;
  for (let step = from; step < to; ++step) {
    const value = store.at(name, step);
    if (Number.isNaN(value)) continue;
    least = Math.min(least, value);
    greatest = Math.max(greatest, value);
    const rises = value - least > SWING, falls = greatest - value > SWING;
    if (!(rises && rising !== true) && !(falls && rising !== false)) continue;
    rising = rising === null ? rises : !rising;
    if (step - turnedAt < QUICK * store.rate) ++quick;
    turnedAt = step;
    least = greatest = value;
  }
  return quick;
}

/** A sentence on what is wrong with a force that reaches the hand, or null. */
export function complaintOf(verdict) {
  switch (verdict?.kind) {
    case 'chattering':
      return `it chatters: ${verdict.swings} swings of more than ${SWING} N in the last second, too quick for a hand`;
    case 'clipping':
      return `it is clipped: a limit holds in ${verdict.clipped} of the last ${verdict.ticks} ticks`;
    default:
      return null;
  }
}

export function summaryOf(verdict) {
  if (!verdict) return '';
  return `Last second: ${verdict.kind}, ${verdict.clipped} of ${verdict.ticks} ticks clipped`;
}
