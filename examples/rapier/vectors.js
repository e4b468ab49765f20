// Vectors as [x, y, z] from Rapier's {x, y, z}, turned by Rapier's quaternions.

export const list = ({ x, y, z }) => [x, y, z];
export const object = ([x, y, z]) => ({ x, y, z });
export const add = (a, b) => a.map((x, i) => x + b[i]);
export const subtract = (a, b) => a.map((x, i) => x - b[i]);
export const scale = (k, a) => a.map((x) => k * x);
export const cross = (a, b) =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

export function rotate({ x, y, z, w }, v) {
  const turn = scale(2, cross([x, y, z], v));
  return add(add(v, scale(w, turn)), cross([x, y, z], turn));
}
