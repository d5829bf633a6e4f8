// Motors side by side: a tab each, and a comparison where there are two or more.

import { Engine } from "./client.js";
import { element, errorText } from "./element.js";
import { Motor } from "./motor.js";
import { refit, sectionOf } from "./sections.js";
import { askWhose } from "./whose.js";
import { isExperiment } from "./drop.js";

const COMPARISON = "Comparison";

export class Motors {
  #choices;
  #motors = [];
  /** A motor, or the comparison. */
  #shown = null;
  #comparison = element("div", { className: "motor" });
  #comparing = null;
  #tabs = element("div", { className: "tabs", attributes: { role: "tablist", "aria-label": "Motors" } });
  #panel = element("div", { id: "panel", tabIndex: -1 });

  constructor(host, choices) {
    this.#choices = choices;
    host.append(this.#tabs, this.#panel);
    this.#tabs.addEventListener("keydown", (event) => this.#key(event));
  }

  /** Takes lists of files, asking whose they are where that is open. */
  async take(groups) {
    for (const files of groups) await this.#takeOne(files);
  }

  async #takeOne(files) {
    const current = this.#motors.includes(this.#shown) ? this.#shown : null;
    const isOpen = !isExperiment(files) && (current || files.length > 1);
    const whose = isOpen ? await askWhose(files, current?.name) : "one";
    if (whose === "further") await current.add(files);
    if (whose === "one") await this.#start(files);
    if (whose === "each") await Promise.all(files.map((file) => this.#start([file])));
  }

  async #start(files) {
    const motor = new Motor(this.#choices, files[0].name, () => this.#changed(motor));
    this.#motors.push(motor);
    this.#show(motor);
    await motor.add(files);
  }

  /** The motor that is shown; `null` where there is none, or the comparison is. */
  get shown() {
    return this.#motors.includes(this.#shown) ? this.#shown : null;
  }

  #changed(motor) {
    const hadFocus = motor.root.contains(document.activeElement);
    const isOver = !motor.files.length;
    if (isOver) {
      motor.close();
      this.#motors = this.#motors.filter((one) => one !== motor);
      if (this.#shown === motor) this.#shown = this.#motors.at(-1) ?? null;
    }
    if (this.#shown === this.#comparison && this.#motors.length < 2) this.#shown = this.#motors[0] ?? null;
    const wasCompared = this.#shown === this.#comparison && this.#panel.firstChild === this.#comparison;
    this.#show(this.#shown);
    if (wasCompared) this.#compare();
    if (isOver && hadFocus) (this.#tabs.querySelector("#shown-tab") ?? document.querySelector(".drop button")).focus();
  }

  #show(shown) {
    const isOther = this.#shown !== shown || !this.#panel.firstChild;
    this.#shown = shown;
    const several = this.#motors.length > 1;
    const tab = (of, name) => {
      const isShown = of === shown;
      return element("button", { type: "button", id: isShown ? "shown-tab" : "", textContent: name, tabIndex: isShown ? 0 : -1, on: { click: () => this.#show(of) },
        attributes: { role: "tab", "aria-selected": String(isShown), "aria-controls": "panel" } });
    };
    const hadFocus = this.#tabs.contains(document.activeElement);
    this.#tabs.replaceChildren(...this.#motors.map((motor, place) => tab(motor, this.#nameOf(motor, place))), ...(several ? [tab(this.#comparison, COMPARISON)] : []));
    this.#tabs.hidden = !this.#motors.length;
    if (hadFocus) this.#tabs.querySelector("#shown-tab")?.focus();
    const root = shown instanceof Motor ? shown.root : shown;
    if (this.#panel.firstChild !== root) this.#panel.replaceChildren(...(root ? [root] : []));
    for (const [name, value] of Object.entries({ role: "tabpanel", "aria-labelledby": "shown-tab" })) {
      if (root) this.#panel.setAttribute(name, value);
      else this.#panel.removeAttribute(name);
    }
    if (isOther && root) refit(root);
    if (shown === this.#comparison && isOther) this.#compare();
  }

  /** Its own, with its place where another has it too. */
  #nameOf(motor, place) {
    const isAlone = this.#motors.filter(({ name }) => name === motor.name).length === 1;
    return isAlone ? motor.name : `${motor.name} (${place + 1})`;
  }

  async #compare() {
    const mine = this.#comparing = {};
    this.#comparison.replaceChildren(element("p", { textContent: "comparing …" }));
    const models = await Promise.all(this.#motors.map(async (motor, place) => ({ motor: this.#nameOf(motor, place), model: (await motor.get({ ask: "file", name: "model.toml" }))?.text })));
    // One of them has changed meanwhile.
    if (this.#comparing !== mine) return;
    const engine = new Engine();
    const answer = await engine.ask({ compare: models.filter(({ model }) => model) }).catch((error) => ({ error: { message: String(error.message) } }));
    engine.end();
    if (this.#comparing !== mine) return;
    const without = models.filter(({ model }) => !model).map(({ motor }) => motor);
    const left = without.length ? [element("p", { className: "left", textContent: `Not compared, as there is no model yet: ${without.join(", ")}.` })] : [];
    this.#comparison.replaceChildren(...left, ...(answer.error
      ? [element("section", { className: "verdict bad", attributes: { role: "alert" } }, ...errorText(answer.error))]
      : [element("div", { innerHTML: answer.verdict }), sectionOf(answer.section)]));
  }

  #key(event) {
    const tabs = [...this.#tabs.children];
    const at = tabs.indexOf(document.activeElement);
    const next = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: tabs.length - 1 }[event.key];
    if (next === undefined) return;
    event.preventDefault();
    tabs.at(next % tabs.length).click();
  }
}
