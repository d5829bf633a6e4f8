// The conversation with the box, in a thread of its own: its program waits for the line as it does on a desktop.

import init, { Device, facts } from "./rotorlead_web.js";
import { take } from "./device-host.js";

let device = null;
// One question after the other.
let last = Promise.resolve();

async function answer({ open, ask }) {
  if (open) device = new Device(open.name, open.limitS);
  return open ? {} : JSON.parse(await device.ask(JSON.stringify(ask)));
}

addEventListener("message", ({ data }) => {
  if (data.id === undefined) {
    take(data);
    return;
  }
  last = last.then(async () => {
    try {
      postMessage({ id: data.id, answer: await answer(data) });
    } catch (error) {
      postMessage({ broken: String(error?.message ?? error) });
    }
  });
});

try {
  await init({ module_or_path: new URL("rotorlead_device_bg.wasm", import.meta.url) });
  postMessage({ facts: JSON.parse(facts()) });
} catch (error) {
  postMessage({ broken: String(error?.message ?? error) });
}
