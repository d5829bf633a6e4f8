// What goes wrong loses nothing.

import assert from "node:assert/strict";
import { createWriteStream } from "node:fs";
import { mkdtemp, readFile, rm, stat, writeFile } from "node:fs/promises";
import { once } from "node:events";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { serve } from "./program.mjs";

/** Size of a large log. */
const LARGE_MB = 60;
/** Longest that the page may be deaf while a log is read and identified: some times that of a machine with nothing else to do, and a part of
 * what the work takes. */
const DEAF_MS = 3000;

export function mishaps({ browser, folder, program, data }) {
  const f60 = join(data, "alspitz_esc_test/esc32v3_f60-1.csv");
  const small = join(data, "cases/command-stamps-dropped/log.bin");
  const staircase = join(folder, "staircase.csv");
  const motor = async (options) => {
    const page = await browser.open(options);
    await page.take(f60);
    return page;
  };
  const inFolder = (run) => async () => {
    const folder = await mkdtemp(join(tmpdir(), "page-"));
    try {
      return await run(folder);
    } finally {
      await rm(folder, { recursive: true });
    }
  };
  const test = (name, run) => ({ name, run });
  return [
    test("a wrong file says why, and loses nothing", inFolder(async (folder) => {
      const wrong = join(folder, "notes.txt");
      await writeFile(wrong, "Motor 3 was loud.\nIt was cold.\n");
      const page = await browser.open();
      await page.drop(wrong);
      const alone = await page.shown();
      assert.match(alone.alerts[0], /Not taken: notes.txt/);
      assert.equal(await page.page.$$eval("[role=tab]", (tabs) => tabs.length), 0);
      await page.picture("wrong-file");

      await page.click("Dismiss");
      // The right one of two is taken, as the first of a motor.
      await page.drop(wrong, f60);
      await page.click("Runs of one motor");
      assert.match((await page.shown()).alerts[0], /Not taken: notes.txt/);
      await page.until(() => document.querySelector(".results .verdict"));
      await page.clear();
      const before = await page.take(f60);
      await page.drop(wrong);
      await page.page.waitForSelector("dialog");
      await page.picture("whose", { fullPage: false });
      await page.click("A further run of esc32v3_f60-1");
      await page.until(() => document.querySelector(".alerts .notice"));
      const after = await page.shown();
      assert.match(after.alerts[0], /Not taken: notes.txt/);
      assert.deepEqual({ ...after, alerts: [] }, { ...before, alerts: [] });
      assert.deepEqual(await page.page.$$eval(".chips .mono", (chips) => chips.map((chip) => chip.textContent)), ["esc32v3_f60-1.csv"]);
      // Some of them are right.
      const second = join(folder, "second.csv");
      await writeFile(second, await readFile(f60));
      await page.drop(wrong, second);
      await page.click("Further runs of esc32v3_f60-1");
      await page.until(() => document.querySelectorAll(".chips li").length === 2 && document.querySelector(".busy").hidden);
      await page.click("Remove second.csv");
      await page.until(() => document.querySelectorAll(".chips li").length === 1 && document.querySelector(".busy").hidden);
      assert.equal((await page.shown()).headline, before.headline);
      assert.deepEqual(page.complaints, []);
      await page.close();
      return alone.alerts[0].replaceAll(/\s+/g, " ").slice(0, 120);
    })),
    test(`a log of ${LARGE_MB} MB is read while the page stays alive`, inFolder(async (folder) => {
      const log = join(folder, "large.csv");
      await writeLarge(log);
      const page = await browser.open();
      await page.page.evaluate(() => {
        let last = performance.now();
        window.deaf = 0;
        setInterval(() => {
          const now = performance.now();
          window.deaf = Math.max(window.deaf, now - last);
          last = now;
        }, 20);
      });
      await page.drop(log);
      const start = performance.now();
      await page.page.waitForSelector(".ask form", { timeout: 50_000 });
      const asked = performance.now();
      await page.answer({ excitation: "staircase" });
      const { headline } = await page.shown();
      const done = performance.now();
      const deaf = await page.page.evaluate(() => window.deaf);
      assert.match(headline, /ms/);
      assert.ok(deaf < DEAF_MS, `deaf for ${deaf} ms`);
      assert.deepEqual(page.complaints, []);
      await page.close();
      return `asked after ${((asked - start) / 1000).toFixed(1)} s, answered after ${((done - asked) / 1000).toFixed(1)} s more, deaf for ${deaf.toFixed(0)} ms at the most`;
    })),
    test("a diagnosis is stopped in the middle, and what was there is there", async () => {
      const page = await motor();
      const before = await page.shown();
      await page.click("Diagnose");
      await page.until(() => /\d+ steps/.test(document.querySelector(".busy .count")?.textContent));
      await page.picture("diagnosing", { fullPage: false });
      const start = performance.now();
      await page.click("Stop");
      await page.until(() => document.querySelector(".busy").hidden);
      const stopped = performance.now() - start;
      assert.ok(stopped < DEAF_MS, `${stopped} ms`);
      assert.equal((await page.shown()).verdict, before.verdict);
      assert.match(await page.page.$eval("[role=status]", (status) => status.textContent), /stopped/);
      await worksOn(page);
      await page.close();
      return `stopped after ${stopped.toFixed(0)} ms`;
    }),
    test("without network all goes on, also after the page was loaded again", async () => {
      const other = await serve(program);
      const page = await browser.open({ address: other.address });
      await page.page.evaluate(() => navigator.serviceWorker.ready);
      await page.until(() => Boolean(navigator.serviceWorker.controller));
      other.close();
      for (const isAgain of [false, true]) {
        if (isAgain) await page.page.reload({ waitUntil: "load" });
        await page.page.waitForSelector("html[data-ready]");
        await page.take(f60);
        await worksOn(page);
        await page.settled();
      }
      await page.clear();
      await page.take(small);
      await page.click("Diagnose");
      await page.until(() => document.querySelector("#diagnosis figure") && document.querySelector(".busy").hidden);
      await page.close();
    }),
    test("a diagnosis goes on while something else is chosen", async () => {
      const page = await browser.open();
      await page.take(small);
      await page.click("Diagnose");
      await page.until(() => !document.querySelector(".busy").hidden);
      await page.click("lead", ".radios label");
      await page.until(() => !document.querySelector(".busy").hidden && document.querySelector(".commands code").textContent.endsWith("--kind lead --no-diagnosis"));
      await page.until(() => document.querySelector("#diagnosis figure") && document.querySelector(".busy").hidden);
      const { kind, commands } = await page.page.evaluate(() => ({
        kind: document.querySelector(".radios input[value=lead]").checked,
        commands: document.querySelector(".commands code").textContent,
      }));
      assert.ok(kind && commands.endsWith("--kind lead"), `${kind}: ${commands}`);
      assert.deepEqual(page.complaints, []);
      await page.close();
    }),
    test("a log that waits for an answer is not lost to a further one", inFolder(async (folder) => {
      // A plain table does not say what drove the command.
      const unsaid = join(folder, "unsaid.csv");
      const [, ...rows] = (await readFile(staircase, "utf8")).trim().split("\n").map((row) => row.split(","));
      const plain = rows.map(([time, us, thrust]) => [time, (us - 1000) / 1000, thrust].join());
      await writeFile(unsaid, `${["time_s,command,thrust_n", ...plain].join("\n")}\n`);
      const page = await browser.open();
      await page.drop(unsaid);
      await page.page.waitForSelector(".ask form");
      await page.drop(staircase);
      await page.click("A further run of unsaid.csv");
      await page.until(() => document.querySelector(".busy").hidden && document.querySelector(".ask form"));
      await page.answer({ excitation: "staircase" });
      await page.until(() => document.querySelectorAll(".chips li").length === 2 && document.querySelector(".busy").hidden);
      const names = await page.page.$$eval(".chips .mono", (chips) => chips.map((chip) => chip.textContent));
      assert.deepEqual(names, ["unsaid.csv", "staircase.csv"]);
      assert.deepEqual(page.complaints, []);
      await page.close();
    })),
    test("a worker that fails is replaced, and reads the files again", inFolder(async (folder) => {
      const page = await motor();
      await page.cdp.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder, browserContextId: page.page.browserContext().id });
      await worksOn(page);
      const before = await page.shown();
      for (const fail of [thrown, trapped]) {
        await fail(page);
        await page.until(() => document.querySelector(".alerts .notice"));
        const text = await page.page.$eval(".alerts .notice", (notice) => notice.textContent);
        assert.match(text, /stopped: .*(out of hand|unreachable)/);
        await page.picture(`crash-${fail.name}`, { fullPage: false });
        await page.until(() => /read again/.test(document.querySelector("[role=status]").textContent));
        await page.click("Dismiss");
        assert.equal((await page.shown()).verdict, before.verdict);
        // What was asked when it failed is shown, and what the slider chose before is what a file has.
        await page.settled();
        const [reading, said] = await page.page.evaluate(() => [".slider output", ".says"].map((name) => document.querySelector(name).textContent));
        const chosen = Number.parseFloat(reading);
        assert.ok(said.includes(`natural frequency ${chosen}`), `${reading}: ${said}`);
        const kept = await natural(page, folder);
        assert.ok(Math.abs(kept - chosen) < 1e-6 * chosen, `${kept}: ${reading}`);
        await worksOn(page);
      }
      await page.close();
    })),
  ];
}

/** The natural frequency in the file of the compensator. */
async function natural(page, folder) {
  const text = await page.download("compensator.toml", folder);
  return Number(text.match(/natural_rad_s = ([\d.]+)|omega_f_rad_s = ([\d.]+)/)?.slice(1).find(Boolean));
}

/** What a slider shows and a file are got after a mishap. */
async function worksOn(page) {
  await page.page.focus("input.natural");
  const before = await page.page.$eval(".gains", (gains) => gains.innerHTML);
  await page.page.keyboard.press("ArrowRight");
  await page.page.keyboard.press("ArrowRight");
  await page.until((before) => document.querySelector(".gains").innerHTML !== before, before);
  await page.click("Show");
  await page.until(() => document.querySelector(".exported pre")?.textContent.length > 100);
}

/** The motor's worker fails outside of an answer. */
async function thrown(page) {
  const worker = page.page.workers().at(-1);
  await worker.evaluate(() => {
    setTimeout(() => {
      throw new Error("out of hand");
    });
  });
}

/** The engine traps within an answer, as it does at a panic. */
async function trapped(page) {
  const worker = page.page.workers().at(-1);
  await worker.evaluate(async () => {
    const { Motor } = await import(new URL("rotorlead_web.js", location.href).href);
    // A function whose body is `unreachable`.
    const bytes = [0, 97, 115, 109, 1, 0, 0, 0, 1, 4, 1, 96, 0, 0, 3, 2, 1, 0, 7, 5, 1, 1, 102, 0, 0, 10, 5, 1, 3, 0, 0, 11];
    const { instance } = await WebAssembly.instantiate(new Uint8Array(bytes));
    Motor.prototype.ask = instance.exports.f;
  });
  await page.page.focus("input.natural");
  await page.page.keyboard.press("ArrowLeft");
}

/** A motor of 40 ms on a staircase, a row each millisecond. */
async function writeLarge(path) {
  const out = createWriteStream(path);
  const levels = [0.2, 0.4, 0.6, 0.8, 0.5, 0.3];
  const step = (1 - Math.exp(-1 / 40));
  let speed = 0;
  let size = 0;
  let seed = 1;
  let rows = ["time_s,command,rpm"];
  out.write("");
  for (let row = 0; size < LARGE_MB * 1e6; row += 1) {
    const command = levels[Math.floor(row / 4000) % levels.length];
    speed += step * (20000 * command - speed);
    seed = (seed * 48271) % 2147483647;
    rows.push(`${(row / 1000).toFixed(3)},${command},${(speed + 20 * (seed / 2147483647 - 0.5)).toFixed(4)}`);
    if (rows.length === 50_000) {
      const text = `${rows.join("\n")}\n`;
      size += text.length;
      rows = [];
      if (!out.write(text)) await once(out, "drain");
    }
  }
  out.end();
  await once(out, "finish");
  return (await stat(path)).size;
}
