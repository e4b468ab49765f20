// Units: what people type and read, and the SI values that are sent.

// What one of each other unit is worth, by SI unit.
const WORTH = {
  '': { '': 1, '%': 1e-2 },
  m: { m: 1, cm: 1e-2, mm: 1e-3, 'µm': 1e-6 },
  s: { s: 1, ms: 1e-3, 'µs': 1e-6 },
  N: { N: 1, mN: 1e-3 },
  'N·m': { 'N·m': 1, 'mN·m': 1e-3 },
  Hz: { Hz: 1, kHz: 1e3 },
  'N/m': { 'N/m': 1, 'N/mm': 1e3, 'kN/m': 1e3 },
  'N·s/m': { 'N·s/m': 1 },
  'N·m/rad': { 'N·m/rad': 1, 'mN·m/rad': 1e-3 },
  'N·m·s/rad': { 'N·m·s/rad': 1, 'mN·m·s/rad': 1e-3 },
};

/** A value in SI units, in the unit `shown`. */
export const fromSi = (value, si, shown) => value / worth(shown, si);

/** How many of the unit `shown` one of the SI unit is. */
export const scaleOf = (si, shown) => 1 / worth(shown, si);

/** What was typed, in SI units; a number without a unit is in `shown`. NaN if it cannot be read. */
export function parseQuantity(text, si, shown) {
  const [, digits, unit] = text.trim().match(/^([-+]?[\d.,]+(?:e[-+]?\d+)?)(.*)$/i) ?? [];
  if (digits === undefined) return NaN;
  const known = Object.keys(WORTH[si] ?? {}).find((name) => bare(name) === bare(unit));
  const factor = bare(unit) === '' ? worth(shown, si) : worth(known, si);
  // Without the last binary digits, so that "5 mm" is exactly 0.005 m.
  return Number((Number(digits.replace(',', '.')) * factor).toPrecision(12));
}

const worth = (unit, si) => (unit === si ? 1 : WORTH[si]?.[unit] ?? NaN);

/** A unit as units are compared: "N s/m" and "N·s/m" are the same, so are "us" and "µs". */
const bare = (unit) => unit.replace(/[\s·*]/g, '').replace(/^[uμ](?=[ms])/, 'µ');
