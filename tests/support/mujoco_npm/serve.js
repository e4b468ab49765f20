// MuJoCo's official JavaScript binding for mujoco_npm.py: one request after the other on stdin, each with one reply on
// stdout. Both are the length of a JSON text, four bytes, little-endian, that text, and `bytes` bytes of arrays.
// Usage: node serve.js PACKAGE
import fs from "node:fs";

const { default: load } = await import(process.argv[2]);
const say = (text) => fs.writeSync(2, text + "\n");
const mujoco = await load({ print: say, printErr: say });
const things = []; // models and data, by the number that the other side has of them

function receive(size) {
  const bytes = Buffer.alloc(size);
  for (let at = 0; at < size; ) {
    const count = fs.readSync(0, bytes, at, size - at);
    if (count === 0) process.exit(0);
    at += count;
  }
  return bytes;
}

function send(header, arrays = []) {
  const payload = arrays.map((array) => new Uint8Array(array.buffer, array.byteOffset, array.byteLength));
  const bytes = payload.reduce((sum, part) => sum + part.length, 0);
  const text = Buffer.from(JSON.stringify({ ...header, bytes }));
  const length = Buffer.alloc(4);
  length.writeUInt32LE(text.length);
  const all = Buffer.concat([length, text, ...payload]);
  for (let at = 0; at < all.length; ) at += fs.writeSync(1, all, at);
}

function field([thing, ...path]) {
  return path.reduce((value, name) => value[name], things[thing]);
}

// Before a call what was written there, [[thing, name], ...], and after it all that is watched.
function write(fields, bytes) {
  let at = 0;
  for (const path of fields) {
    const array = field(path);
    const target = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    target.set(bytes.subarray(at, at + target.length));
    at += target.length;
  }
}

const number = (thing) => things.push(thing) - 1;
const operations = {
  version: () => send({ value: mujoco.mj_versionString() }),
  model: ({ xml, done_with }) => {
    done_with.forEach((each) => things[each].delete());
    send({ value: number(mujoco.MjModel.from_xml_string(xml)) });
  },
  data: ({ model }) => send({ value: number(new mujoco.MjData(things[model])) }),
  name2id: ({ model, kind, name }) => send({ value: mujoco.mj_name2id(things[model], kind, name) }),
  read: ({ path }) => {
    const value = field(path);
    if (ArrayBuffer.isView(value)) send({ type: value.constructor.name }, [value]);
    else send({ value: value === undefined ? null : value });
  },
  set: ({ path, value }) => {
    field(path.slice(0, -1))[path.at(-1)] = value;
    send({});
  },
  // `args` are numbers, lists of numbers, and {out: n} for n numbers that the function writes.
  call: ({ name, model, data, args, times, written, watched }, bytes) => {
    write(written, bytes);
    const outs = [];
    const given = args.map((arg) => {
      if (arg.out === undefined) return arg;
      outs.push(new mujoco.DoubleBuffer(arg.out));
      return outs.at(-1);
    });
    for (let i = 0; i < times; ++i) mujoco[name](things[model], things[data], ...given);
    send({}, [...watched.map(field), ...outs.map((out) => out.GetView())]);
    outs.forEach((out) => out.delete());
  },
  contacts: ({ data }) => {
    const listed = things[data].contact;
    const rows = [];
    for (let i = 0; i < listed.size(); ++i) {
      const c = listed.get(i);
      rows.push(c.dist, ...c.pos, ...c.frame, ...c.friction, c.dim, c.geom1, c.geom2, c.efc_address);
      c.delete();
    }
    listed.delete();
    send({}, [new Float64Array(rows)]);
  },
};

for (;;) {
  const request = JSON.parse(receive(receive(4).readUInt32LE()));
  const bytes = receive(request.bytes);
  try {
    operations[request.operation](request, bytes);
  } catch (error) {
    send({ error: String(error.message ?? error) });
  }
}
