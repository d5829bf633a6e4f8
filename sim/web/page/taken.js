// What was taken of each log, and why.

import { element, sentence } from "./element.js";

/** The tables of what `read` answered; of an experiment's folder, which says itself what it is, there is none. */
export function takenOf({ logs, findings }) {
  if (!logs) return null;
  const count = logs.length === 1 ? "the log" : `${logs.length} logs`;
  return element("details", { className: "taken" },
    element("summary", { textContent: `What was taken of ${count}, and why` }),
    logs.map(oneLog),
    findings.length ? element("ul", {}, findings.map((finding) => element("li", {}, sentence(words(finding))))) : null);
}

function oneLog(log) {
  const { file, format, rows_read: read, rows_taken: taken, columns, dropped, timing, notes } = log;
  const facts = [`${format}: ${taken} of ${read} rows taken.`, ...(timing ? [`Times: ${timing.method}.`] : [])];
  const left = dropped.map(({ rows, reason }) => `${rows} ${rows === 1 ? "row" : "rows"} left out: ${reason}`);
  const caption = `Columns of ${file}`;
  const cell = (heading, text) => {
    const made = element("td", {}, sentence(text));
    made.dataset.heading = heading;
    return made;
  };
  const rows = columns.map(({ name, taken_as: as, note }) => element("tr", {}, cell("column", name), cell("taken as", as ?? ""), cell("", note)));
  return element("section", { attributes: { "aria-label": file } },
    element("h3", { className: "mono", textContent: file }),
    facts.map((fact) => element("p", {}, sentence(fact))),
    columns.length ? element("div", { className: "table", tabIndex: 0, attributes: { role: "region", "aria-label": caption } },
      element("table", {},
        element("caption", { textContent: caption }),
        element("thead", {}, element("tr", {}, ["column", "taken as", "why"].map((text) => element("th", { textContent: text, scope: "col" })))),
        element("tbody", {}, rows))) : null,
    notes.length || left.length ? element("ul", {}, [...left, ...notes].map((note) => element("li", {}, sentence(note)))) : null);
}

/** A finding is a sentence, or one with its remedy. */
function words(finding) {
  if (typeof finding === "string") return finding;
  return [finding.message, finding.remedy].filter(Boolean).join("; ");
}
