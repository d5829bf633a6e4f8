// The tuning of motors at the box: its options, its questions, how far it is, and the files that it gives.

import { keep } from "./keep.js";
import { button, element, newId } from "./element.js";

// As on the command line.
const FIELDS = [
  ["motors", "Motors, from 0", "--motors", "0,1,2,3"],
  ["nominal", "Commands of a flight, 0 to 1", "--nominal", ""],
  ["most_rpm", "Speed that no motor may reach, rpm", "--most-rpm", ""],
  ["motor_poles", "Magnets of a motor", "--motor-poles", ""],
  ["amplitude", "Peak deviation of the command", "--amplitude", "0.05"],
  ["periods", "Periods to keep", "--periods", "4"],
  ["divisor", "One row in so many ticks", "--divisor", "5"],
];

/**
 * The form. `ask` asks the box and gives what it says or `null`, `answer` answers its question, `stop` stops the motors, `say` tells how it
 * goes. `files` is the list for what is measured and found.
 */
export function tuning({ ask, answer, stop, say, files }) {
  const inputs = {};
  const fields = FIELDS.map(([name, label, option, value]) => {
    const id = newId("tune");
    inputs[name] = element("input", { id, value, type: "text", autocomplete: "off", spellcheck: false });
    return element("div", { className: "field" }, element("label", { htmlFor: id }, `${label} `, element("code", { textContent: option })), inputs[name]);
  });
  const choice = (label, option, options) => {
    const id = newId("tune");
    const select = element("select", { id }, options.map(([value, text]) => element("option", { value, textContent: text })));
    fields.push(element("div", { className: "field" }, element("label", { htmlFor: id }, `${label} `, element("code", { textContent: option })), select));
    return select;
  };
  const kind = choice("Compensator", "--kind", [["", "what is recommended"], ["inverse", "inverse"], ["lead", "lead"]]);
  const purpose = choice("For", "--purpose", [["force", "a force"], ["rate_loop", "a multirotor's rate loop"]]);
  const check = (label, option) => {
    const input = element("input", { type: "checkbox" });
    return [element("label", { className: "check" }, input, element("span", {}, `${label} `, element("code", { textContent: option }))), input];
  };
  const [rpmLabel, rpm] = check("Correct the inverse by the ESCs' replies", "--rpm");
  const [limitsLabel, acceptLimits] = check("Accept motors that are ready within limits", "--accept-limits");

  const announced = element("p");
  const proposed = element("pre", { className: "box-proposed", hidden: true });
  const bar = element("progress", { hidden: true, max: 1, ariaLabel: "record that is played" });
  const question = questions(answer, stop);
  const stopButton = button("Stop the motors", stop, { className: "main", hidden: true });
  const result = element("div", { attributes: { role: "status" } });
  const start = button("Tune the motors", run);
  const kept = new Map();
  // Until the first file of a tuning those of the one before are there.
  let isNew = true;

  async function run() {
    isNew = true;
    result.replaceChildren();
    announced.textContent = "";
    proposed.hidden = true;
    const options = Object.fromEntries(Object.entries(inputs).map(([name, input]) => [name, input.value]));
    start.disabled = true;
    stopButton.hidden = false;
    const done = await ask({
      ask: "tune", ...options, kind: kind.value || null, purpose: purpose.value, rpm: rpm.checked, accept_limits: acceptLimits.checked,
    }, "Asking the box…");
    start.disabled = false;
    stopButton.hidden = true;
    bar.hidden = true;
    question.close();
    if (!done) return;
    result.replaceChildren(
      element("p", { className: "headline", textContent: "Set and saved. Take the jumper out before a flight." }),
      ...done.warnings.map((text) => element("p", { className: "refused", textContent: `Warning: ${text}` })),
    );
  }

  function heard(what) {
    if (what.announced) announced.textContent = what.announced;
    if (what.proposed) {
      proposed.textContent = what.proposed;
      proposed.hidden = false;
    }
    if (what.file) list(what.file, what.text);
    if (what.total) {
      bar.hidden = false;
      bar.value = what.rows / what.total;
      say(`Motor ${what.motor} turns around ${what.nominal}. Keep this page in sight: where it is hidden, the motors stop.`);
    }
    if (what.turning === false) {
      bar.hidden = true;
      say("No motor turns any more.");
    }
  }

  function list(name, text) {
    if (isNew) {
      files.replaceChildren();
      kept.clear();
      isNew = false;
    }
    if (!kept.has(name)) {
      const link = element("a", { textContent: name, href: "#", on: { click: (event) => save(event, name) } });
      files.append(element("li", {}, link));
      files.hidden = false;
    }
    kept.set(name, text);
  }

  function save(event, name) {
    event.preventDefault();
    keep(name.replaceAll("/", "-"), kept.get(name));
  }

  return {
    element: element("details", { className: "box-tune" },
      element("summary", { textContent: "Tune the motors without a stand" }),
      element("p", { textContent: "The motors turn, one after the other, with their propellers on. Each is measured by its ESC's replies, a compensator is designed for all of them, and the box gets it and stores it. You are asked before anything turns and before anything is set." }),
      element("div", { className: "fields" }, fields), element("p", {}, rpmLabel), element("p", {}, limitsLabel),
      element("p", { className: "choices" }, start, stopButton), announced, bar, proposed, question.element, result),
    asked: question.ask,
    heard,
  };
}

/** A question that nothing but a typed yes confirms. */
function questions(answer) {
  const id = newId("question");
  const text = element("label", { htmlFor: id });
  const input = element("input", { id, type: "text", autocomplete: "off", spellcheck: false });
  const form = element("form", { className: "box-question verdict warn", hidden: true, on: { submit: (event) => { event.preventDefault(); reply(input.value); } } },
    text, input, element("p", { className: "choices" }, element("button", { type: "submit", className: "main", textContent: "Answer" }), button("No", () => reply("no"))));
  const reply = (typed) => {
    close();
    answer(typed);
  };
  const close = () => {
    form.hidden = true;
    input.value = "";
  };
  const ask = (question) => {
    text.textContent = `${question} Type yes:`;
    form.hidden = false;
    input.focus();
  };
  return { element: form, ask, close };
}
