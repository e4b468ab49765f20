// The client library's C interface (haptic.h) in JavaScript.
//
//   const touch = new Session({ server: '127.0.0.1:47800', rate: 60 });
//   while (running) {
//     const state = touch.poll();              // move the tool towards state.q
//     step(period);                            // your engine
//     touch.sample(q, v, period);              // where the tool is now
//     touch.send(contacts, bodies);
//   }
//   touch.close();
//
// With server: null one is started where none listens; touch.ownServer says so, touch.hold() is its hand. The library is
// libhaptic.so.5, or what HAPTIC_LIBRARY names. Fields are those of haptic.h.
import koffi from 'koffi';

const ABI = 5;
const MAX_ERROR = 512;
export const MAX_CONTACTS = 192;
export const MAX_BODIES = 16;
export const MAX_POSES = 64;
export const Side = { WORLD: 0, TOOL_LINK: 1, MOVABLE_BODY: 2 };
export const Roundness = { NONE: 0, AXIS: 1, SPHERE: 2 };
export const FrictionRule = { AVERAGE: 0, MINIMUM: 1, PRODUCT: 2, MAXIMUM: 3 };
export const ShapeKind = {
  SPHERE: 0, CAPSULE: 1, CYLINDER: 2, BOX: 3, ELLIPSOID: 4, HULL: 5, HALF_SPACE: 6, MESH: 7,
};

const doubles = (count) => koffi.array('double', count);

koffi.struct('haptic_link', {
  parent: 'int32_t', joint: 'int32_t', position: doubles(3), rotation: doubles(4), axis: doubles(3), mass: 'double',
  centre: doubles(3), inertia: doubles(9), lower: 'double', upper: 'double',
});
koffi.struct('haptic_options', {
  server: 'const char*', key_file: 'const char*', links: 'haptic_link*', link_count: 'size_t', hand_link: 'int32_t',
  hand_position: doubles(3), hand_rotation: doubles(4), gravity: doubles(3), length: 'double', q: doubles(17),
  rate: 'double', epsilon: 'double', clears_fault: 'int32_t', made_of_defaults: 'uint32_t', curves: 'void*',
  curve_count: 'size_t',
});
koffi.struct('haptic_contact', {
  identity: 'uint64_t', pair: 'uint32_t', axis: 'uint16_t', a_kind: 'uint8_t', b_kind: 'uint8_t', a_index: 'uint32_t',
  b_index: 'uint32_t', point: doubles(3), normal: doubles(3), separation: 'double', velocity: doubles(3),
  friction: 'double', load: 'double', plane: 'uint32_t',
});
koffi.struct('haptic_body', {
  id: 'uint32_t', round: 'uint32_t', centre: doubles(3), velocity: doubles(6), inverse_inertia: doubles(36),
  acceleration: doubles(6), axis: doubles(3),
});
koffi.struct('haptic_impulse', { body: 'uint32_t', reserved: 'uint32_t', impulse: doubles(6) });
koffi.struct('haptic_state', {
  connected: 'int32_t', began: 'int32_t', lost: 'int32_t', fresh: 'int32_t', step: 'uint64_t', acknowledged: 'uint64_t',
  q_count: 'int32_t', v_count: 'int32_t', q: doubles(17), v: doubles(16), contact_wrench: doubles(6),
  command: doubles(6), device_position: doubles(3), device_rotation: doubles(4), server: 'int32_t', active: 'int32_t',
  predicted: 'int32_t', buttons: 'uint32_t', scene: 'int32_t', holds: 'int32_t', gripper: 'double', grip: 'double',
  round_trip: 'double', servo_rate: 'double',
  message: koffi.array('char', 240, 'String'),
});
koffi.struct('haptic_shape', {
  kind: 'int32_t', side: 'int32_t', index: 'uint32_t', group: 'uint32_t', mask: 'uint32_t', vertex_count: 'uint32_t',
  size: doubles(3), vertices: 'double*', triangles: 'uint32_t*', triangle_count: 'size_t',
});
koffi.struct('haptic_pose', { position: doubles(3), rotation: doubles(4) });
koffi.struct('haptic_material', { friction: 'double', rule: 'int32_t', priority: 'int32_t' });
koffi.struct('haptic_body_pose', { body: 'uint32_t', kept: 'uint32_t', pose: 'haptic_pose', velocity: doubles(6) });
koffi.struct('haptic_dynamics', {
  body: 'uint32_t', joint: 'int32_t', mass: 'double', centre: doubles(3), inertia: doubles(9), gravity: doubles(3),
  damping: 'double', angular_damping: 'double', parent: 'uint32_t', reserved: 'uint32_t', in_parent: 'haptic_pose',
  in_body: 'haptic_pose', axis: doubles(3), lower: 'double', upper: 'double', stiffness: 'double', reference: 'double',
  joint_damping: 'double', friction: 'double', armature: 'double',
});
koffi.struct('haptic_held_body', {
  body: 'uint32_t', let_go: 'uint32_t', pose: 'haptic_pose', velocity: doubles(6), q: 'double', v: 'double',
});
koffi.opaque('haptic_session');

function find() {
  const name = process.env.HAPTIC_LIBRARY ?? `libhaptic.so.${ABI}`;
  try {
    return koffi.load(name);
  } catch (error) {
    throw new Error(`${name}: ${error.message}; HAPTIC_LIBRARY must name libhaptic.so.${ABI} where it is not found`);
  }
}

function load() {
  const library = find();
  const abi = library.func('int haptic_abi()')();
  if (abi !== ABI) throw new Error(`libhaptic.so has the interface ${abi}, this file is for ${ABI}`);
  return {
    defaultOptions: library.func('haptic_options haptic_default_options()'),
    box: library.func('haptic_link haptic_box(double mass, const double* size)'),
    open: library.func('haptic_session* haptic_open(const haptic_options* options, _Out_ char* error, size_t size)'),
    show: library.func('const char* haptic_show(haptic_session* session, uint16_t port, int open)'),
    ownServer: library.func('const char* haptic_own_server(const haptic_session* session)'),
    close: library.func('void haptic_close(haptic_session* session)'),
    poll: library.func('void haptic_poll(haptic_session* session, _Inout_ haptic_state* state)'),
    takeImpulses: library.func(
      'size_t haptic_take_impulses(haptic_session* session, double period, _Out_ haptic_impulse* impulses)'),
    takeSteps: library.func('int haptic_take_steps(haptic_session* session, double step)'),
    toolPushes: library.func('int haptic_tool_pushes(haptic_session* session)'),
    sample: library.func(
      'int haptic_sample(haptic_session* session, const double* q, const double* v, double period)'),
    track: library.func('void haptic_track(haptic_session* session, _Inout_ haptic_contact* contacts, size_t count, ' +
      'const haptic_body* bodies, size_t body_count)'),
    send: library.func('int64_t haptic_send(haptic_session* session, const haptic_contact* contacts, size_t count, ' +
      'const haptic_body* bodies, size_t body_count)'),
    offer: library.func('int haptic_offer(haptic_session* session, const haptic_shape* shapes, const haptic_pose* poses, ' +
      'const haptic_material* materials, size_t count, const uint32_t* excluded, size_t excluded_count, ' +
      'const haptic_dynamics* dynamics, size_t dynamics_count)'),
    takeHeld: library.func('size_t haptic_take_held(haptic_session* session, _Out_ haptic_held_body* bodies)'),
    place: library.func('int haptic_place(haptic_session* session, const haptic_body_pose* bodies, size_t count)'),
    hold: library.func('int haptic_hold(haptic_session* session, const double* position, const double* rotation)'),
    release: library.func('void haptic_release(haptic_session* session)'),
    error: library.func('const char* haptic_error(const haptic_session* session)'),
  };
}

let loaded;
const library = () => (loaded ??= load());

/** Of shapes { kind, side, … } with `vertices` and `triangles` as flat lists. */
const shapesOf = (shapes) => shapes.map(({ vertices = [], triangles = [], ...shape }) => ({
  index: 0, group: 1, mask: 1, size: [0, 0, 0], ...shape, vertices: Float64Array.from(vertices),
  vertex_count: vertices.length / 3, triangles: Uint32Array.from(triangles), triangle_count: triangles.length / 3,
}));

/** A solid box of that mass (kg) and those edge lengths (m) as a link, free: a start for your own. */
export function box(mass, size) {
  return library().box(mass, size);
}

export class Session {
  #handle;
  #state = {}; // What a poll without news leaves as it is.
  #impulses = Array.from({ length: MAX_BODIES }, () => ({}));
  #held = Array.from({ length: MAX_POSES }, () => ({}));

  /** `options`: fields of haptic_options that are not its default, with `links` an array. Throws where one cannot be
   * used. */
  constructor({ links = [], q = [], ...options }) {
    const all = { ...library().defaultOptions(), ...options };
    if (links.length > 0) Object.assign(all, { links, link_count: links.length });
    all.q = Float64Array.from({ length: 17 }, (_, i) => q[i] ?? all.q[i]);
    const error = ['\0'.repeat(MAX_ERROR)];
    this.#handle = library().open(all, error, MAX_ERROR);
    if (!this.#handle) throw new Error(error[0]);
  }

  /** A sentence on the server that this session started; empty if it started none. */
  get ownServer() {
    return library().ownServer(this.#session);
  }

  /** Serves the page of this session to browsers of this machine; the mouse is the hand of a simulated device. Returns its
   * address. */
  show(port = 0, open = true) {
    const address = library().show(this.#session, port, open ? 1 : 0);
    if (!address) throw new Error(library().error(this.#session));
    return address;
  }

  /** Once per step, before it: the newest news of the server, as haptic_state. */
  poll() {
    library().poll(this.#session, this.#state);
    return this.#state;
  }

  /** For an engine in real time: how many of its steps, of `step` seconds, are due in the frame that begins. After
   * poll(). With 0 there is nothing to do in this one. */
  takeSteps(step) {
    const steps = library().takeSteps(this.#session, step);
    if (steps < 0) this.#fail();
    return steps;
  }

  /** Whether the tool itself pushes what it touches in this frame. */
  toolPushes() {
    return library().toolPushes(this.#session) !== 0;
  }

  /** Before each step: the bodies that the hand holds, as haptic_held_body, to be put there; and once more each that it has
   * let go of. */
  takeHeld() {
    const count = library().takeHeld(this.#session, this.#held);
    return this.#held.slice(0, Number(count));
  }

  /** For a step of `period` seconds that begins: a list of { body, impulse }. */
  takeImpulses(period) {
    const count = library().takeImpulses(this.#session, period, this.#impulses);
    return this.#impulses.slice(0, Number(count));
  }

  /** After a step: where the tool is, for which contacts are found. */
  sample(q, v, period) {
    if (library().sample(this.#session, Float64Array.from(q), Float64Array.from(v), period) !== 0) this.#fail();
  }

  /** Gives contacts lasting identities where the engine has none. After sample(), once per step. */
  track(contacts, bodies = []) {
    const tracked = [...contacts]; // Koffi puts new objects into it.
    library().track(this.#session, tracked, tracked.length, bodies, bodies.length);
    tracked.forEach(({ identity }, i) => { contacts[i].identity = identity; });
  }

  /** Gives the server all shapes, fields of haptic_shape each, at these poses in the frames of their bodies, { position,
   * rotation }, with these materials, { friction, rule, priority }: state.scene is 1 once it finds their contacts itself. `excluded`:
   * pairs of places that never touch. `dynamics`: of bodies that the server may move, fields of haptic_dynamics. Again where
   * one comes, goes or changes. Throws where one cannot be used. */
  offer(shapes, poses, materials, excluded = [], dynamics = []) {
    const pairs = Uint32Array.from(excluded.flat());
    if (library().offer(this.#session, shapesOf(shapes), poses, materials, shapes.length, pairs, excluded.length, dynamics,
      dynamics.length) !== 0) {
      this.#fail();
    }
  }

  /** Where the bodies of offered shapes are, for the next send(): a list of { body, pose, velocity }, at most MAX_POSES. */
  place(bodies) {
    if (library().place(this.#session, bodies, bodies.length) !== 0) this.#fail();
  }

  /** Sends what is near. Returns the update's sequence, 0 without a session. */
  send(contacts, bodies = []) {
    const sequence = Number(library().send(this.#session, contacts, contacts.length, bodies, bodies.length));
    if (sequence < 0) this.#fail();
    return sequence;
  }

  /** The hand of a simulated device draws the handle there (m; w, x, y, z), until release(). */
  hold(position, rotation = [1, 0, 0, 0]) {
    if (library().hold(this.#session, position, rotation) !== 0) this.#fail();
  }

  release() {
    library().release(this.#session);
  }

  /** Says goodbye. What follows throws. */
  close() {
    library().close(this.#handle);
    this.#handle = null;
  }

  get #session() {
    if (!this.#handle) throw new Error('the session is closed');
    return this.#handle;
  }

  #fail() {
    throw new Error(library().error(this.#session));
  }
}
