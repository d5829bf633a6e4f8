// One motor: its logs, what the engine says of them, and what may be asked further.

import { Ended, MotorEngine, isQuestion } from "./client.js";
import { isExperiment } from "./drop.js";
import { button, element, errorText } from "./element.js";
import { exportsOf } from "./exports.js";
import { complain, forgive, say } from "./messages.js";
import { questions } from "./questions.js";
import { forget, sectionOf } from "./sections.js";
import { tuning } from "./sliders.js";
import { takenOf } from "./taken.js";

const DIAGNOSIS = "Looks for what a first-order lag does not have: other lags up and down, a ramp of the ESC, a resonance, a delay that varies and more. It takes up to some minutes.";

export class Motor {
  name;
  files = [];
  root = element("div", { className: "motor" });

  #choices;
  #changed;
  // What was read, and what it says; `null` before.
  #taken = null;
  #answered = null;
  #options = {};
  /** Names of runs to which nothing is fitted. */
  #heldOut = [];
  #kind = null;
  #purpose = "force";
  #natural = null;
  #isDiagnosed = false;
  #isDiagnosing = false;
  #engine = new MotorEngine((reason, restored) => this.#broke(reason, restored));
  #job = null;
  // The files that are being read, until they are, and those that wait for what they do not say.
  #next = null;
  #open = null;
  #logs = element("ul", { className: "chips", ariaLabel: "Logs of this motor" });
  #busy = element("div", { className: "busy", hidden: true });
  #asked = element("div");
  #results = element("div", { className: "results" });

  /** `changed` is called where its name or its files are others, or it has none any more. */
  constructor(choices, name, changed) {
    this.#choices = choices;
    this.name = name;
    this.#changed = changed;
    this.root.append(this.#logs, this.#busy, this.#asked, this.#results);
  }

  /** Takes further files: all, or where some are no logs the others. */
  async add(given) {
    forgive();
    await this.#take([...this.#latest, ...(isExperiment(given) ? given : this.#apart(given))], this.#options);
  }

  /** Takes these files in the place of what there is, but for those that are no logs. Gives whether it has taken some. */
  async #take(files, options, heldOut = this.#heldOut) {
    const error = await this.#read(files, options, heldOut);
    const added = files.filter((file) => !this.files.includes(file));
    let isTaken = error === null && this.files === files;
    if (error) {
      const wrong = added.length > 1 && !isExperiment(added) ? await this.#wrong(added, options) : [];
      const rest = files.filter((file) => !wrong.some((one) => one.file === file));
      // By themselves all may be right, and what was said of them wrong.
      if (!wrong.length || wrong.length === added.length) {
        complainOf(added, error);
      } else {
        wrong.forEach(({ file, error: reason }) => complainOf([file], reason));
        const left = await this.#read(rest, options, heldOut);
        if (left) complainOf(added.filter((file) => rest.includes(file)), left);
        isTaken = left === null && this.files === rest;
      }
    }
    if (!this.files.length && !this.#open && !this.#next) this.#changed();
    return isTaken;
  }

  get #latest() {
    return this.#next ?? this.#open ?? this.files;
  }

  /** The same files, each with a name that no other has: runs of several folders are often called alike. */
  #apart(given) {
    const names = new Set(this.#latest.map(({ name }) => name));
    return given.map((one) => {
      const [, stem, end] = one.name.match(/^(.*?)(\.[^.]*)?$/s);
      let { name } = one;
      for (let count = 2; names.has(name); count += 1) name = `${stem} (${count})${end ?? ""}`;
      names.add(name);
      return { ...one, name };
    });
  }

  async #wrong(added, options) {
    const all = await this.#during("looking at each log", () => this.#engine.check(added, options));
    return (all ?? []).filter(({ error }) => error);
  }

  /** Reads these files, and answers; an error that no answer of the reader would mend is given back. */
  async #read(files, options, heldOut) {
    this.#next = files;
    const known = heldOut.filter((name) => files.some((file) => file.name === name));
    const read = await this.#during("reading", (watch) => this.#engine.read(files, options, known, watch));
    // Others are read meanwhile.
    if (this.#next !== files) return null;
    this.#next = null;
    if (!read) return null;
    if (read.error) {
      // A table that is read otherwise may be a log.
      if (!isQuestion(read.error)) return read.error;
      this.#ask(files, options, read.error);
      return null;
    }
    Object.assign(this, { files, name: read.name });
    this.#open = null;
    this.#taken = read;
    this.#answered = null;
    this.#options = options;
    this.#heldOut = known;
    this.#isDiagnosed = false;
    this.#showLogs();
    this.#changed();
    await this.#answer();
    return null;
  }

  get #request() {
    return { kind: this.#kind, purpose: this.#purpose, diagnosis: this.#isDiagnosed };
  }

  async #answer() {
    const request = this.#request;
    // What was found is designed for at once, while a diagnosis goes on.
    const answer = this.#isDiagnosing
      ? await this.#orNull(this.#engine.answer(request))
      : await this.#during("identifying", (watch) => this.#engine.answer(request, watch));
    if (answer) this.#show(answer);
    else if (!this.#answered) this.#results.replaceChildren(element("p", {}, "It was stopped. ", button("Identify", () => this.#answer())));
  }

  async #diagnose() {
    const request = { ...this.#request, diagnosis: true };
    this.#isDiagnosing = true;
    this.#offerDiagnosis();
    const answer = await this.#during("diagnosing", (watch) => this.#engine.answerApart(request, watch));
    this.#isDiagnosing = false;
    this.#offerDiagnosis();
    if (answer?.error) complain(...errorText(answer.error));
    if (!answer || answer.error) return;
    this.#isDiagnosed = true;
    const isOther = request.kind !== this.#kind || request.purpose !== this.#purpose || this.root.contains(document.activeElement);
    this.#show(answer);
    // Something else was chosen meanwhile, and is in sight.
    if (request.kind !== this.#kind || request.purpose !== this.#purpose) await this.#answer();
    if (!isOther) this.root.querySelector("#diagnosis")?.scrollIntoView({ block: "start" });
  }

  /** An export or a file; once more where the engine ended meanwhile. */
  get = async (request) => (await this.#orNull(this.#engine.get(request))) ?? this.#orNull(this.#engine.get(request));

  /** What is answered; `null` where the engine ends before. */
  async #orNull(answer) {
    try {
      return await answer;
    } catch (error) {
      if (error instanceof Ended) return null;
      throw error;
    }
  }

  /** Its compensator, as the text of a file, or the error that says why there is none. */
  compensator() {
    return this.get({ ask: "file", name: "compensator.toml" });
  }

  close() {
    this.#engine.close();
    forget(this.root);
  }

  // What takes time, with what is done now and a way to stop it.
  async #during(text, job) {
    this.#stop();
    const mine = {};
    this.#job = mine;
    const stage = element("span", { textContent: `${text} …` });
    const count = element("span", { className: "count", ariaHidden: "true" });
    const start = performance.now();
    let steps = 0;
    const tick = () => {
      const seconds = Math.round((performance.now() - start) / 1000);
      count.textContent = [steps ? `${steps} steps` : "", seconds ? `${seconds} s` : ""].filter(Boolean).join(", ");
    };
    const clock = setInterval(tick, 500);
    this.#busy.replaceChildren(element("progress", { ariaLabel: `${this.name}: ${text}` }), stage, count, button("Stop", () => this.#stop()));
    this.#busy.hidden = false;
    say(`${this.name}: ${text} …`);
    try {
      const answer = await job((name, done) => {
        if (stage.textContent !== `${name} …`) {
          stage.textContent = `${name} …`;
          say(`${this.name}: ${name} …`);
        }
        steps = done;
        tick();
      });
      say("");
      return answer;
    } catch (error) {
      if (!(error instanceof Ended)) throw error;
      if (error.reason === null && this.#job === mine) say(`${this.name}: stopped.`);
      return null;
    } finally {
      clearInterval(clock);
      if (this.#job === mine) {
        this.#job = null;
        this.#busy.hidden = true;
      }
    }
  }

  #stop() {
    if (this.#job) this.#engine.cancel();
  }

  async #broke(reason, restored) {
    const then = restored
      ? `Another one was started${this.files.length ? ", which reads the files again" : ""}.`
      : "What was found before stands; ask for the diagnosis again, or hold fewer rows of the log.";
    complain(element("p", { className: "headline", textContent: `The engine of ${this.name} stopped: ${reason}. ${then}` }));
    if (!restored) return;
    try {
      await restored;
      if (this.files.length) say(`${this.name}: its files were read again.`);
    } catch (error) {
      if (!(error instanceof Ended)) throw error;
      complain(element("p", { textContent: `${this.name} could not be read again. Remove it, and drop its logs anew.` }));
    }
  }

  #showLogs() {
    this.#asked.replaceChildren();
    // An experiment's folder is one.
    const shown = isExperiment(this.files) ? [{ name: `${this.name}, ${this.files.length} files`, file: null }] : this.files;
    const hadFocus = this.#logs.contains(document.activeElement);
    const { heldOut } = document.activeElement.dataset;
    this.#logs.replaceChildren(...shown.map((file) => element("li", {},
      element("span", { className: "mono", textContent: file.name }),
      shown.length > 1 ? this.#holdOut(file) : null,
      button("✕", () => this.#remove(file), { className: "remove", ariaLabel: `Remove ${file.name}`, title: `Remove ${file.name}` }))));
    const focused = [...this.#logs.querySelectorAll("input")].find((box) => box.dataset.heldOut === heldOut);
    if (hadFocus) (focused ?? this.#logs.querySelector("button")).focus();
  }

  /** Whether a run is kept from the fit, to judge it. */
  #holdOut({ name }) {
    const box = element("input", { type: "checkbox", checked: this.#heldOut.includes(name) });
    box.dataset.heldOut = name;
    box.addEventListener("change", async () => {
      forgive();
      const others = this.#heldOut.filter((one) => one !== name);
      await this.#take(this.#latest, this.#options, box.checked ? [...others, name] : others);
      box.checked = this.#heldOut.includes(name);
    });
    return element("label", { className: "check", title: "Nothing is fitted to it: it judges what the others gave" }, box, " held out");
  }

  async #remove(file) {
    forgive();
    const files = this.files.filter((one) => one !== file);
    if (!files.length || isExperiment(this.files)) {
      this.#stop();
      this.files = [];
      this.#open = null;
      this.#changed();
      return;
    }
    const waiting = this.#latest.filter((one) => !this.files.includes(one));
    await this.#take(files, this.#options);
    if (waiting.length) await this.#take([...this.files, ...waiting], this.#options);
  }

  /** Asks what the log does not say. */
  #ask(files, options, error) {
    this.#open = files;
    const form = questions({
      choices: this.#choices,
      columns: error.columns?.length ? error.columns : this.#columns(),
      options,
      missing: error.missing ?? [],
      answered: (said) => {
        forgive();
        this.#take(this.#latest, said);
      },
      left: () => {
        this.#open = null;
        this.#asked.replaceChildren();
        if (!this.files.length) this.#changed();
      },
    });
    const [message, ...help] = errorText(error);
    message.className = "headline";
    this.#asked.replaceChildren(element("section", { className: "verdict warn ask", ariaLabel: "What the log does not say" },
      element("div", { attributes: { role: "alert" } }, message, help), form));
    form.querySelector("select, input")?.focus();
  }

  #columns() {
    return [...new Set((this.#taken?.logs ?? []).flatMap(({ columns }) => columns.map(({ name }) => name)))];
  }

  #show(answer) {
    forget(this.#results);
    const about = this.#aboutLogs();
    if (answer.error) {
      this.#answered = null;
      this.#results.replaceChildren(element("section", { className: "verdict bad", ariaLabel: "Verdict", attributes: { role: "alert" } },
        ...errorText(answer.error)), about);
      if (answer.error.missing?.length) this.#ask(this.files, this.#options, answer.error);
      this.#changed();
      return;
    }
    this.#answered = answer;
    const { verdict, sections, warnings, done, commands } = answer;
    const isFlown = sections[0]?.name === "to_fly";
    const rest = isFlown ? sections.slice(1) : sections;
    const links = [
      ...sections.map(({ name, title }) => [name, title]),
      ...(this.#isDiagnosed ? [] : [["diagnosis", "Diagnosis"]]),
      ["keep", "Take it along"],
    ];
    const { kept } = this.#results.contains(document.activeElement) ? document.activeElement.dataset : {};
    this.#results.replaceChildren(
      element("div", { innerHTML: verdict.html }),
      about,
      element("nav", { ariaLabel: "Contents" }, element("ul", {}, links.map(([name, title]) => element("li", {}, element("a", { href: `#${name}`, textContent: title }))))),
      ...(isFlown ? [this.#tuning(answer)] : []),
      element("div", { innerHTML: warnings }),
      ...rest.map(sectionOf),
      ...(this.#isDiagnosed ? [] : [this.#diagnosisOffer()]),
      element("div", { id: "keep" }, exportsOf(this.#choices, this.get)),
      element("div", { innerHTML: done }),
      commandList(commands));
    this.#changed();
    // Who chose by keyboard chooses on.
    if (kept) this.#results.querySelector(`[data-kept="${kept}"]:checked`)?.focus({ preventScroll: true });
    say(`${this.name}: done.`);
  }

  #aboutLogs() {
    const form = questions({
      choices: this.#choices,
      columns: this.#columns(),
      options: this.#options,
      answered: (said) => {
        forgive();
        this.#take(this.#latest, said);
      },
    });
    return element("div", { className: "about" }, takenOf(this.#taken),
      isExperiment(this.files) ? null : element("details", {}, element("summary", { textContent: "Say what is in it" }), form));
  }

  #tuning(answer) {
    return tuning({
      choices: this.#choices,
      answer,
      kind: this.#kind,
      purpose: this.#purpose,
      natural: this.#natural,
      fly: async (request) => {
        this.#kind = "inverse";
        this.#purpose = request.purpose;
        this.#natural = request.natural_rad_s;
        const ask = () => this.#orNull(this.#engine.fly(request));
        // Once more where the engine ended meanwhile.
        const flown = (await ask()) ?? (await ask());
        const shown = this.#results.querySelector(".commands");
        if (flown?.commands) shown?.replaceWith(commandList(flown.commands, shown.open));
        return flown;
      },
      design: ({ kind, purpose }) => {
        this.#kind = kind;
        this.#purpose = purpose;
        this.#answer();
      },
    });
  }

  #diagnosisOffer() {
    return element("section", { className: "offer", id: "diagnosis" },
      element("h2", { textContent: "Diagnosis" }), element("p", { textContent: DIAGNOSIS }),
      button("Diagnose", () => this.#diagnose(), { className: "main diagnose", disabled: this.#isDiagnosing }));
  }

  #offerDiagnosis() {
    const offer = this.#results.querySelector(".diagnose");
    if (offer) offer.disabled = this.#isDiagnosing;
  }
}

function complainOf(files, error) {
  const names = files.map(({ name }) => name).join(", ");
  complain(...(names ? [element("p", { className: "headline", textContent: `Not taken: ${names}` })] : []), ...errorText(error));
}

function commandList(commands, open = false) {
  const shown = commands.length
    ? element("pre", {}, element("code", { textContent: commands.join("\n") }))
    : element("p", { textContent: "No command holds runs out: a folder that `rotorlead import` made says of each record what it is for (`role` in experiment.toml)." });
  return element("details", { className: "commands", open }, element("summary", { textContent: "The same on the command line" }), shown);
}
