// Drives the page in headless Chromium: node run.mjs FOLDER_OF_PAGE NODE_MODULES ROTORLEAD_PROGRAM DATA_FOLDER
//
// Prints a line for each test; exit status 1 where one failed. With `SHOTS=DIR` in the environment pictures of the page go there. A further
// argument runs only those tests whose names have it.

import assert from "node:assert/strict";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

import { Browser } from "./browser.mjs";
import { judgements } from "./judgements.mjs";
import { looks } from "./looks.mjs";
import { mishaps } from "./mishaps.mjs";
import { requestsOf } from "./net-log.mjs";
import { serve, served } from "./program.mjs";
import { uses } from "./uses.mjs";

const AT_A_TIME = 2;

const [folder, modules, program, data] = process.argv.slice(2, 6).map((path) => resolve(path));
const [only] = process.argv.slice(6);
if (!data) throw new Error("give the page's folder, node_modules, the program rotorlead and the folder of data");

const server = await serve(program);
const scratch = await mkdtemp(join(tmpdir(), "net-"));
const log = join(scratch, "log.json");
const browser = await Browser.start(modules, server.address, log);
const given = { browser, folder, program, data, server };
const tests = [mishaps, judgements, uses, looks, served].flatMap((some) => some(given)).filter(({ name }) => !only || name.includes(only));
const start = performance.now();
let failed = 0;
const perform = async ({ name, run }) => {
  const from = performance.now();
  const seconds = () => ((performance.now() - from) / 1000).toFixed(1);
  try {
    const said = await run();
    console.log(`ok    ${name}, ${seconds()} s${said ? `: ${said}` : ""}`);
  } catch (error) {
    failed += 1;
    console.log(`FAIL  ${name}, ${seconds()} s\n${error.stack}`);
  }
};
const next = tests[Symbol.iterator]();
const runner = async () => {
  for (const test of next) await perform(test);
};
await Promise.all(Array.from({ length: AT_A_TIME }, runner));
await browser.close();
server.close();
await perform({
  name: "no request leaves this machine, by the log of the browser",
  run: async () => {
    const requests = await requestsOf(log);
    const own = /^http:\/\/127\.0\.0\.1:\d+\//;
    // What a worker takes is among them.
    assert.ok(requests.some((url) => own.test(url) && url.endsWith("/rotorlead_web.js")), "the log has not the requests of a worker");
    assert.deepEqual(requests.filter((url) => !own.test(url) && !/^(data|blob|file):/.test(url)), []);
    return `${requests.length} addresses`;
  },
});
await rm(scratch, { recursive: true });
console.log(`${tests.length + 1} tests, ${failed} failed, ${((performance.now() - start) / 1000).toFixed(1)} s`);
process.exit(failed || !tests.length ? 1 : 0);
