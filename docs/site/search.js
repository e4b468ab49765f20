// Finds headings by the words that begin so in them or below them; what is in a heading comes first. build.mjs
// appends a call of start() with the index: [page, link, heading, text] of each heading.
function score([page, , heading, text], terms) {
  let sum = 0;
  for (const term of terms) {
    if (` ${heading} `.includes(` ${term}`)) sum += 20;
    else if (` ${page} `.includes(` ${term}`)) sum += 5;
    else if (` ${text} `.includes(` ${term}`)) sum += 1;
    else if (`${heading} ${text}`.includes(term)) sum += 0.5;
    else return 0;
  }
  return sum - text.length / 1e5;
}

function start(index) {
  const folded = index.map((entry) => entry.map((part, i) => (i === 1 ? part : part.toLowerCase().replace(/[^\p{L}\p{N}_]+/gu, ' '))));
  const input = document.getElementById('search');
  const list = document.getElementById('found');
  const show = () => {
    const terms = input.value.toLowerCase().split(/[^\p{L}\p{N}_]+/u).filter(Boolean);
    list.replaceChildren();
    list.hidden = terms.length === 0;
    if (list.hidden) return;
    const found = folded.map((entry, i) => [score(entry, terms), i]).filter(([points]) => points > 0)
      .sort((a, b) => b[0] - a[0]).slice(0, 20);
    for (const [, i] of found) {
      const [page, link, heading, text] = index[i];
      const at = Math.max(0, text.toLowerCase().indexOf(terms[0]) - 40);
      const item = document.createElement('a');
      item.href = link;
      const title = document.createElement('b');
      title.textContent = heading && heading !== page ? `${page}: ${heading}` : page;
      item.append(title, ` ${text.slice(at, at + 110)}`);
      list.append(item);
    }
    if (found.length === 0) list.textContent = 'Nothing is found.';
  };
  input.addEventListener('input', show);
  input.addEventListener('keydown', (event) => {
    if (event.key === 'Enter') list.querySelector('a')?.click();
    if (event.key === 'Escape') { input.value = ''; show(); }
  });
}
