// Why do I feel nothing? The way of the force, link by link, and the first link that stops it.

import { fixed, magnitude, millimetres, newtons } from './format.js';

const NOTHING = 0.01;   // N
const OLD_CONTACTS = 0.25;   // s

/** Whether the force comes from the engine alone, so that no local contact has a part in it. */
const fromEngine = (frame) => frame.settings.controller.startsWith('engine_');

// Each link: its name, its live value, and the reason if it is zero or limiting (else nothing).
// `local` ones have no part in the engine's force.
const LINKS = [
  { name: 'device',
    value: (f) => `x ${fixed(f.device[0] * 1e3)}\ny ${fixed(f.device[1] * 1e3)} mm`,
    reason: (f) => {
      if (!f.connected) return 'haptic_server does not answer';
      if (f.server === 'fault') return `the server stopped with fault ${f.fault}`;
      return null;
    } },
  { name: 'hand', value: (f) => newtons(magnitude(f.F_hand)),
    reason: (f, held) => {
      // Some devices cannot measure the hand; with a force on it there is one.
      if (magnitude(f.F_hand) >= NOTHING || magnitude(f.F_env) >= NOTHING) return null;
      return held ? 'the hand does not pull: move it away from the handle'
        : 'no hand on the device: drag the handle';
    } },
  { name: 'contacts', local: true, value: (f) => `${f.reported}\nage ${Math.round(f.age * 1e3)} ms`,
    reason: (f) => {
      if (f.reported === 0) {
        return f.epsilon > 0
          ? `no contacts reported: the tool is farther than epsilon (${millimetres(f.epsilon)}) from everything`
          : 'no contacts reported: with epsilon 0 only touching contacts are sent';
      }
      return f.age > OLD_CONTACTS ? 'the contacts are old: the environment is late or silent' : null;
    } },
  { name: 'separation', local: true, value: (f) => millimetres(f.smallest_separation),
    reason: (f) => (f.smallest_separation > 0 ? 'separation > 0: nothing is touched' : null) },
  { name: 'penalty', local: true, value: (f) => `${newtons(penalty(f))}\n${f.active} active`,
    reason: (f) => (f.active === 0 ? 'no local contact is active' : null) },
  { name: 'F_env', value: (f) => newtons(magnitude(f.F_env)),
    reason: (f) => {
      if (magnitude(f.F_env) >= NOTHING) return null;
      return fromEngine(f) ? "the engine's tool does not resist"
        : 'the contact forces cancel out, or are too small to feel';
    } },
  { name: 'limiter', value: (f) => (f.limit === 'none' ? 'free' : f.limit),
    reason: (f) => ({ none: null, force: 'limit: force', torque: 'limit: torque',
                      rate: 'limit: rate, the force may not change faster',
                      fade: 'limit: fade, the force fades in, or out while nothing is heard',
    })[f.limit] },
  { name: 'command', value: (f) => newtons(magnitude(f.F_command)),
    reason: (f) => (magnitude(f.F_command) < NOTHING ? 'the controller commands nothing' : null) },
];

const penalty = (frame) => (frame.contacts ?? []).reduce((sum, contact) => sum + magnitude(contact.f), 0);

export class Chain {
  constructor(element, reasonElement) {
    this.reasonElement = reasonElement;
    this.links = LINKS.map(({ name }) => {
      const item = element.appendChild(document.createElement('li'));
      item.append(name);
      return { item, value: item.appendChild(document.createElement('output')) };
    });
  }

  show(frame, held) {
    const complete = frame?.device && frame.F_hand && frame.F_env && frame.F_command;
    const counts = ({ local }) => complete && !(local && fromEngine(frame));
    const reasons = LINKS.map((link) => (counts(link) ? link.reason(frame, held) : null));
    const first = reasons.findIndex(Boolean);
    this.links.forEach(({ item, value }, i) => {
      write(value, counts(LINKS[i]) ? LINKS[i].value(frame) : '–');
      item.classList.toggle('stops', i === first);
    });
    this.stops = first < 0 ? null : { link: LINKS[first].name, reason: reasons[first] };
    write(this.reasonElement, this.#sentence(complete));
    this.reasonElement.classList.toggle('stops', first >= 0);
  }

  #sentence(complete) {
    if (!complete) return 'Nothing received yet.';
    if (!this.stops) return 'The force reaches the hand.';
    return `At “${this.stops.link}”: ${this.stops.reason}.`;
  }
}

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
