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

/** Return a field under its name. */
export function labelled(text, field) {
  field.id ||= freshId("field");
  const isControl = field.matches("input, select");
  const name = isControl ? el("label", { for: field.id }, text) : el("span", { className: "label" }, text);
  return el("div", { className: "field" }, name, field);
}

/** Return a field for a whole number; what is typed goes to the server as it is, which alone says what is wrong. */
export function numberField(props = {}) {
  return el("input", { type: "text", inputMode: "numeric", autocomplete: "off", className: "short", ...props });
}

/** Mark a field as the one that was refused, or as right again. */
export function mark(field, wrong) {
  if (wrong) field.setAttribute("aria-invalid", "true");
  else field.removeAttribute("aria-invalid");
}

/** Return a button that does `onclick`. */
export function button(text, onclick, props = {}) {
  return el("button", { type: "button", onclick, ...props }, text);
}
