// Asks whose run a log is.

import { button, element } from "./element.js";

/** `"further"` runs of the motor that is shown, `"one"` or `"each"` of other motors, or `null` where it was thought better of. */
export function askWhose(files, shown) {
  const several = files.length > 1;
  const names = files.map(({ name }) => name);
  const answers = [
    ...(shown ? [["further", `${several ? "Further runs" : "A further run"} of ${shown}`]] : []),
    ["one", several ? `Runs of ${shown ? "another" : "one"} motor` : "Another motor"],
    ...(several ? [["each", "Each of another motor"]] : []),
  ];
  return new Promise((resolve) => {
    const close = (answer) => {
      resolve(answer);
      dialog.remove();
    };
    const dialog = element("dialog", { attributes: { "aria-labelledby": "whose" }, on: { close: () => close(null) } },
      element("h2", { id: "whose", textContent: several ? "Of which motors are they?" : "Of which motor is it?" }),
      element("p", { className: "mono", textContent: names.length > 6 ? `${names.slice(0, 5).join(", ")} and ${names.length - 5} more` : names.join(", ") }),
      element("div", { className: "choices" },
        answers.map(([answer, text]) => button(text, () => close(answer), { value: answer })),
        button("Leave it", () => close(null))));
    document.body.append(dialog);
    dialog.showModal();
  });
}
