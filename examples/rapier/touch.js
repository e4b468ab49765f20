// A hand in a Rapier world. The hand's tool, a box, has no weight.
//
//   haptic_server --device-option freedom=spatial --hand HAND.toml   # in another terminal
//   node touch.js table 127.0.0.1:47800 10 60       # 10 s, 60 frames a second
//
// Scenes: table, brick, puck, tray, hole.
import RAPIER from '@dimforge/rapier3d-compat';
import { Session } from './session.js';

const STEP_RATE = 120; // Hz, of Rapier's steps, at least one in a frame
const CM = 0.01;
const PRINTED = 0.5; // s, from line to line

/** Friction of two colliders is the product of their coefficients. */
const solid = (shape, friction) =>
  shape.setFriction(friction).setFrictionCombineRule(RAPIER.CoefficientCombineRule.Multiply);

/** Of that size and at that place, cm; without mass (kg) it stands still. */
function addBox(world, size, centre, mass = 0, friction = 0.7) {
  const kind = mass > 0 ? RAPIER.RigidBodyDesc.dynamic() : RAPIER.RigidBodyDesc.fixed();
  const body = world.createRigidBody(kind.setTranslation(...centre.map((x) => x * CM)));
  const shape = RAPIER.ColliderDesc.cuboid(...size.map((x) => (x * CM) / 2));
  world.createCollider(solid(shape.setMass(mass), friction), body);
  return body;
}

/** { tool, body }: what the hand holds, and what it can move, or nothing. */
function make(name, world) {
  world.createCollider(solid(new RAPIER.ColliderDesc(new RAPIER.HalfSpace({ x: 0, y: 0, z: 1 })), 1));
  const makeTool = (size, height, friction) => {
    const tool = addBox(world, size, [0, 0, height], 0.1, friction);
    tool.setGravityScale(0, true);
    return tool;
  };
  switch (name) {
    case 'table':
      return { tool: makeTool([4, 4, 4], 3, 0.5) };
    case 'brick':
    case 'puck':
      return {
        tool: makeTool([4, 4, 3], 2, 0),
        body: addBox(world, [4, 8, 4], [8, 0, 2], 0.3, name === 'puck' ? 0 : 0.4),
      };
    case 'tray': // It comes up between two rails, on which the body lies.
      for (const y of [-7, 7]) addBox(world, [10, 2, 6], [0, y, 3]);
      return { tool: makeTool([10, 10, 1], 4.5, 0.7), body: addBox(world, [4, 14, 4], [0, 0, 8], 0.3) };
    case 'hole':
      for (const x of [-3.01, 3.01]) addBox(world, [4, 8, 6], [x, 0, 3]);
      return { tool: makeTool([2, 2, 6], 10, 0) };
    default:
      throw new Error(`scene must be table, brick, puck, tray or hole, not ${name}`);
  }
}

function sleepUntil(time) {
  const left = time - performance.now();
  if (left > 0) Atomics.wait(new Int32Array(new SharedArrayBuffer(4)), 0, 0, left);
}

function report(touch, body) {
  const place = (x, y, z) => `(${[x, y, z].map((each) => each.toFixed(4)).join(', ')}) m`;
  const { x, y, z } = body?.translation() ?? { x: 0, y: 0, z: 0 };
  console.log(`${touch.state.connected ? 'connected' : 'no server'}, tool at ${place(...touch.q.slice(0, 3))}, ` +
    `body at ${place(x, y, z)}, contacts: ${touch.state?.active ?? 0}`);
}

function simulate(name, server, seconds, rate) {
  const world = new RAPIER.World({ x: 0, y: 0, z: -9.81 });
  const { tool, body } = make(name, world);
  const period = 1 / rate;
  world.timestep = Math.min(1 / STEP_RATE, period);
  world.step(); // The first one takes 0.1 s, to be compiled.
  const touch = new Session(world, tool, { server, period });
  try {
    play(touch, world, { period, frames: Math.floor(seconds * rate) }, body);
  } finally {
    touch.close();
  }
}

function play(touch, world, { period, frames }, body) {
  const start = performance.now();
  const printed = Math.max(1, Math.floor(PRINTED / period));
  for (let frame = 1; frame <= frames; ++frame) {
    for (let steps = touch.drive(); steps > 0; --steps) world.step();
    touch.send();
    if (frame % printed === 0) report(touch, body);
    sleepUntil(start + 1000 * frame * period);
  }
}

function positive(name, text) {
  const value = Number(text);
  if (!(value > 0 && Number.isFinite(value))) throw new Error(`${name} must be a number above 0, not ${text}`);
  return value;
}

const [name = 'table', server = '127.0.0.1:47800', seconds = '10', rate = '60'] = process.argv.slice(2);
try {
  await RAPIER.init();
  simulate(name, server, positive('seconds', seconds), positive('rate', rate));
} catch (error) {
  console.error(`touch.js: ${error.message}`);
  process.exitCode = 1;
}
