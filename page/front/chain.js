// Why do I feel nothing? The way of the force as ve_client found it, and the first link that stops it.

import { write } from './display.js';
import { complaintOf, summaryOf } from './verdict.js';

// ve_client knows whether a page holds the hand, not which page it is talking to.
const IDLE_HANDS = {
  me: 'the hand does not pull: move it away from the handle',
  another: 'the hand does not pull: another page holds it',
};

export class Chain {
  /** Where the links, the sentence on them and the verdict on the last second go. */
  constructor(list, sentence, verdict) {
    Object.assign(this, { list, sentence, verdict, links: [] });
  }

  /** `situation`: trouble (see troubleOf), holder ('me', 'another' or null), verdict (see judge). */
  show(frame, { trouble, holder, verdict }) {
    const chain = frame?.chain ?? [];
    this.list.hidden = this.sentence.hidden = Boolean(frame && !frame.chain);
    const known = Boolean(frame?.device && !trouble?.cut);
    const complaint = complaintOf(verdict);
    const reasonOf = ({ name, reason }, i) => {
      if (!known) return i === 0 ? trouble?.cut ?? null : null;
      if (name === 'hand' && reason) return IDLE_HANDS[holder] ?? reason;
      return name === 'limiter' && complaint ? null : reason;   // The complaint says more.
    };
    const reasons = chain.map(reasonOf);
    const first = reasons.findIndex(Boolean);
    chain.forEach(({ name, value }, i) => {
      const link = (this.links[i] ??= this.#makeLink());
      write(link.name, name);
      write(link.value, known ? value : '–');
      link.item.classList.toggle('stops', i === first);
    });
    this.stops = first < 0 ? null : { link: chain[first].name, reason: reasons[first] };
    write(this.verdict, known ? summaryOf(verdict) : '');
    this.#conclude(known, trouble, complaint);
  }

  #makeLink() {
    const item = this.list.appendChild(document.createElement('li'));
    return { item, name: item.appendChild(document.createElement('span')),
             value: item.appendChild(document.createElement('output')) };
  }

  #conclude(known, trouble, complaint) {
    const [kind, text] = this.stops ? ['stops', `At “${this.stops.link}”: ${this.stops.reason}.`]
      : !known ? ['', trouble?.cut ? `There is no force: ${trouble.cut}.` : 'Nothing received yet.']
        : complaint ? ['stops', `The force reaches the hand, but ${complaint}.`]
          : ['reaches', 'The force reaches the hand.'];
    write(this.sentence, text);
    if (this.sentence.className !== kind) this.sentence.className = kind;
  }
}
