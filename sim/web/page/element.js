// What the page is built of.

/** An element with properties, attributes (`attributes`), handlers (`on`) and children; what is `null` of the latter is left out. */
export function element(name, { attributes = {}, on = {}, ...properties } = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  for (const [attribute, value] of Object.entries(attributes)) made.setAttribute(attribute, value);
  for (const [event, handler] of Object.entries(on)) made.addEventListener(event, handler);
  made.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return made;
}

export function button(text, click, properties = {}) {
  return element("button", { type: "button", textContent: text, on: { click }, ...properties });
}

/** A sentence of the engine's: what stands between two backticks is code. */
export function sentence(text) {
  const parts = text.split("`");
  return parts.map((part, place) => {
    if (place % 2 === 0) return part;
    return place === parts.length - 1 ? `\`${part}` : element("code", { textContent: part });
  });
}

/** An error of the engine's: what is wrong, and what to do. */
export function errorText({ message, help }) {
  return [element("p", {}, sentence(message)), ...(help ? [element("p", { className: "help" }, sentence(help))] : [])];
}

let made = 0;

/** An id that nothing else on the page has. */
export function newId(name) {
  made += 1;
  return `${name}-${made}`;
}
