// What the page says in words and numbers around the scene: status line, legend, the spring's force.

import { fixed, magnitude, milliseconds, newtons, niceAbove } from './format.js';

const MOVING = 0.05;   // N, of a hand that moves the tool

/** Events per second over the last two seconds. */
export class Meter {
  #marks = [];    // [time ms, events since the mark before]

  count(events = 1) {
    const now = performance.now();
    this.#marks.push([now, events]);
    while (this.#marks[0][0] < now - 2000) this.#marks.shift();
  }

  rate() {
    const now = performance.now();
    const marks = this.#marks.filter(([time]) => time >= now - 2000);
    if (marks.length < 2) return 0;
    const events = marks.slice(1).reduce((sum, [, count]) => sum + count, 0);
    return (events * 1000) / (now - marks[0][0]);
  }
}

export function showStatus(element, { open, trouble, frame, meters, store }) {
  const entries = [[trouble ? trouble.kind.replace('_', ' ') : 'connected', Boolean(trouble)]];
  if (open && frame) {
    entries.push([`servo ${Math.round(meters.ticks.rate())} Hz`],
                 [`VE ${Math.round(meters.frames.rate())} Hz`],
                 [`page ${Math.round(meters.page.rate())} fps`],
                 [`lost ${store.lost}`, store.lost > 0],
                 [`round trip ${milliseconds(frame.round_trip)}`]);
    if (frame.environment?.pace < 1) entries.push([`world at ${fixed(frame.environment.pace)} of its speed`]);
  }
  const key = entries.join();
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  element.replaceChildren(...entries.flatMap(([text, bad], i) => {
    const entry = document.createElement(i === 0 || bad ? 'b' : 'span');
    entry.className = bad ? 'bad' : '';
    entry.textContent = text;
    return i === 0 ? [entry] : [' · ', entry];
  }));
}

/** The forces' sizes, and how long an arrow of a round number of newtons is on the screen. */
export function showLegend(scene, frame) {
  const byId = (id) => document.getElementById(id);
  for (const name of ['F_env', 'F_hand', 'F_command']) {
    byId(`value-${name}`).textContent = scene.live ? newtons(magnitude(frame[name])) : '–';
  }
  if (scene.live && frame.hand === 'observed') byId('value-F_hand').textContent += ', estimated';
  if (scene.live && frame.hand === 'unknown') byId('value-F_hand').textContent = 'unknown';
  byId('value-force').textContent = scene.live ? newtons(magnitude(frame.F_env)) : '–';
  byId('grip').hidden = !scene.world?.gripper;
  byId('value-grip').textContent = scene.live ? newtons(Math.abs(frame.grip)) : '–';
  byId('value-on-body').textContent = scene.live ? newtons(scene.forceOnBodies) : '–';
  if (!scene.metresPerNewton || !scene.live) return;
  const pixelsPerNewton = scene.pixelsPerMetre() * scene.metresPerNewton;
  const force = niceAbove(14 / pixelsPerNewton);
  byId('arrow-bar').style.width = `${Math.min(90, force * pixelsPerNewton)}px`;
  byId('arrow-scale').textContent = `${Number(force.toPrecision(1))} N`;
}

/** The hand's force next to the middle of the spring; where this page holds nothing, a hint at the handle. */
export function showSpring(scene, hand, label, hint, beckon) {
  const { frame, live } = scene;
  const another = live && hand.heldByAnother;
  label.hidden = !live || !hand.held;
  const hints = live && !hand.held && (another || hand.known !== true);
  const beckons = hints && !another && scene.plain && scene.world.guidable;
  hint.hidden = !hints || beckons;
  beckon.hidden = !beckons;
  if (!live) return;
  const text = another ? 'Another page holds the handle'
    : scene.world.guidable ? 'Drag the handle' : 'This device has a hand of its own';
  write(hint, text);
  if (hand.held) {
    hand.known = true;
    const middle = hand.target.slice(0, 3).map((value, i) => (value + frame.device[i]) / 2);
    label.textContent = newtons(magnitude(frame.F_hand));
    moveTo(label, scene, middle, 18, -30);
  } else if (!hint.hidden) {
    moveTo(hint, scene, frame.device, 14, 12);
  }
  if (beckons) moveTo(beckon, scene, frame.device, -8, -4);
}

/** What to do and what is seen, in one sentence. `hand` may be null. */
export function sentenceOf(frame, hand, world) {
  if (!frame?.device) return 'The scene comes to life as soon as haptic_server answers.';
  if (!hand) return 'This browser cannot show the scene; Expert shows charts and settings.';
  const felt = 'the arrow is the force that the hand feels';
  if (frame.environment?.pace === 0) return `The world stands still: ${felt}, which moves nothing now.`;
  if (!world.guidable) return `Move your device until the orange tool touches something: ${felt}.`;
  if (hand.heldByAnother) return `Another page moves the orange tool: ${felt}.`;
  if (!hand.held && magnitude(frame.F_hand) > MOVING) return `A hand moves the orange tool: ${felt}; drag the tool to take over.`;
  if (!hand.known) return `Drag the orange tool against something, as the pointer shows: ${felt}.`;
  return `Press the orange tool against something: ${felt}; the slider makes that stiffer or softer.`;
}

export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function moveTo(element, scene, point, dx, dy) {
  const [x, y] = scene.projectInside(point);
  const inside = (at, end, size) => Math.round(Math.max(0, Math.min(at, end - size)));
  const left = inside(x + dx, scene.width, element.offsetWidth);
  const top = inside(y + dy, scene.height, element.offsetHeight);
  element.style.transform = `translate(${left}px, ${top}px)`;
}

/** The latest flight recording of haptic_server, where it can be had from here. */
export function showRecording(link, name) {
  link.hidden = !name;
  link.title = `The last 10 s of every tick before a fault or SIGUSR1: ${name}`;
}
