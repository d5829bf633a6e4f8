// How the page looks and is reached: sizes, widths, dark, by keyboard, by those who do not see it, on paper.

import assert from "node:assert/strict";
import { readFile, readdir } from "node:fs/promises";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { gzipSync } from "node:zlib";

import { NARROW, WIDE } from "./browser.mjs";

/** Most that is loaded without the library for figures, compressed. */
const LOADED_MB = 3;

export function looks({ browser, folder, data }) {
  const f60 = join(data, "alspitz_esc_test/esc32v3_f60-1.csv");
  // Its columns have no known names.
  const open = join(data, "cases/interleaved-series/log.csv");
  const test = (name, run) => ({ name, run });
  const answered = async (options) => {
    const page = await browser.open(options);
    await page.take(f60);
    return page;
  };
  const seen = (name, options) => test(`it is whole and without barriers: ${name}`, async () => {
    const page = await browser.open(options);
    await page.picture(`start-${name}`);
    const barriers = await page.barriers();
    await page.drop(open);
    await page.page.waitForSelector(".ask form");
    await page.picture(`asked-${name}`);
    barriers.push(...(await page.barriers()));
    await page.click("Leave it");
    await page.take(f60);
    await page.page.focus("input.natural");
    await page.page.keyboard.press("ArrowLeft");
    await page.until(() => document.querySelector(".gains table"));
    for (const summary of ["What was taken of the log, and why", "Say what is in it", "The same on the command line"]) await page.click(summary);
    await page.click("Show");
    await page.page.waitForSelector(".exported pre");
    await page.page.waitForSelector(".to-fly .plot text");
    await page.picture(`answered-${name}`);
    barriers.push(...(await page.barriers()));
    assert.deepEqual(barriers, []);
    const wide = await page.page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
    assert.ok(wide[0] <= wide[1], `the page scrolls sideways: ${wide}`);
    const cut = await page.page.evaluate(() => [...document.querySelectorAll("main *")]
      .filter((one) => one.checkVisibility() && !one.closest(".table, pre, svg, .plot, .listed, select") && one.getBoundingClientRect().right > innerWidth + 1.5)
      .map((one) => one.outerHTML.slice(0, 80)));
    assert.deepEqual(cut, []);
    if (options.dark) {
      const colors = await page.page.evaluate(() => [getComputedStyle(document.body).backgroundColor, getComputedStyle(document.querySelector(".plot text")).fill]);
      const light = (color) => color.match(/[\d.]+/g).slice(0, 3).reduce((sum, part) => sum + Number(part), 0) / 765;
      assert.ok(light(colors[0]) < 0.2 && light(colors[1]) > 0.7, colors.join());
    }
    assert.deepEqual(page.complaints, []);
    await page.close();
  });
  return [
    seen("wide", { viewport: WIDE }),
    seen("narrow", { viewport: NARROW }),
    seen("dark", { viewport: WIDE, dark: true }),
    test("it is small, and starts soon", async () => {
      const names = (await readdir(folder)).filter((name) => !["plotly.js", "staircase.csv", "plotly-license.txt"].includes(name));
      const sizes = await Promise.all(names.map(async (name) => [name, gzipSync(await readFile(join(folder, name)), { level: 9 }).length]));
      const whole = sizes.reduce((sum, [, size]) => sum + size, 0);
      assert.ok(whole < LOADED_MB * 1e6, `${whole} bytes`);
      const [engine] = sizes.filter(([name]) => name.endsWith(".wasm"));
      const starts = [];
      for (let k = 0; k < 3; k += 1) {
        const page = await browser.open();
        starts.push(await page.page.evaluate(() => performance.getEntriesByName("ready")[0].startTime));
        await page.close();
      }
      // Other tests run on the same cores. One that does not start is no page that opens.
      const start = Math.min(...starts);
      return `${(whole / 1e6).toFixed(2)} MB compressed, of which the engine ${(engine[1] / 1e6).toFixed(2)} MB; ready after ${start.toFixed(0)} ms`;
    }),
    test("all of it is reached by keyboard alone", async () => {
      const page = await answered({ viewport: WIDE });
      const { page: tab } = page;
      await tab.evaluate(() => document.body.focus());
      const reached = [];
      for (let k = 0; k < 200; k += 1) {
        await tab.keyboard.press("Tab");
        const at = await tab.evaluate(() => {
          const one = document.activeElement;
          if (one === document.body) return null;
          const { outlineStyle, outlineWidth } = getComputedStyle(one);
          const box = one.getBoundingClientRect();
          return {
            name: (one.getAttribute("aria-label") ?? one.labels?.[0]?.textContent ?? one.textContent).trim().slice(0, 60),
            kind: one.type ?? one.tagName,
            isSeen: outlineStyle !== "none" && parseFloat(outlineWidth) > 0 && box.width > 0 && box.bottom > 0 && box.top < innerHeight,
          };
        });
        if (!at) break;
        reached.push(at);
      }
      assert.deepEqual(reached.filter(({ isSeen }) => !isSeen), [], "focus that is not seen");
      const names = reached.map(({ name }) => name);
      for (const name of ["Choose logs", "Choose a folder", "Take the sample", "esc32v3_f60-1", "Diagnose", "model.toml", "Show"]) {
        assert.ok(names.includes(name), `${name} is not among ${names.join(" | ")}`);
      }
      assert.ok(reached.some(({ kind }) => kind === "range") && reached.some(({ kind }) => kind === "radio"));
      assert.deepEqual(page.complaints, []);
      await page.close();
      return `${reached.length} places`;
    }),
    test("it can be printed", async () => {
      const page = await answered({ viewport: WIDE, dark: true });
      const pdf = await page.page.pdf({ path: process.env.SHOTS && join(process.env.SHOTS, "page.pdf"), format: "A4" });
      const sheets = Buffer.from(pdf).toString("latin1").match(/\/Type \/Page[^s]/g).length;
      assert.ok(sheets >= 2 && sheets < 16, `${sheets} sheets`);
      const undrawn = await page.page.evaluate(() => [...document.querySelectorAll(".plot")].filter((plot) => !plot.querySelector(".scatterlayer path, .barlayer path")).length);
      assert.equal(undrawn, 0);
      assert.deepEqual(page.complaints, []);
      await page.close();
      return `${sheets} sheets`;
    }),
    test("opened as a file it says that this will not do", async () => {
      const page = await browser.open({ address: pathToFileURL(join(folder, "index.html")).href, isReady: false });
      const text = await page.until(() => {
        const one = document.getElementById("unstarted");
        return getComputedStyle(one).visibility === "visible" && one.innerText;
      });
      assert.match(text, /rotorlead serve/);
      await page.picture("file");
      await page.close();
    }),
  ];
}
