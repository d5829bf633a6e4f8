// What comes in and goes out at each motor, as it changes.

import { element } from "./element.js";

const COLUMNS = ["Motor", "State", "Input", "Output", "Compensator"];

/** A table, and what fills it. */
export function live() {
  const body = element("tbody");
  const table = element("table", { className: "box-live" },
    element("caption", { textContent: "Input and output of each motor, now" }),
    element("thead", {}, element("tr", {}, COLUMNS.map((name) => element("th", { scope: "col", textContent: name })))),
    body);
  const update = (motors) => body.replaceChildren(...motors.map((motor, number) => element("tr", {},
    element("th", { scope: "row", textContent: String(number) }),
    element("td", { textContent: motor.state }),
    element("td", {}, level(motor.input, motor.input_hz, "none")),
    element("td", {}, level(motor.output, motor.output_hz, "no pulse")),
    element("td", { textContent: motor.compensates ? "in the path" : "not in the path" }))));
  return { table: element("div", { className: "wide" }, table), update };
}

function level(value, hz, none) {
  const rate = hz > 0 ? ` at ${hz} Hz` : "";
  const percent = `${(100 * value).toFixed(1)} %`;
  return value === null ? [none] : [element("meter", { min: 0, max: 1, value, ariaLabel: percent }), ` ${percent}${rate}`];
}
