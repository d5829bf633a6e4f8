// What to fly, while its natural frequency and its purpose are tried.

import { element, newId, sentence } from "./element.js";
import { showSection } from "./sections.js";

const STEPS = 400;
const PURPOSES = [["force", "force"], ["rate_loop", "rate loop"]];
const KINDS = [["", "recommended"], ["lead", "lead"], ["inverse", "inverse"]];

/**
 * The two pictures, with what changes them. `fly` asks the engine what an inverse gains, `design` asks it to design another kind or for another
 * purpose, and shows the answer.
 */
export function tuning({ choices, answer, kind, purpose, natural: tried, fly, design }) {
  const [low, high] = choices.naturals_rad_s.map(Math.log);
  const place = (natural) => Math.round((STEPS * (Math.log(natural) - low)) / (high - low));
  const natural = () => Math.exp(low + (Number(slider.value) / STEPS) * (high - low));
  const rounded = () => Number(natural().toPrecision(3));

  const slider = element("input", { type: "range", id: newId("natural"), className: "natural", min: 0, max: STEPS, step: 1 });
  slider.value = place(tried ?? answer.natural_rad_s ?? Math.exp((low + high) / 2));
  const reading = element("output", { htmlFor: slider.id });
  const read = () => {
    reading.textContent = `${rounded()} rad/s`;
    slider.setAttribute("aria-valuetext", reading.textContent);
  };
  const pictures = element("div", { className: "part to-fly" });
  const table = element("div", { className: "gains" });
  const says = element("div", { className: "says", attributes: { "aria-live": "polite" } });

  // The last that was asked is shown, and not what was asked while the engine was busy.
  let next = null;
  let busy = false;
  const pump = async () => {
    if (busy) return;
    busy = true;
    controls.setAttribute("aria-busy", "true");
    while (next) {
      const request = next;
      next = null;
      const found = await fly(request);
      if (found && !found.error) show(found);
      else if (found) says.replaceChildren(element("p", { className: "refused" }, sentence(found.error.message)));
      // The browser draws before the next.
      await new Promise(requestAnimationFrame);
    }
    busy = false;
    controls.removeAttribute("aria-busy");
  };
  const show = ({ section, table: html, refused, says: words }) => {
    showSection(pictures, section);
    table.innerHTML = html;
    listTables(table);
    says.innerHTML = words ?? "";
    if (refused) says.prepend(element("p", { className: "refused" }, sentence(refused)));
  };

  // What a slider asked before is not to come behind.
  const designed = (request) => {
    next = null;
    design(request);
  };
  const radios = (legend, entries, chosen, changed) => {
    const name = newId("choice");
    const set = element("fieldset", { className: "radios" }, element("legend", { textContent: legend }),
      entries.map(([value, text]) => element("label", { className: "check" },
        element("input", { type: "radio", name, value, checked: value === chosen, attributes: { "data-kept": legend } }), ` ${text}`)));
    set.addEventListener("change", ({ target }) => changed(target.value));
    return set;
  };
  const ask = () => {
    next = { natural_rad_s: rounded(), purpose };
    pump();
  };
  const kinds = radios("Kind", KINDS, kind ?? "", (value) => {
    kind = value || null;
    if (kind === "inverse") ask();
    else designed({ kind, purpose });
  });
  const purposes = radios("For", PURPOSES, purpose, (value) => {
    purpose = value;
    if (kind === "inverse") ask();
    else designed({ kind, purpose });
  });
  slider.addEventListener("input", () => {
    read();
    kind = "inverse";
    kinds.querySelector('[value="inverse"]').checked = true;
    ask();
  });
  read();

  const [section] = answer.sections;
  showSection(pictures, section);
  const controls = element("div", { className: "tuning", attributes: { role: "group", "aria-label": "What is tried" } },
    element("label", { className: "slider", htmlFor: slider.id }, element("span", { textContent: "Natural frequency of the inverse" }), slider, reading),
    purposes, kinds);
  if (kind === "inverse") ask();
  return element("div", {}, pictures, controls, says, table);
}
