// What the page's module says of logs and folders, and what the program says of them: both as JSON into a folder, for `cargo xtask web`
// to compare, and how long each took. The program has one thread, as the page's worker has.
//
// node numbers.mjs PAGE NODE_MODULES PROGRAM DATA OUT DIR...

import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";

import { Browser } from "./browser.mjs";
import { CASES, typed } from "./cases.mjs";
import { serve } from "./serve.mjs";

const [page, modules, program, data, out, ...folders] = process.argv.slice(2);
mkdirSync(join(out, "native"), { recursive: true });
mkdirSync(join(out, "web"), { recursive: true });

const server = await serve(page);
const browser = await Browser.start(modules, server.address);
const { page: tab } = await browser.open();
await tab.evaluate(async () => { globalThis.Engine = (await import("/client.js")).Engine; });

/** What an engine of the page's says of files: as they are asked in turn, and how long all of it took. */
async function web(files, questions) {
  const packed = files.map(([name, bytes]) => [name, bytes.toString("base64")]);
  await tab.evaluate((packed, questions) => {
    globalThis.said = null;
    const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const files = packed.map(([name, text]) => ({ name, file: new File([bytes(text)], name) }));
    const ask = async () => {
      const engine = new Engine();
      // Until it has started, which is not of the log.
      await engine.ask({ choose: true });
      const answers = [];
      const start = performance.now();
      for (const [place, question] of questions.entries()) {
        answers.push(await engine.ask({ ...(place ? {} : { files }), ask: question }));
        if (answers.at(-1).error) break;
      }
      engine.end();
      return { answers, time: performance.now() - start };
    };
    ask().then((answered) => { globalThis.said = answered; }, (error) => { globalThis.said = { broken: String(error) }; });
  }, packed, questions);
  for (;;) {
    const said = await tab.evaluate(() => globalThis.said);
    if (said?.broken) throw new Error(said.broken);
    if (said) return said;
    await new Promise((resolve) => { setTimeout(resolve, 50); });
  }
}

/** Longest that the page may take, in times of the program. */
const MOST_TIMES = 3;
// A question that has no answer, and keys of the command line alone: what wrote a file, what it was read from, and clocks that it merged.
const REFUSED = { refused: true };
const NOT_COMPARED = ["generator", "logs", "alignment"];

const named = (path) => [basename(path), readFileSync(path)];
const ofCases = CASES.filter(({ refused }) => !refused).map(({ log, options }) => {
  const path = join(data, log);
  return { name: log.replaceAll("/", "-"), path, files: [named(path)], options };
});
const ofFolders = folders.map((path) => {
  const files = readdirSync(path, { withFileTypes: true }).filter((entry) => entry.isFile()).map(({ name }) => named(join(path, name)));
  return { name: basename(path), path, files, options: {} };
});

const native = (command, { name, path, options }, more) => {
  const answer = join(out, `${command}.json`);
  const stated = [command, path, ...typed(options), "--json", answer, ...more];
  const start = performance.now();
  try {
    execFileSync(program, stated, { stdio: ["ignore", "ignore", "pipe"], env: { ...process.env, RAYON_NUM_THREADS: "1" } });
  } catch {
    return { answer: REFUSED, time: 0 };
  }
  const time = performance.now() - start;
  return { answer: JSON.parse(readFileSync(answer)), time };
};

let [nativeTime, webTime] = [0, 0];
for (const one of [...ofCases, ...ofFolders]) {
  const report = native("report", one, ["--out", join(out, "report.html"), "--force"]);
  const identify = native("identify", one, []);
  const read = { ask: "read", options: one.options };
  const whole = { ask: "answer", purpose: "force", diagnosis: true };
  const { answers: [taken, said = taken], time } = await web(one.files, [read, whole]);
  // With a diagnosis the judgement says what it found.
  const { answers: [, alone = taken] } = await web(one.files, [read, { ...whole, diagnosis: false }]);
  const shown = { report: said.error ? REFUSED : said.values, identify: alone.identify ?? REFUSED };
  for (const answer of [report.answer, identify.answer, shown.report, shown.identify]) for (const key of NOT_COMPARED) delete answer[key];
  writeFileSync(join(out, "native", `${one.name}.json`), JSON.stringify({ report: report.answer, identify: identify.answer }));
  writeFileSync(join(out, "web", `${one.name}.json`), JSON.stringify(shown));
  if (report.time && !said.error) [nativeTime, webTime] = [nativeTime + report.time, webTime + time];
  console.log(`${one.name}: program ${report.time.toFixed(0)} ms, page ${time.toFixed(0)} ms${said.error ? `, refused: ${said.error.message}` : ""}`);
}
console.log(`in all: program ${nativeTime.toFixed(0)} ms, page ${webTime.toFixed(0)} ms, ${(webTime / nativeTime).toFixed(2)} times as long`);
await browser.close();
server.close();
if (!(webTime < MOST_TIMES * nativeTime)) throw new Error(`more than ${MOST_TIMES} times as long`);
