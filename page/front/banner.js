// What is wrong, and what to do about it: one sentence, or none.

const STALE_MS = 2000;
/** Faults of the client's numbers: all others are released at the device's machine. */
const CLIENTS_FAULTS = ['non_finite', 'implausible'];

/**
 * `link`: open, frameAt (ms, of the last frame), loading (a scene that was chosen, or null). Returns {kind, text, cut}, or null if all is well;
 * `cut` says in a few words why no force can reach the hand and the last frame is out of date, if so.
 */
export function troubleOf(link, frame, now) {
  if (!link.open) {
    return { kind: 'disconnected', cut: 'the program that serves this page does not answer',
             text: 'The program that serves this page has ended: start it again. Or it serves four pages already: close one. '
               + 'Trying again …' };
  }
  if (now - link.frameAt > STALE_MS) {
    return { kind: 'stale', cut: 'the program that serves this page sends no frames',
             text: link.loading ? `No frames come while scene ${link.loading} is loaded.`
               : 'The program that serves this page answers but sends no frames: its world stands still. See its terminal.' };
  }
  if (!frame) return null;
  if (frame.rejected === 'fault') {
    return { kind: 'fault', cut: 'haptic_server waits after a fault',
             text: `haptic_server keeps the force off after a ${frame.rejection}: press Reset.` };
  }
  if (frame.rejected === 'busy') {
    return { kind: 'busy', cut: 'haptic_server is busy',
             text: 'haptic_server is busy with another client: end that one, or wait.' };
  }
  if (frame.rejected === 'tool') {
    return { kind: 'tool', cut: 'haptic_server cannot use the tool',
             text: `haptic_server cannot use the tool of this scene: ${frame.rejection}. Choose another scene, or `
               + 'start haptic_server with other options.' };
  }
  if (!frame.connected) {
    return { kind: 'no_server', cut: 'haptic_server does not answer',
             text: 'haptic_server does not answer: start it, or check --server.' };
  }
  if (frame.server === 'fault') {
    return { kind: 'fault',
             text: `Fault ${frame.fault}: ${frame.cause}. ${sentence(frame.remedy)}, `
               + (CLIENTS_FAULTS.includes(frame.fault) ? '' : 'run haptic_doctor clear at the server, ') + 'then press Reset.' };
  }
  // A client in the state arming has had no time yet to send anything.
  if (frame.server === 'fading' || frame.fade === 'contacts_old' || frame.fade === 'updates_invalid') {
    return { kind: 'fading', text: `haptic_server gives no force: ${frame.cause}. ${sentence(frame.remedy)}.` };
  }
  return null;
}

const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
