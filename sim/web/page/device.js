// The box: what it is and does, its compensator, and the tuning of its motors.

import { Line, whatIsMissing } from "./device-line.js";
import { live } from "./device-live.js";
import { tuning } from "./device-tune.js";
import { button, element, errorText, newId, sentence } from "./element.js";

// A few times a second: a number that changes more often is not read.
const LIVE_MS = 300;
const HIDDEN = "The page was hidden while motors turned: it has stopped them and let go of the box. Keep it in sight, and connect again.";
const NO_COMPENSATOR = { message: "no compensator is designed yet", help: "drop a log first and show its motor, or tune the motors below" };
const NOT_CONNECTED = "Not connected.";
const STOPPED = "You stopped the motors. Connect again to go on.";

/**
 * Fills the section of the box. `compensator` gives a promise of the compensator that was designed: its `text`, or the `error` that says why there is none,
 * or nothing before a log is shown; `limitS` is how long an answer of the box is waited for.
 */
export function deviceSection(host, { compensator, limitS = 1 }) {
  const missing = whatIsMissing();
  if (missing) {
    host.append(element("p", {}, sentence(missing)));
    return;
  }
  const status = element("p", { className: "status", attributes: { role: "status" } });
  const problem = element("div", { attributes: { role: "alert" } });
  const connected = element("div", { hidden: true });
  // What was measured is there when the box is not any more.
  const files = element("ul", { className: "files", hidden: true, ariaLabel: "Files of the tuning" });
  const start = button("Connect", connect, { className: "main" });
  host.append(
    element("p", {}, sentence("The box between flight controller and ESCs, by its USB cable. What is asked and set here is what `rotorlead device` asks and sets; nothing turns a motor unless the box's bench jumper is fitted.")),
    start, status, problem, connected, files,
  );

  // Said anew it would be read out anew.
  const say = (text) => { if (status.textContent !== text) status.textContent = text; };
  /** Shows what is wrong, or with `null` that nothing is. */
  const complain = (error) => { problem.replaceChildren(...(error ? [element("div", { className: "verdict bad notice" }, element("div", {}, errorText(error)))] : [])); };

  async function connect() {
    complain(null);
    let port;
    try {
      port = await navigator.serial.requestPort();
    } catch (error) {
      // Who closes the list of ports wants none.
      if (error.name !== "NotFoundError") complain({ message: `no port was chosen: ${error.message}` });
      return;
    }
    start.hidden = true;
    say("Connecting…");
    let panel;
    const line = new Line(port, {
      heard: (what) => panel?.heard(what),
      asked: (question) => panel?.asked(question),
      over: (reason) => over(reason, () => panel?.end()),
    });
    try {
      const facts = await line.open(limitS);
      const first = await line.ask({ ask: "info" });
      if (first.error) throw Object.assign(new Error(first.error.message), { help: first.error.help });
      panel = openPanel(line, facts);
      panel.show(first);
      say("Connected.");
    } catch (error) {
      complain(error);
      await line.end(NOT_CONNECTED);
      say(NOT_CONNECTED);
    }
  }

  function over(reason, end) {
    end();
    connected.hidden = true;
    connected.replaceChildren();
    start.hidden = false;
    start.textContent = "Connect again";
    say(reason);
  }

  function openPanel(line, facts) {
    const show = live();
    const lines = element("ul", { className: "box-lines" });
    const faults = element("ul", { className: "box-lines" });
    const settings = element("ul", { className: "box-lines" });
    const setting = settingForm();
    // Whether the box is asked something, and whether by a button.
    let isBusy = false;
    let isAsked = false;
    let isTurning = false;
    // Whether it did not answer when it was last asked for its state.
    let isSilent = false;

    /** Asks what a button is for: its answer, or `null` where the box refuses, which is shown. */
    async function ask(question, saying) {
      if (isAsked) {
        complain({ message: "the box is busy with what was asked before", help: "wait until it is done, or stop it" });
        return null;
      }
      complain(null);
      say(saying);
      isAsked = true;
      // Nobody asks for what it shows while motors are tuned.
      show.table.hidden = question.ask === "tune";
      try {
        const answer = await line.ask(question);
        // Behind a line that was cut the cable is not to be looked at.
        if (answer.error) complain(line.isOver ? { message: answer.error.message } : answer.error);
        if (!line.isOver) say("");
        return answer.error ? null : answer;
      } catch {
        // The line is over, which is said already.
        return null;
      } finally {
        isAsked = isTurning = show.table.hidden = false;
      }
    }

    const tune = tuning({ ask, answer: (typed) => line.answer(typed), stop: () => line.cut(STOPPED), say, files });

    function settingForm() {
      const none = "as it is";
      const choice = (label, options) => {
        const id = newId("box");
        const select = element("select", { id }, options.map(([value, text]) => element("option", { value, textContent: text })));
        return [element("div", { className: "field" }, element("label", { htmlFor: id, textContent: label }), select), select];
      };
      const motors = Array.from({ length: facts.motors }, (_, motor) => [String(motor), `motor ${motor}`]);
      const [motorField, motor] = choice("Time constants of an inverse for", [["", "every motor"], ...motors]);
      const [pathField, path] = choice("Compensator in the path of", [["", none], ["*", "every motor"], ...motors]);
      const [protocolField, protocol] = choice("Protocol of the ESCs", [["", none], ...facts.protocols.map((name) => [name, name])]);
      const done = element("div", { attributes: { role: "status" } });
      const pairs = () => [
        ...(path.value ? [[`motor.${path.value}.compensate`, "true"]] : []),
        ...(protocol.value ? [["output.protocol", protocol.value]] : []),
      ];
      const setTo = async (question) => {
        done.replaceChildren();
        const answer = await ask(question, "Setting…");
        if (answer) done.replaceChildren(...whatWasSet(answer));
      };
      const set = button("Set the compensator", async () => {
        set.disabled = true;
        say("Designing…");
        const { text, error } = (await compensator()) ?? { error: NO_COMPENSATOR };
        set.disabled = false;
        say("");
        if (error) complain(error);
        else await setTo({ ask: "set", compensator: text, motor: motor.value === "" ? null : Number(motor.value), pairs: pairs() });
      }, { className: "main" });
      const setRest = button("Set the choices alone", async () => {
        if (pairs().length === 0) complain({ message: "nothing is chosen", help: "choose a path or a protocol" });
        else await setTo({ ask: "set", compensator: null, motor: null, pairs: pairs() });
      });
      const save = button("Store in the box", async () => {
        if (await ask({ ask: "save" }, "Storing…")) done.replaceChildren(element("p", { textContent: "Stored: the box has these settings at its next start." }));
      });
      return element("div", {},
        element("h3", { textContent: "Compensator" }),
        element("p", {}, sentence("The one that is shown above. It holds until the power goes, unless it is stored.")),
        element("div", { className: "fields" }, motorField, pathField, protocolField),
        element("p", { className: "choices" }, set, setRest, save), done);
    }

    function list(place, entries) {
      place.replaceChildren(...entries.map(({ text, is_warning }) => element("li", { className: is_warning ? "refused" : "", textContent: is_warning ? `Warning: ${text}` : text })));
    }

    function unfolded(title, place, load) {
      const details = element("details", { on: { toggle: () => details.open && load() } }, element("summary", { textContent: title }), place);
      return details;
    }

    connected.replaceChildren(
      element("h3", { textContent: "State" }), lines, show.table,
      unfolded("What went wrong since its start", faults, async () => {
        const answer = await ask({ ask: "faults" }, "Asking…");
        if (answer) list(faults, answer.lines.map((text) => ({ text })));
      }),
      unfolded("All settings", settings, async () => {
        const answer = await ask({ ask: "get" }, "Asking…");
        if (answer) list(settings, Object.entries(answer.settings).map(([key, value]) => ({ text: `${key} = ${value}` })));
      }),
      setting, tune.element,
      element("p", { className: "choices" }, button("Disconnect", () => line.cut("Disconnected."))),
    );
    connected.hidden = false;

    const shown = (answer) => {
      // The table has what the lines say of motors.
      list(lines, answer.lines.filter(({ text, is_warning }) => is_warning || !text.startsWith("motor ")));
      show.update(answer.motors);
    };
    const timer = setInterval(async () => {
      if (isBusy || isAsked || document.hidden) return;
      isBusy = true;
      try {
        const answer = await line.ask({ ask: "info" });
        // Not as what is wrong: that may be of what was asked by a button.
        if (answer.error) say(["No news of the box", answer.error.message, answer.error.help].filter(Boolean).join(": "));
        else if (isSilent) say("");
        isSilent = Boolean(answer.error);
        // What it did last is not what it does now.
        if (!isAsked) show.table.hidden = isSilent;
        if (!isSilent) shown(answer);
      } catch {
        // The line is over, which is said already.
      } finally {
        isBusy = false;
      }
    }, LIVE_MS);

    const hide = () => { if (isTurning && document.hidden) line.cut(HIDDEN); };
    const leave = () => line.cut("The page was left.");
    document.addEventListener("visibilitychange", hide);
    addEventListener("pagehide", leave);

    return {
      show: shown,
      asked: tune.asked,
      heard(what) {
        isTurning = what.turning ?? isTurning;
        hide();
        tune.heard(what);
      },
      end() {
        clearInterval(timer);
        document.removeEventListener("visibilitychange", hide);
        removeEventListener("pagehide", leave);
      },
    };
  }
}

function whatWasSet({ set, warnings }) {
  return [
    element("p", { textContent: "Set until the power goes:" }),
    element("ul", { className: "box-lines" }, Object.entries(set).map(([key, value]) => element("li", { textContent: `${key} = ${value}` }))),
    ...warnings.map((text) => element("p", { className: "refused", textContent: `Warning: ${text}` })),
  ];
}
