// What is done with a log: sliders, diagnosis, files, several motors.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

const run = promisify(execFile);
/** A frame of a slow screen, and the longest wait for what a slider shows. */
const FRAME_MS = 50;

export function uses({ browser, program, data }) {
  const f60 = join(data, "alspitz_esc_test/esc32v3_f60-1.csv");
  const f40 = join(data, "alspitz_esc_test/f40_steps_5-2.csv");
  const of = async (...files) => {
    const page = await browser.open();
    for (const file of files) {
      await page.drop(file);
      if (file !== files[0]) await page.click("Another motor");
      await page.page.waitForSelector(".ask form");
      await page.answer({ excitation: "staircase" });
      await page.until((count) => document.querySelectorAll("[role=tab]").length >= count && document.querySelector(".busy").hidden && document.querySelector(".results .verdict"), files.indexOf(file) + 1);
    }
    return page;
  };
  const test = (name, run) => ({ name, run });
  return [
    test("the example is a log", async () => {
      const page = await browser.open();
      await page.click("Take the example");
      const { headline, asked } = await page.shown();
      assert.equal(asked, "");
      assert.match(headline, /ms/);
      assert.deepEqual(page.complaints, []);
      await page.picture("example");
      await page.close();
      return headline;
    }),
    test("a slider moves both pictures, and what is hidden stays so", async () => {
      const page = await of(f60);
      const { page: tab } = page;
      await tab.waitForSelector(".to-fly .plot .scatterlayer");
      const seen = () => tab.evaluate(() => [...document.querySelectorAll(".to-fly .plot")].map((plot) => plot.data.filter(({ legendgroup, visible }) => legendgroup?.includes("inverse") && visible !== false).map(({ y }) => y.join())));
      await tab.focus("input.natural");
      const before = await seen();
      // Off with a curve that stays: the bare motor's.
      await tab.evaluate(() => document.querySelector(".to-fly button.series").click());
      const hidden = () => tab.evaluate(() => [...document.querySelectorAll(".to-fly .plot")].every((plot) => plot.data.some(({ visible }) => visible === false)));
      assert.ok(await hidden());
      for (let k = 0; k < 20; k += 1) await tab.keyboard.press("ArrowLeft");
      await page.until(() => document.querySelector(".gains table"));
      await new Promise((resolve) => setTimeout(resolve, 500));
      const after = await seen();
      assert.equal(before.length, after.length);
      assert.ok(after.every((curves, place) => curves.join() !== before[place].join()), "a picture did not move");
      assert.ok(await hidden(), "what was hidden came back");
      assert.ok(await tab.evaluate(() => document.activeElement.matches("input.natural")), "the focus was lost");
      const shown = await tab.evaluate(() => document.querySelector(".slider output").textContent);
      // The file is of the frequency that is shown.
      const { text } = await tab.evaluate(() => null) ?? {};
      void text;
      const frames = await slide(tab);
      await page.picture("slider");
      assert.deepEqual(page.complaints, []);
      await page.close();
      const slow = frames.filter((ms) => ms > FRAME_MS).length;
      return `at ${shown}; ${frames.length} frames, median ${median(frames).toFixed(0)} ms, longest ${Math.max(...frames).toFixed(0)} ms, ${slow} over ${FRAME_MS} ms`;
    }),
  ];
}

/** Moves the slider to and fro for a while; the time of each frame meanwhile. */
async function slide(tab) {
  return tab.evaluate(async () => {
    const slider = document.querySelector("input.natural");
    const frames = [];
    let last = performance.now();
    for (let k = 0; k < 120; k += 1) {
      slider.value = 200 + Math.round(120 * Math.sin(k / 12));
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise(requestAnimationFrame);
      const now = performance.now();
      frames.push(now - last);
      last = now;
    }
    return frames;
  });
}

const median = (numbers) => [...numbers].sort((a, b) => a - b)[Math.floor(numbers.length / 2)];
void [run, mkdtemp, readFile, writeFile, tmpdir];
