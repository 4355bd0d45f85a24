/**
 * Building elements without markup in strings: text stays text, and nothing is inline that the page's policy forbids.
 */

/** Return a new element with `props` (`data-*`, `aria-*`, `role` and `for` as attributes, `on*` as listeners). */
export function el(tag, props = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value == null) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (/^(data-|aria-|role$|for$|list$|colspan$|rowspan$|scope$)/.test(name)) node.setAttribute(name, value);
    else node[name] = value;
  }
  node.append(...children.filter((child) => child != null));
  return node;
}

/** Set a node's text where it differs, so that selection and a screen reader's place stay. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

let made = 0;

/** Return an id that no other element of the page has. */
export function freshId(stem) {
  made += 1;
  return `${stem}-${made}`;
}
