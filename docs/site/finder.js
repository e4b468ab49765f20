// Which headings answer a question: find(question). build.mjs puts MiniSearch before this file, and behind it ENTRIES, with
// {group, page, link, heading, text} of each heading. Any word may match, and a word like one of the question's counts half.

// What means the same to those who ask.
const ALIKE = [
  'vibrate vibration buzz oscillate oscillation shake tremble chatter unstable instability hum',
  'estop emergency halt kill',
  'latency delay lag late',
  'mac macos osx apple',
  'licence license mit copyright',
  'wifi wireless wlan',
  'internet vpn network remote',
  'soft deformable deform cloth tissue elastic',
  'cite citation bibtex reference',
  'rate frequency hz khz',
  'encryption encrypt sealed secure key',
  'token password login',
  'jupyter notebook colab',
  'bimanual arms hands',
  'record recording log capture demonstration',
  'plot draw picture chart graph',
  'install installation setup',
  'stiff stiffness hard',
  'scale scaling workspace',
  'docker container podman',
  'ros ros2 rclpy',
  'unity unreal godot',
  'urdf robot xacro',
  'simulink matlab java rust',
  'permission rights udev denied dialout',
  'kernel preempt realtime',
  'weak weaker weakly',
  'omega sigma lambda delta falcon forcedimension dimension',
  'touch phantom omni geomagic openhaptics',
  'inverse3 minverse haply',
  'friction slip slide',
  'fall drop thrown',
  'port firewall',
  'driver device',
  'adapter simulator engine',
].map((words) => words.split(' '));
const EMPTY = new Set(`a an and any are as at be but by can cannot do does for from get give go has have how i if in into is it its me my
  need of on or our so some than that the their them then there these this to use using was we what when where which who why will
  with work works would you your`.split(/\s+/));
// How much a page's or a group's headings count: guides come before tables and the reference.
const WEIGHTS = { Contributing: 0.8, Begin: 1.2, Use: 1.2, Connect: 1.1, Method: 0.5, Reference: 0.45, Project: 0.4 };
const ALIKE_WEIGHT = 0.5; // Of a word that is only like one of the question's.
const SHOWN = 20;

// One spelling of a word, for what is asked and what is found.
function stem(word) {
  const lower = word.toLowerCase();
  if (EMPTY.has(lower)) return null;
  const bare = lower.replace(/(ies|ied)$/, 'y').replace(/(ions?|ing|ed|es|s|e)$/, '');
  return bare.length > 2 ? bare : lower;
}

function words(text) {
  return text.replace(/\b(e|wi|real)-(stop|fi|time)\b/gi, '$1$2').replace(/\bno (force|feedback)\b/gi, 'nothing felt')
    .split(/[^\p{L}\p{N}+#@]+/u).filter(Boolean);
}

function finder(entries) {
  const groups = ALIKE.map((group) => group.map(stem));
  const alike = (term) => [...new Set(groups.filter((group) => group.includes(term)).flat())].filter((word) => word !== term);
  const index = new MiniSearch({
    fields: ['heading', 'page', 'text'],
    tokenize: words,
    processTerm: stem,
  });
  index.addAll(entries.map(({ heading, page, text }, id) => ({ id, heading, page, text })));
  return (question) => {
    const options = {
      boost: { heading: 5, page: 2 },
      prefix: (term) => term.length > 2,
      fuzzy: (term) => (/^\p{L}{6,}$/u.test(term) ? 1 : 0),
      weights: { prefix: 0.5, fuzzy: 0.2 },
      boostDocument: (id) => WEIGHTS[entries[id].page] ?? WEIGHTS[entries[id].group] ?? 1,
      processTerm: (term) => term,
      tokenize: (term) => [term],
    };
    const points = new Map();
    for (const term of new Set(words(question).map(stem).filter(Boolean))) {
      const best = new Map();
      const count = (word, weight) => {
        for (const { id, score } of index.search(word, options)) best.set(id, Math.max(best.get(id) ?? 0, weight * score));
      };
      count(term, 1);
      for (const word of alike(term)) count(word, ALIKE_WEIGHT);
      for (const [id, score] of best) {
        const { sum, terms } = points.get(id) ?? { sum: 0, terms: 0 };
        points.set(id, { sum: sum + score, terms: terms + 1 });
      }
    }
    // What has all the words comes first among equals.
    return [...points].map(([id, { sum, terms }]) => [sum * terms ** 2, id])
      .sort((a, b) => b[0] - a[0]).slice(0, SHOWN).map(([, id]) => entries[id]);
  };
}

let ready; // Made when the first question comes.
function find(question) {
  ready ??= finder(ENTRIES);
  return ready(question);
}
