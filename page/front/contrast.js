// The contrast: two sessions side by side, one hand on both. Left the force of the engine's frames is held, right the
// local model answers. `?left=PORT` says where the ve_client of the left one is; the right one serves this page.

import { Connection } from './connection.js';
import { FORCE, Plot, SWING, figures } from './contrast_force.js';
import { SharedHand } from './contrast_hand.js';
import { View } from './contrast_view.js';
import { fixed, magnitude } from './format.js';
import { search } from './contrast_search.js';
import { Sound } from './sound.js';
import { TickStore } from './ticks.js';

const TEXT_MS = 150;
const STALE_MS = 2000;
const KEPT_SECONDS = 5;
const STIFFNESS = { least: 500, most: 60000, first: 10000 };   // N/m
const STEP_MS = 20, STEP = 1.05;   // a floor under load becomes stiffer by this ratio at once, at most: each step is a push
const SHAKES_FROM = 4;      // swings in two seconds
const STILL_MS = 2000;      // a hand and a floor that have not changed for so long made no swings,
const STEADY_MS = 1200;     // and for so long no change of the last second
const WORLD = 'contrast';
/** What the two couplings are, for a floor of stiffness k, N/m. */
const COUPLINGS = {
  left: (k) => ({ controller: 'engine_force', coupling_stiffness: k, coupling_damping: 10,
                  coupling_angular_stiffness: 0, coupling_angular_damping: 0 }),
  right: (k) => ({ controller: 'direct', update_rule: 'retain', stiffness: k, damping: 100 }),
};

const byId = (id) => document.getElementById(id);
const wanted = { stiffness: STIFFNESS.first, delay: 0 };
const present = { stiffness: STIFFNESS.first, delay: 0, changedAt: -Infinity };   // of the floors now; ms

class Side {
  constructor(name, host, pan) {
    this.name = name;
    this.element = byId(name);
    const [scene, plot] = this.element.querySelectorAll('canvas');
    this.view = new View(scene);
    this.plot = new Plot(plot);
    this.sound = new Sound(pan);
    this.store = new TickStore(1000, [], KEPT_SECONDS);
    this.frame = null;
    this.frameAt = performance.now();
    this.figures = null;
    this.shakes = false;
    this.connection = new Connection(`ws://${host}/session`, {
      world: (world) => this.#takeWorld(world),
      frame: (frame) => this.#takeFrame(frame),
      refused: ({ field }) => { if (field === 'hand') hand.release(); },
      ticks: (...of) => this.store.append(...of, NaN),
      telemetry: () => this.store.expectAnything(),
      opened: () => { this.frameAt = performance.now(); },
      closed: () => hand.release(),
    });
  }

  send(message) {
    return this.connection.send(message);
  }

  /** Makes it what the page says. */
  set() {
    this.send({ type: 'environment', rate: 60, delay: present.delay, jitter: 0, loss: 0 });
    this.send({ type: 'settings', ...COUPLINGS[this.name](present.stiffness) });
  }

  /** Whether another page has changed what makes the two comparable. */
  get differs() {
    const set = this.frame?.settings;
    return Boolean(set) && set.controller !== COUPLINGS[this.name](0).controller;
  }

  get trouble() {
    if (!this.connection.open || performance.now() - this.frameAt > STALE_MS) {
      return { text: 'The programs behind this page do not answer: start it again with “python3 -m haptic_local_model”.' };
    }
    if (this.frame?.server === 'fault' || this.frame?.rejected === 'fault') {
      return { text: `The simulated device stopped: ${this.frame.cause || this.frame.rejection}.`, again: true };
    }
    if (this.view.world && this.view.world.scene !== WORLD) {
      return { text: 'Another page plays another world here.', again: true };
    }
    return this.differs && this.settledAt < performance.now()
      ? { text: 'Another page has changed the settings.', again: true } : null;
  }

  /** As at the start. */
  again() {
    const elsewhere = this.view.world?.scene !== WORLD;
    this.begins = true;
    this.send(elsewhere ? { type: 'scene', name: WORLD } : { type: 'reset' });
    this.set();
  }

  /** A scene that was asked for has come, with the settings of the start. */
  #begin() {
    this.begins = false;
    this.set();
  }

  /** `reference`: the other side, which the same hand moves: what that has, too, is no shaking. */
  judge(reference) {
    this.figures = figures(this.store);
    const { swings, change } = this.figures ?? { swings: 0, change: 0 };
    const changedAt = Math.max(hand.movedAt, present.changedAt);
    const still = performance.now() - changedAt > (swings > 0 ? STILL_MS : STEADY_MS);
    const least = still ? SHAKES_FROM : SHAKES_FROM + (reference?.figures?.swings ?? Infinity);
    this.shakes = swings >= least && change > SWING;
    this.#showFigures(still);
  }

  #showFigures(still) {
    this.element.classList.toggle('shakes', this.shakes);
    setText(this.element.querySelector('.now'), this.figures ? `${this.figures.now.toFixed(1)} N` : '–');
    setText(this.element.querySelector('.state'), this.figures ? this.#sentence(still) : '');
  }

  #sentence(still) {
    const { now, change } = this.figures;
    if (this.shakes) return `shakes by ${fixed(change)} N`;
    if (change < 0.05 && now < 0.05) return 'free';
    return `${still ? 'steady within' : 'changes by'} ${fixed(change)} N`;
  }

  #takeWorld(world) {
    const rate = world.servo_rate || this.store.rate;
    this.store = new TickStore(rate, world.tick_columns, KEPT_SECONDS);
    this.view.setWorld(world);
    this.settledAt = performance.now() + STALE_MS;
    hand.release();
    if (!this.met) this.again();
    else if (this.begins && world.scene === WORLD) this.#begin();
    this.met = true;
  }

  #takeFrame(frame) {
    this.frame = frame;
    this.frameAt = performance.now();
    this.view.setFrame(frame);
    this.sound.update(magnitude(frame.F_command), this.shakes);
  }
}

let hand;
const left = new Side('left', `${location.hostname}:${leftPort()}`, -1);
const right = new Side('right', location.host, 1);
const sides = [left, right];
hand = new SharedHand(byId('sides'), sides.map(({ view }) => view), sendToBoth, showHand);
hand.setPresses(!matchMedia('(prefers-reduced-motion: reduce)').matches);

wire();
exposeForTests();
requestAnimationFrame(draw);
setInterval(showText, TEXT_MS);
setInterval(step, STEP_MS);

function leftPort() {
  const port = Number(new URLSearchParams(location.search).get('left'));
  return Number.isInteger(port) && port > 0 && port < 65536 ? port : location.port;
}

/** Whether it reached both. */
function sendToBoth(message) {
  return sides.map((side) => side.send(message)).every(Boolean);
}

let pictures = 0;

function draw(now) {
  requestAnimationFrame(draw);
  ++pictures;
  hand.lead(now);
  for (const side of sides) {
    side.view.draw(side.shakes);
    side.plot.draw(side.store, side.shakes);
  }
}

function showText() {
  right.judge();
  left.judge(right);
  const trouble = sides.map((side) => side.trouble).find(Boolean);
  byId('banner').hidden = !trouble;
  setText(byId('banner').firstElementChild, trouble?.text ?? '');
  byId('again').hidden = !trouble?.again;
}

function showHand() {
  byId('sides').style.cursor = hand.personal ? 'grabbing' : '';
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function setStiffness(stiffness) {
  wanted.stiffness = stiffness;
  const share = Math.log(stiffness / STIFFNESS.least) / Math.log(STIFFNESS.most / STIFFNESS.least);
  byId('stiffness').value = String(Math.round(100 * share));
  showSettings();
}

/** Brings the floors nearer to what is wanted. */
function step() {
  const ratio = Math.min(STEP, Math.max(1 / STEP, wanted.stiffness / present.stiffness));
  if (ratio === 1 && wanted.delay === present.delay) return;
  Object.assign(present, { stiffness: ratio === STEP || ratio === 1 / STEP ? present.stiffness * ratio : wanted.stiffness,
                           delay: wanted.delay, changedAt: performance.now() });
  for (const side of sides) side.set();
}

function showSettings() {
  const kilo = `${fixed(wanted.stiffness / 1000)} kN/m`, late = `${Math.round(1000 * wanted.delay)} ms`;
  setText(byId('stiffness-value'), kilo);
  setText(byId('delay-value'), late);
  byId('stiffness').setAttribute('aria-valuetext', kilo);
  byId('delay').setAttribute('aria-valuetext', late);
}

function wire() {
  byId('stiffness').oninput = ({ target }) => {
    setStiffness(STIFFNESS.least * (STIFFNESS.most / STIFFNESS.least) ** (Number(target.value) / 100));
  };
  byId('delay').oninput = ({ target }) => {
    wanted.delay = Number(target.value) / 1000;
    showSettings();
  };
  setStiffness(wanted.stiffness);
  toggle('press', (on) => hand.setPresses(on));
  byId('press').setAttribute('aria-pressed', String(hand.presses));
  toggle('sound', (on) => sides.forEach(({ sound }) => sound.setOn(on)));
  byId('about-open').onclick = () => byId('about').showModal();
  byId('again').onclick = () => sides.forEach((side) => side.again());
  byId('search').onclick = () => search({ left, right, hand, wanted, present, setStiffness, range: STIFFNESS,
                                          button: byId('search'), output: byId('found') });
}

function toggle(id, act) {
  byId(id).onclick = ({ currentTarget: button }) => {
    const on = button.getAttribute('aria-pressed') !== 'true';
    button.setAttribute('aria-pressed', String(on));
    act(on);
  };
}

/**
 * For tests and the curious:
 *   left, right   {figures, shakes, frame}, see figures() in contrast_force.js
 *   forces(name)  the kept ticks of a side, N, oldest first
 *   pictures      drawn so far
 *   hand          see contrast_hand.js
 */
function exposeForTests() {
  window.contrast = { left, right, hand, wanted, setStiffness,
                      forces: (name) => window.contrast[name].store.valuesOf(FORCE),
                      get pictures() { return pictures; } };
}
