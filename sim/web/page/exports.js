// A motor's parameters as a flight stack or a simulator calls them, and its files.

import { button, element, errorText, newId, sentence } from "./element.js";
import { bytesOf, keep } from "./keep.js";
import { say } from "./messages.js";

const FILES = [
  ["model.toml", "the motor's model"],
  ["compensator.toml", "the compensator that is chosen under What to fly, for the controller"],
  ["compensator.h", "its constants for another firmware, in C"],
  ["report.html", "all of this as one file"],
];

/** Where files of a motor are taken. `get` asks the engine, and throws where it ended. */
export function exportsOf({ targets }, get) {
  const heading = newId("keep");
  const refusal = element("div", { className: "refused", attributes: { role: "alert" } });
  const files = FILES.map(([name, what]) => element("li", {},
    button(name, async () => {
      refusal.replaceChildren();
      const answer = await get({ ask: "file", name });
      if (!answer) return;
      if (answer.error) refusal.replaceChildren(...errorText(answer.error));
      else keep(answer.file, answer.text, name.endsWith(".html") ? "text/html" : "text/plain");
    }),
    ` ${what}`));
  return element("section", { className: "keep", attributes: { "aria-labelledby": heading } },
    element("h2", { id: heading, textContent: "Take it along" }),
    element("ul", { className: "files" }, files), refusal,
    stackExport(targets, get));
}

function stackExport(targets, get) {
  const list = element("select", { className: "targets" }, targets.map(({ name, about }) => element("option", { value: name, textContent: `${name}: ${about.replaceAll("`", "")}` })));
  const compensated = element("input", { type: "checkbox" });
  const shown = element("div", { className: "exported" });
  const show = async () => {
    const answer = await get({ ask: "export", for: list.value, compensated: compensated.checked });
    if (!answer) return;
    shown.replaceChildren(...(answer.error ? errorText(answer.error) : exported(answer)));
  };
  const forget = () => shown.replaceChildren();
  list.addEventListener("change", forget);
  compensated.addEventListener("change", forget);
  return element("div", { className: "stack" },
    element("label", {}, element("span", { textContent: "For a flight stack, a simulator or a program" }), list),
    element("label", { className: "check" }, compensated, " With the compensator before the motor"),
    button("Show", show, { className: "main" }),
    shown);
}

/** A file that was exported, with ways to take it. */
function exported({ file, text, base64, values }) {
  const warnings = (values.warnings ?? []).map((warning) => element("p", {}, sentence(warning)));
  const download = button(`Download ${file}`, () => keep(file, text ?? bytesOf(base64)));
  if (text === null) return [...warnings, element("p", { textContent: `${file} is no text.` }), download];
  const shown = element("pre", { tabIndex: 0, attributes: { role: "region", "aria-label": file } }, element("code", { textContent: text }));
  const copy = button("Copy", async () => {
    // Where a page is from another machine without encryption, it has no clipboard.
    if (navigator.clipboard) {
      await navigator.clipboard.writeText(text);
      say(`${file} is in the clipboard.`);
    } else {
      getSelection().selectAllChildren(shown);
      say(`${file} is selected: copy it with the keyboard.`);
    }
  });
  return [...warnings, element("p", {}, copy, " ", download), shown];
}
