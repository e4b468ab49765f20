// Why do I feel nothing? The way of the force, link by link, and the first link that stops it.

import { fixed, magnitude, millimetres, newtons } from './format.js';
import { complaintOf, summaryOf } from './verdict.js';

const NOTHING = 0.01;   // N
const OLD_CONTACTS = 0.25;   // s

// Each link: its name, its live value, and the reason if it is zero or limiting (else nothing).
// `local` ones have no part in a force that comes from the engine alone. `s`: see show().
const LINKS = [
  { name: 'device',
    value: (f) => `x ${fixed(f.device[0] * 1e3)}\ny ${fixed(f.device[1] * 1e3)} mm`,
    reason: (f) => (f.server === 'fault' ? `haptic_server stopped with fault ${f.fault}` : null) },
  { name: 'hand', value: (f) => newtons(magnitude(f.F_hand)),
    reason: (f, s) => {
      // Some devices cannot measure the hand; with a force on it there is one.
      if (magnitude(f.F_hand) >= NOTHING || magnitude(f.F_env) >= NOTHING) return null;
      return { me: 'the hand does not pull: move it away from the handle',
               another: 'the hand does not pull: another page holds it',
      }[s.holder] ?? 'no hand on the device: drag the handle';
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
    reason: (f, s) => {
      if (magnitude(f.F_env) >= NOTHING) return null;
      return s.fromEngine ? "the engine's tool does not resist"
        : 'the contact forces cancel out, or are too small to feel';
    } },
  { name: 'limiter', value: (f) => (f.limit === 'none' ? 'free' : f.limit),
    reason: (f, s) => (complaintOf(s.verdict) ? null : {
      force: 'the force is at its limit', torque: 'the torque is at its limit',
      rate: 'the force may not change faster',
      fade: 'the force fades in, or out while no updates arrive',
    }[f.limit]) },
  { name: 'command', value: (f) => newtons(magnitude(f.F_command)),
    reason: (f) => (magnitude(f.F_command) < NOTHING ? 'the controller commands nothing' : null) },
];

const penalty = (frame) => (frame.contacts ?? []).filter(({ of }) => of === 'tool_link')
  .reduce((sum, contact) => sum + magnitude(contact.f), 0);

export class Chain {
  /** Where the links, the sentence on them and the verdict on the last second go. */
  constructor(list, sentence, verdict) {
    Object.assign(this, { sentence, verdict });
    this.controllers = [];   // of the `world` message
    this.links = LINKS.map(({ name }) => {
      const item = list.appendChild(document.createElement('li'));
      item.append(name);
      return { item, value: item.appendChild(document.createElement('output')) };
    });
  }

  /** `situation`: trouble (see troubleOf), holder ('me', 'another' or null), verdict (see judge);
   *  links also get fromEngine, whether the force comes from the engine alone. */
  show(frame, situation) {
    const known = Boolean(frame?.device && !situation.trouble?.cut);
    const controller = this.controllers.find(({ name }) => name === frame?.settings.controller);
    const s = { ...situation, fromEngine: controller?.uses_contacts === false };
    const counts = ({ local }) => known && !(local && s.fromEngine);
    const reasons = LINKS.map((link) => (counts(link) ? link.reason(frame, s) : null));
    reasons[0] = s.trouble?.cut ?? reasons[0];
    const first = reasons.findIndex(Boolean);
    this.links.forEach(({ item, value }, i) => {
      write(value, counts(LINKS[i]) ? LINKS[i].value(frame) : '–');
      item.classList.toggle('stops', i === first);
    });
    this.stops = first < 0 ? null : { link: LINKS[first].name, reason: reasons[first] };
    write(this.verdict, known ? summaryOf(s.verdict) : '');
    this.#conclude(known, complaintOf(s.verdict));
  }

  #conclude(known, complaint) {
    const [kind, text] = this.stops ? ['stops', `At “${this.stops.link}”: ${this.stops.reason}.`]
      : !known ? ['', 'Nothing received yet.']
        : complaint ? ['stops', `The force reaches the hand, but ${complaint}.`]
          : ['reaches', 'The force reaches the hand.'];
    write(this.sentence, text);
    if (this.sentence.className !== kind) this.sentence.className = kind;
  }
}

function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
