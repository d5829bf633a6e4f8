// What the page's module says of logs and folders, and what the program says of them: both as JSON into a folder, for `cargo xtask web`
// to compare, and how long each took. The program has one thread, as the page's worker has.
//
// node numbers.mjs PAGE PROGRAM DATA OUT DIR...

import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { basename, join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { CASES, typed } from "./cases.mjs";

const [page, program, data, out, ...folders] = process.argv.slice(2);
mkdirSync(join(out, "native"), { recursive: true });
mkdirSync(join(out, "web"), { recursive: true });

// Beside a description by which node takes them for modules.
const modules = resolve(out, "modules");
mkdirSync(modules, { recursive: true });
writeFileSync(join(modules, "package.json"), JSON.stringify({ type: "module" }));
for (const name of ["rotorlead_web.js", "device-host.js", "promises.js"]) copyFileSync(join(page, name), join(modules, name));
await import(pathToFileURL(join(modules, "promises.js")));
const { default: init, Motor } = await import(pathToFileURL(join(modules, "rotorlead_web.js")));
await init({ module_or_path: readFileSync(join(page, "rotorlead_web_bg.wasm")) });

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
  const start = performance.now();
  const motor = new Motor();
  for (const [name, bytes] of one.files) motor.add(name, bytes);
  const ask = (request) => JSON.parse(motor.ask(JSON.stringify(request), () => {}));
  const read = ask({ ask: "read", options: one.options });
  const said = read.error ? read : ask({ ask: "answer", purpose: "force", diagnosis: true });
  const time = performance.now() - start;
  // With a diagnosis the judgement says what it found.
  const alone = read.error ? read : ask({ ask: "answer", purpose: "force", diagnosis: false });
  motor.free();
  const web = { report: said.error ? REFUSED : said.values, identify: alone.identify ?? REFUSED };
  for (const answer of [report.answer, identify.answer, web.report, web.identify]) for (const key of NOT_COMPARED) delete answer[key];
  writeFileSync(join(out, "native", `${one.name}.json`), JSON.stringify({ report: report.answer, identify: identify.answer }));
  writeFileSync(join(out, "web", `${one.name}.json`), JSON.stringify(web));
  if (report.time && !said.error) [nativeTime, webTime] = [nativeTime + report.time, webTime + time];
  console.log(`${one.name}: program ${report.time.toFixed(0)} ms, page ${time.toFixed(0)} ms${said.error ? `, refused: ${said.error.message}` : ""}`);
}
console.log(`in all: program ${nativeTime.toFixed(0)} ms, page ${webTime.toFixed(0)} ms, ${(webTime / nativeTime).toFixed(2)} times as long`);
