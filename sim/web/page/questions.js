// What a log does not say of itself, asked with menus: the options of `rotorlead import`.

import { button, element, newId } from "./element.js";

// Options that are a line of text, with what they are called here.
const NUMBERS = {
  period: ["Period, s", "0.01"],
  nominal: ["Command around which it was run, 0..1", "0.001"],
  amplitude: ["How far the command goes to either side of it, 0..1", "0.001"],
  motor: ["Which motor of several, from 1", "1"],
  "motor-poles": ["Poles of the motor", "1"],
  rate: ["Rows a second, where there are no times", "any"],
  log: ["Which log of several, from 1", "1"],
};
const RANGES = {
  seconds: "Part of the log, s",
  "pulse-us": "Pulse widths of 0 and 1, us",
};

/** A form with everything that can be said; `answered` gets the options, `left` is called where it is not to be said. What `missing` names stands first. */
export function questions({ choices, columns, options, missing = [], answered, left }) {
  const wanted = new Set(missing.map(({ option }) => option));
  if (wanted.has("excitation")) wanted.add("period");
  const fields = [
    ...(columns.length || wanted.has("column") ? [columnsField(choices, columns, options.column ?? [], missing)] : []),
    excitationField(choices, options.excitation, wanted.has("excitation")),
    ...Object.entries(NUMBERS).map(([name, [label, step]]) => numberField(name, label, step, options[name])),
    ...Object.entries(RANGES).map(([name, label]) => rangeField(name, label, options[name])),
    responseField(choices, options.response),
    tareField(options.tare),
  ];
  const [first, rest] = [true, false].map((is) => fields.filter(({ name }) => wanted.has(name) === is));
  const laidOut = (some) => element("div", { className: "fields" }, some.map(({ shown }) => shown));
  const form = element("form", { className: "questions" },
    first.length ? element("fieldset", { className: "wanted" }, element("legend", { textContent: "What it does not say" }), laidOut(first)) : null,
    first.length
      ? element("details", {}, element("summary", { textContent: "What else can be said" }), laidOut(rest))
      : laidOut(rest),
    element("p", { className: "row" }, element("button", { className: "main", textContent: "Read it so" }),
      ...(left ? [" ", button("Leave it", left, { className: "leave" })] : [])));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const said = fields.map(({ name, value }) => [name, value()]);
    answered(Object.fromEntries(said.filter(([, value]) => value !== null && value.length !== 0)));
  });
  // A period is for what repeats.
  const [excitation, period] = ["excitation", "period"].map((name) => fields.find((field) => field.name === name));
  const adapt = () => {
    const kind = choices.excitations.find(({ name }) => name === excitation.value());
    period.shown.hidden = !(kind?.has_period || period.value());
  };
  form.addEventListener("change", adapt);
  adapt();
  return form;
}

function menu(entries, chosen, properties = {}) {
  const options = entries.map(([value, text]) => element("option", { value, textContent: text, selected: value === chosen }));
  return element("select", properties, options);
}

function labeled(label, control) {
  return element("label", {}, element("span", { textContent: label }), control);
}

function excitationField({ excitations }, chosen, required) {
  const open = ["", required ? "choose" : "as the log shows"];
  const control = menu([open, ...excitations.map(({ name }) => [name, name])], chosen, { name: "excitation", required });
  return { name: "excitation", shown: labeled("What drove the command", control), value: () => control.value || null };
}

function responseField({ responses }, chosen) {
  const control = menu([["", "as found"], ...responses.map((name) => [name, name])], chosen, { name: "response" });
  return { name: "response", shown: labeled("Response, where a log has both", control), value: () => control.value || null };
}

function numberField(name, label, step, value = "") {
  const control = element("input", { type: "number", name, value, step, min: "0", attributes: { inputmode: "decimal" } });
  return { name, shown: labeled(label, control), value: () => control.value || null };
}

function rangeField(name, label, value = "") {
  const [from, to] = value.split("..");
  const ends = [["from", from], ["to", to]].map(([end, text]) =>
    element("input", { type: "number", step: "any", value: text ?? "", ariaLabel: `${label}: ${end}` }));
  const shown = element("div", { className: "field", attributes: { role: "group", "aria-label": label } },
    element("span", { textContent: label }), element("span", { className: "pair" }, ends[0], " to ", ends[1]));
  return { name, shown, value: () => (ends.every((end) => end.value) ? ends.map((end) => end.value).join("..") : null) };
}

function tareField(value = false) {
  const control = element("input", { type: "checkbox", name: "tare", checked: value });
  const shown = element("label", { className: "check" }, control, " Subtract the mean thrust at rest");
  return { name: "tare", shown, value: () => (control.checked ? true : null) };
}

/** Which column is what: for each quantity its header, its unit, and whether its sign turns. */
function columnsField({ quantities }, columns, stated, missing) {
  const rows = quantities.map(({ name, units }) => columnRow(name, units, columns, choice(name, stated, missing)));
  const hint = newId("columns");
  const shown = element("div", { className: "columns", attributes: { role: "group", "aria-labelledby": hint } },
    element("p", { id: hint, textContent: "Columns: which is what, and in which unit. What is left open is recognized by its name." }),
    rows.map(({ shown }) => shown));
  return { name: "column", shown, value: () => rows.map(({ value }) => value()).filter(Boolean) };
}

/** What is said of a quantity, or offered as an answer. */
function choice(quantity, stated, missing) {
  const given = stated.find((text) => text.startsWith(`${quantity}=`));
  if (given) {
    const at = given.lastIndexOf(":");
    const unit = given.slice(at + 1);
    return { header: given.slice(quantity.length + 1, at), unit: unit.replace(/^-/, ""), turned: unit.startsWith("-"), isWanted: false };
  }
  const open = missing.find((one) => one.option === "column" && one.quantity === quantity);
  return { header: open?.header ?? "", unit: "", turned: false, isWanted: Boolean(open) };
}

function columnRow(quantity, units, columns, { header, unit, turned, isWanted }) {
  const ariaLabel = `Column of the ${quantity}`;
  const known = columns.includes(header) || !header ? columns : [header, ...columns];
  // Where the columns are not known their names are written.
  const which = known.length
    ? menu([["", isWanted ? "choose" : "by its name"], ...known.map((name) => [name, name])], header, { ariaLabel })
    : element("input", { type: "text", value: header, placeholder: "name in the log", ariaLabel });
  const what = menu([["", "unit"], ...units.map((name) => [name, name])], unit, { ariaLabel: `Unit of the ${quantity}` });
  const sign = element("input", { type: "checkbox", checked: turned, ariaLabel: `Turn the sign of the ${quantity}` });
  const turn = element("label", { className: "check" }, sign, " minus");
  const shown = element("div", { className: isWanted ? "column wanted" : "column" },
    element("span", { className: "quantity", textContent: quantity }), which, what, turn);
  const adapt = () => {
    const isOpen = which.value === "";
    what.required = !isOpen;
    what.hidden = isOpen;
    turn.hidden = isOpen;
  };
  which.addEventListener("input", adapt);
  which.addEventListener("change", adapt);
  adapt();
  return { shown, value: () => (which.value ? `${quantity}=${which.value}:${sign.checked ? "-" : ""}${what.value}` : null) };
}
