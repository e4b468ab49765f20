// The field and the list of what is found, on every page; finder.js finds it.
(() => {
  const input = document.getElementById('search');
  const list = document.getElementById('found');
  const show = () => {
    list.replaceChildren();
    list.hidden = input.value.trim() === '';
    if (list.hidden) return;
    const found = find(input.value);
    const words = input.value.toLowerCase().split(/\s+/).filter((word) => word.length > 2);
    for (const { page, link, heading, text } of found) {
      const places = words.map((word) => text.toLowerCase().indexOf(word)).filter((place) => place >= 0);
      const at = places.length > 0 ? Math.max(0, Math.min(...places) - 40) : 0;
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
})();
