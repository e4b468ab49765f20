// Which points to draw of thousands of ticks: least and greatest of each pixel column, so that a
// peak of one tick stays visible.

/** uPlot's data ([x, y, y, …], null for gaps) of the steps [from, to) for about `pixels` columns.
 *  `series`: [{column, scale, floor}], the column's name, its factor and its least value, if any. */
export function decimate(store, series, from, to, pixels) {
  const bucket = Math.max(1, Math.ceil((to - from) / pixels));
  const begin = Math.max(store.oldest, Math.floor(from / bucket) * bucket);
  const end = Math.min(store.next, to);
  if (bucket === 1) return everyTick(store, series, begin, end);
  const xs = [];
  for (let step = begin; step < end;) {
    const stop = Math.min(bucketEnd(step, bucket), end);
    xs.push(step / store.rate, (step + stop) / 2 / store.rate);
    step = stop;
  }
  return [xs, ...series.map((one) => extremes(store, one, begin, end, bucket))];
}

const bucketEnd = (step, bucket) => (Math.floor(step / bucket) + 1) * bucket;

function everyTick(store, series, begin, end) {
  const xs = [];
  for (let step = begin; step < end; ++step) xs.push(step / store.rate);
  const ys = series.map((one) => xs.map((_, i) => shown(store.at(one.column, begin + i), one)));
  return [xs, ...ys];
}

/** Two values per bucket, in the order in which they occurred. */
function extremes(store, one, begin, end, bucket) {
  const values = store.columns.get(one.column);
  const out = [];
  for (let step = begin; step < end;) {
    let least = Infinity, greatest = -Infinity, leastAt = 0, greatestAt = 0;
    const stop = Math.min(bucketEnd(step, bucket), end);
    for (let at = step % store.capacity; step < stop; ++step) {
      const value = values?.[at];
      if (value < least) { least = value; leastAt = step; }
      if (value > greatest) { greatest = value; greatestAt = step; }
      if (++at === store.capacity) at = 0;
    }
    if (least === Infinity) out.push(null, null);
    else if (leastAt <= greatestAt) out.push(shown(least, one), shown(greatest, one));
    else out.push(shown(greatest, one), shown(least, one));
  }
  return out;
}

function shown(value, one) {
  if (Number.isNaN(value)) return null;
  const scaled = value * one.scale;
  return one.floor === undefined ? scaled : Math.max(scaled, one.floor);
}
