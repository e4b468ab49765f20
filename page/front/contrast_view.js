// The picture of one side: the floor, the stylus where the hand holds it, and the two forces at its knob. A plane
// needs no WebGL: what is drawn here is drawn alike on any machine.

import { Vector3 } from 'three';

const SHOWN = { left: -0.075, right: 0.075, top: -0.09, bottom: 0.052 };   // m, of worlds/contrast.sdf; y points down
const KNOB = [0, -0.072];          // m, in the stylus: what the hand holds
const KNOB_RADIUS = 0.011;         // m
const METRES_PER_NEWTON = 0.004;
const TRAIL = 14;                  // frames that are still seen
const PICK_PIXELS = { mouse: 30, touch: 48 };
const NARROW = 520;                // pixels: there the stylus stands beside the figures
const AXES = { right: new Vector3(1, 0, 0), up: new Vector3(0, -1, 0), away: new Vector3(0, 0, 1) };

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.world = null;
    this.frame = null;
    this.trail = [];
    this.drawn = 0;
    new ResizeObserver(() => this.#resize()).observe(canvas);
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.#resize());
    this.#resize();
  }

  setWorld(world) {
    this.world = world;
    this.trail = [];
  }

  setFrame(frame) {
    this.frame = frame;
    if (frame.device) this.trail = [...this.trail.slice(1 - TRAIL), frame.device];
    this.changed = true;
  }

  /** Whether there is a handle. */
  get live() {
    return Boolean(this.world && this.frame?.device);
  }

  /** Unit vectors of the picture in the world. */
  viewAxes() {
    return AXES;
  }

  contains(clientX, clientY) {
    const { left, top, right, bottom } = this.canvas.getBoundingClientRect();
    return clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
  }

  /** Whether a pointer there means the handle: near the line from knob to tip. */
  picks(clientX, clientY, touch) {
    if (!this.live) return false;
    const [x0, y0] = this.project(knobOf(this.frame.device)), [x1, y1] = this.project(this.frame.device);
    const along = [x1 - x0, y1 - y0], from = [clientX - x0, clientY - y0];
    const share = Math.min(1, Math.max(0, dot(along, from) / dot(along, along)));
    return Math.hypot(from[0] - share * along[0], from[1] - share * along[1]) < PICK_PIXELS[touch ? 'touch' : 'mouse'];
  }

  /** [clientX, clientY] of a point of the world. */
  project([x, y]) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [left + this.origin[0] + this.scale * x, top + this.origin[1] + this.scale * y];
  }

  /** The point of the world's plane under the pointer. */
  pointInPlane(clientX, clientY) {
    const { left, top } = this.canvas.getBoundingClientRect();
    return [(clientX - left - this.origin[0]) / this.scale, (clientY - top - this.origin[1]) / this.scale, 0];
  }

  /** Draws if anything changed. `shakes`: the force is drawn as one that does. */
  draw(shakes) {
    if (!this.changed || !this.live) return;
    this.changed = false;
    ++this.drawn;
    const { pen, colors } = this;
    pen.setTransform(this.dots, 0, 0, this.dots, 0, 0);
    pen.clearRect(0, 0, this.width, this.height);
    pen.translate(...this.origin);
    pen.scale(this.scale, this.scale);
    for (const body of this.world.bodies) if (body.fixed) this.#drawFloor(body);
    this.trail.slice(0, -1).forEach((pose, i) => this.#drawGhost(pose, (i + 1) / TRAIL));
    const tool = this.world.bodies[this.world.tool_links[0]];
    this.#drawTool(tool.shapes, this.frame.device);
    this.#drawForces(shakes ? colors.bad : colors.good);
  }

  /** As wide as the picture: a floor has no end that matters. */
  #drawFloor(body) {
    const { pen, colors } = this;
    for (const shape of body.shapes) {
      if (shape.kind !== 'box') continue;
      const top = body.pose[1] + shape.pose[1] - shape.size[1] / 2;
      const reach = Math.max(this.width, this.height) / this.scale;
      pen.fillStyle = colors.floor;
      pen.fillRect(-reach, top, 2 * reach, reach);
      pen.fillStyle = colors.floorEdge;
      pen.fillRect(-reach, top, 2 * reach, 2 / this.scale);
    }
  }

  #drawTool(shapes, pose) {
    const { pen, colors } = this;
    this.#at(pose, () => {
      pen.fillStyle = colors.tool;
      pen.strokeStyle = colors.toolEdge;
      pen.lineWidth = 1.5 / this.scale;
      for (const { kind, pose: [x, y], size, radius } of shapes) {
        pen.beginPath();
        if (kind === 'box') pen.roundRect(x - size[0] / 2, y - size[1] / 2, size[0], size[1], size[0] / 4);
        else pen.arc(x, y, radius, 0, 2 * Math.PI);
        pen.fill();
        pen.stroke();
      }
      pen.fillStyle = colors.hand;
      pen.beginPath();
      pen.arc(...KNOB, KNOB_RADIUS, 0, 2 * Math.PI);
      pen.fill();
    });
  }

  /** Where the knob just was. */
  #drawGhost(pose, age) {
    const { pen, colors } = this;
    const [x, y] = knobOf(pose);
    pen.globalAlpha = 0.16 * age;
    pen.fillStyle = colors.hand;
    pen.beginPath();
    pen.arc(x, y, KNOB_RADIUS, 0, 2 * Math.PI);
    pen.fill();
    pen.globalAlpha = 1;
  }

  /** That of the floor beside the stylus, up from where they touch; that of a hand that presses, onto the knob. */
  #drawForces(color) {
    const { device, F_command: felt, F_hand: hand } = this.frame;
    const tool = this.world.bodies[this.world.tool_links[0]];
    const radius = tool.shapes.find(({ kind }) => kind === 'sphere')?.radius ?? 0;
    const touch = [device[0] + 2.2 * radius, device[1] + radius];
    this.#drawArrow(touch, felt, color, 0.006);
    const [x, y] = knobOf(device);
    const from = [x - METRES_PER_NEWTON * hand[0], y - KNOB_RADIUS - METRES_PER_NEWTON * hand[1]];
    if (hand[1] > 0) this.#drawArrow(from, hand, this.colors.hand, 0.006);
  }

  #drawArrow([x, y], [fx, fy], color, width) {
    const { pen } = this;
    const length = METRES_PER_NEWTON * Math.hypot(fx, fy), head = Math.min(2 * width, length), side = 0.6 * head;
    if (length < 0.001) return;
    pen.save();
    pen.translate(x, y);
    pen.rotate(Math.atan2(fy, fx));
    pen.fillStyle = color;
    pen.beginPath();
    pen.moveTo(length, 0);
    pen.lineTo(length - head, side);
    pen.lineTo(length - head, side / 2.4);
    pen.lineTo(0, side / 2.4);
    pen.lineTo(0, -side / 2.4);
    pen.lineTo(length - head, -side / 2.4);
    pen.lineTo(length - head, -side);
    pen.fill();
    pen.restore();
  }

  #at(pose, draw) {
    this.pen.save();
    this.pen.translate(pose[0], pose[1]);
    this.pen.rotate(angleOf(pose));
    draw();
    this.pen.restore();
  }

  #resize() {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    [this.pen, this.dots] = penOf(this.canvas);
    this.colors = colorsOf(this.canvas);
    this.width = clientWidth;
    this.height = clientHeight;
    const { left, right, top, bottom } = SHOWN;
    this.scale = Math.min(clientWidth / (right - left), clientHeight / (bottom - top));
    const middle = (clientWidth < NARROW ? 0.74 : 0.54) * clientWidth;
    this.origin = [middle - (this.scale * (left + right)) / 2, clientHeight / 2 - (this.scale * (top + bottom)) / 2];
    this.changed = true;
  }
}

/** What draws on a canvas that is as fine as the screen, and the dots of a CSS pixel. */
export function penOf(canvas) {
  const dots = Math.min(devicePixelRatio, 2);
  canvas.width = Math.round(canvas.clientWidth * dots);
  canvas.height = Math.round(canvas.clientHeight * dots);
  return [canvas.getContext('2d'), dots];
}

/** The colours of contrast.css, which follow the person's choice of light or dark. */
export function colorsOf(element) {
  const style = getComputedStyle(element);
  const of = (name) => style.getPropertyValue(name).trim();
  return { floor: of('--floor'), floorEdge: of('--floor-edge'), tool: of('--tool'), toolEdge: of('--tool-edge'),
           hand: of('--hand'), bad: of('--bad'), good: of('--good'), line: of('--line'), dim: of('--dim') };
}

function knobOf(pose) {
  const angle = angleOf(pose);
  return [pose[0] - KNOB[1] * Math.sin(angle), pose[1] + KNOB[1] * Math.cos(angle)];
}

/** Of a pose that is turned in the plane. */
function angleOf(pose) {
  return 2 * Math.atan2(pose[6], pose[3]);
}

function dot([ax, ay], [bx, by]) {
  return ax * bx + ay * by;
}
