// One motor in a thread of its own: its logs, and what was made of them. Whoever wants it to stop ends the thread.

// First: what the engine takes of a browser.
import "./promises.js";
import init, { Motor, choices, fleet } from "./rotorlead_web.js";

let motor = null;

/** Reads files as another motor, which takes the place of the one before it where nothing is wrong. */
async function read(files, ask, watch) {
  const fresh = new Motor();
  for (const { name, file } of files) fresh.add(name, new Uint8Array(await file.arrayBuffer()));
  const answer = JSON.parse(fresh.ask(JSON.stringify(ask), watch));
  const unwanted = answer.error ? fresh : motor;
  if (!answer.error) motor = fresh;
  unwanted?.free();
  return answer;
}

async function answer({ id, choose, compare, files, ask }) {
  const watch = (stage, steps) => postMessage({ id, stage, steps });
  if (choose) return JSON.parse(choices());
  if (compare) return JSON.parse(fleet(JSON.stringify(compare)));
  if (files) return read(files, ask, watch);
  if (!motor) return { error: { message: "no log was taken", help: "answer what the log does not say of itself" } };
  return JSON.parse(motor.ask(JSON.stringify(ask), watch));
}

let start;
const started = new Promise((resolve) => { start = resolve; });
// One question after the other: files are read while others may arrive.
let last = Promise.resolve();

addEventListener("message", ({ data }) => {
  // The first message brings the compiled engine.
  if (data.engine) {
    start(init({ module_or_path: data.engine }));
    return;
  }
  last = last.then(async () => {
    const { id } = data;
    try {
      await started;
      postMessage({ id, answer: await answer(data) });
    } catch (error) {
      // A file that is gone or may not be read leaves the engine as it was; all else is a fault of the engine, which cannot go on.
      if (error instanceof DOMException) postMessage({ id, answer: { error: { message: unread(data.files, error), help: REREAD } } });
      else postMessage({ id, broken: String(error?.message ?? error) });
    }
  });
});

const REREAD = "a file that changed or was moved since it was chosen has to be chosen again";

function unread(files, error) {
  return `${files.map(({ name }) => `\`${name}\``).join(", ")} cannot be read: ${error.message}`;
}
