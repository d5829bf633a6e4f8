// The page: logs in, what they say out.

import { Engine } from "./client.js";
import { deviceSection } from "./device.js";
import { dropPlace, formatList } from "./drop.js";
import { element } from "./element.js";
import { complain, say, showMessages } from "./messages.js";
import { Motors } from "./motors.js";

// `rotorlead sample` writes it, too.
const SAMPLE = "staircase.csv";

document.getElementById("unstarted").remove();
showMessages(document.getElementById("messages"));

const engine = new Engine();
const choices = engine.ask({ choose: true });
const motors = choices.then((found) => new Motors(document.getElementById("motors"), found));

const logs = document.getElementById("logs");
dropPlace(logs, {
  taken: async (groups) => (await motors).take(groups),
  sample: async () => {
    const response = await fetch(SAMPLE);
    if (!response.ok) throw new Error(`${SAMPLE}: ${response.status} ${response.statusText}`);
    const file = new File([await response.blob()], SAMPLE);
    await (await motors).take([[{ name: SAMPLE, file }]]);
  },
});

// Whatever was not foreseen is said, and not kept from who waits.
addEventListener("unhandledrejection", ({ reason }) => complain(element("p", { className: "headline", textContent: String(reason?.message ?? reason) })));

deviceSection(document.getElementById("device"), { compensator: async () => (await motors).shown?.compensator() });

say("Starting …");
const { formats } = await choices;
logs.append(formatList(formats));
say("");
// A browser that keeps no files, or may not, needs the network as before.
navigator.serviceWorker?.register("offline.js", { updateViaCache: "none" }).catch(() => {});
document.documentElement.dataset.ready = "true";
performance.mark("ready");
engine.end();
