// How numbers are written for people.

export const millimetres = (metres) => `${fixed(metres * 1e3)} mm`;
export const newtons = (value) => `${fixed(value)} N`;
export const milliseconds = (seconds) => `${fixed(seconds * 1e3)} ms`;

/** About three significant digits, without exponents for the usual sizes. */
export function fixed(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e6) return value.toExponential(1);
  if (size >= 100) return value.toFixed(0);
  if (size >= 10) return value.toFixed(1);
  return value.toFixed(2).replace('-0.00', '0.00');
}

/** The value as a person would type it: three significant digits, nothing superfluous. */
export const typed = (value) => String(Number(value.toPrecision(4)));

/** Magnitude of the three components of `vector` that begin at `first`. */
export const magnitude = (vector, first = 0) =>
  vector ? Math.hypot(vector[first], vector[first + 1], vector[first + 2]) : 0;

/** The least of 1, 2, 5, 10, 20, 50 … that is not below `value`. */
export function niceAbove(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [1, 2, 5, 10].find((step) => step * decade >= value * 0.999999);
}
