// From which stiffness on the held force shakes: measured on this page, while its hand presses.

const STEP = 1.2;           // ratio of one stiffness to the next
const SETTLE_MS = 1500;     // what was there before has died out, or has grown
const CALM_MS = 2500;       // the same where it shook before
const LOOK_MS = 50;
const SHAKES = 0.5;         // N, change in the last second

/** Raises the floor until the left one shakes, then shows the right one the stiffest. The slider goes back at the end.
 *  Ends early where a person takes the hand. */
export async function search({ left, right, hand, wanted, present, setStiffness, range, button, output }) {
  const before = wanted.stiffness, tried = new Set();
  const shakes = async (side, stiffness, ms) => {
    tried.add(stiffness);
    setStiffness(stiffness);
    output.textContent = `Measuring at ${kilo(stiffness)} …`;
    while (present.stiffness !== stiffness && wanted.stiffness === stiffness) await pause(LOOK_MS);
    await pause(ms + 1000);
    return side.figures?.change > SHAKES;
  };
  button.disabled = true;
  if (!hand.presses) document.getElementById('press').click();
  output.textContent = await found();
  button.disabled = false;
  if (tried.has(wanted.stiffness)) setStiffness(before);

  async function found() {
    let steady = null;
    for (let k = range.least; k <= range.most; k *= STEP) {
      const shook = await shakes(left, k, k === range.least ? CALM_MS : SETTLE_MS);
      if (hand.personal || !hand.held || wanted.stiffness !== k) return 'Not measured: somebody moved the hand or the slider.';
      if (shook && steady === null) return `The held force shakes already at ${kilo(k)}.`;
      if (shook) return compared(steady, k, await shakes(right, range.most, SETTLE_MS));
      steady = k;
    }
    return `Neither shakes up to ${kilo(range.most)}.`;
  }

  function compared(steady, k, rightShakes) {
    return `Measured just now: the held force is steady at ${kilo(steady)} and shakes at ${kilo(k)}. `
      + `The local model ${rightShakes ? 'shakes, too,' : 'is steady'} at ${kilo(range.most)}.`;
  }
}

const kilo = (stiffness) => `${(stiffness / 1000).toPrecision(2)} kN/m`;
const pause = (ms) => new Promise((resolve) => { setTimeout(resolve, ms); });
