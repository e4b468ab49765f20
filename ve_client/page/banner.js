// What is wrong, and what to do about it: one sentence, or none.

const STALE_MS = 2000;

const FAULTS = {
  non_finite: 'the local model gave a value that is not finite: lower the stiffness or choose LM, then Reset',
  overrun: 'ticks took longer than their period for too long: give the server free cores or a lower '
    + 'rate, then Reset',
  implausible: 'contacts carried the proxy away: check how fast bodies move, then Reset',
  device: 'the device reported an error: check its cable, power and enable switch, then Reset',
};

/**
 * `link`: open, frameAt (ms, of the last frame). Returns {kind, text, cut}, or null if all is well;
 * `cut` says in a few words why no force can reach the hand and the last frame is out of date, if so.
 */
export function troubleOf(link, frame, now) {
  if (!link.open) {
    return { kind: 'disconnected', cut: 've_client does not answer',
             text: 'No ve_client: start it (scripts/run), or close one of the pages that it already serves '
               + '(four at most). Trying again …' };
  }
  if (now - link.frameAt > STALE_MS) {
    return { kind: 'stale', cut: 've_client sends no frames',
             text: 've_client answers but sends no frames: its world stands still. See its terminal.' };
  }
  if (!frame) return null;
  if (frame.rejected === 'fault') {
    return { kind: 'fault', cut: 'haptic_server waits after a fault',
             text: 'haptic_server had a fault and keeps the force off until you press Reset. Its log says which.' };
  }
  if (frame.rejected === 'busy') {
    return { kind: 'busy', cut: 'haptic_server is busy',
             text: 'haptic_server is busy with another client: end that one, or wait.' };
  }
  if (!frame.connected) {
    return { kind: 'no_server', cut: 'haptic_server does not answer',
             text: 'haptic_server does not answer: start it, or check --server.' };
  }
  if (frame.server === 'fault') {
    return { kind: 'fault', text: `Fault ${frame.fault}: ${FAULTS[frame.fault] ?? 'see the log of haptic_server, then Reset'}.` };
  }
  if (frame.server === 'silent') {
    return { kind: 'silent', text: 'haptic_server receives nothing from ve_client and lets the force fade: '
      + 'lower loss and delay, or raise the frame rate.' };
  }
  return null;
}
