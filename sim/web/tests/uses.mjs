// What is done with a log: sliders, diagnosis, files, exports, several motors.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { copyFile, mkdtemp, readdir, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { promisify } from "node:util";

const run = promisify(execFile);
/** Most frames that may take longer than this while a slider moves. */
const FRAME_MS = 50;

export function uses({ browser, folder, program, data }) {
  const f60 = join(data, "alspitz_esc_test/esc32v3_f60-1.csv");
  const small = join(data, "cases/command-stamps-dropped/log.bin");
  const other = join(data, "cases/motor-2-moves/log.bin");
  const staircase = join(folder, "staircase.csv");
  const test = (name, run) => ({ name, run });
  const ended = async (page) => {
    assert.deepEqual(page.complaints, []);
    await page.close();
  };
  return [
    test("the sample is a log", async () => {
      const page = await browser.open();
      await page.click("Take the sample");
      const { headline, asked } = await page.shown();
      assert.equal(asked, "");
      assert.match(headline, /\d+ ms/);
      await page.picture("sample");
      await ended(page);
      return headline;
    }),
    test("a slider moves both pictures; what is hidden, zoomed and in focus stays so", async () => {
      const page = await browser.open();
      await page.take(f60);
      const { page: tab } = page;
      await tab.focus("input.natural");
      await tab.keyboard.press("ArrowLeft");
      await page.until(() => document.querySelector(".gains table"));
      await page.drawn();
      await tab.focus("input.natural");
      const curves = () => tab.evaluate(() => [...document.querySelectorAll(".to-fly .plot")]
        .map((plot) => plot.data.filter(({ legendgroup }) => legendgroup?.startsWith("inverse")).map(({ y }) => y.join()).join("|")));
      const before = await curves();
      assert.ok(before.length >= 3 && before.every((text) => text.length > 100), "no inverse is drawn");
      // The bare motor's curve is hidden, and the step looked at more closely.
      await tab.evaluate(() => document.querySelector(".to-fly button.series").click());
      await tab.evaluate(() => Plotly.relayout(document.querySelector(".to-fly .plot"), { "xaxis.range": [0, 100] }));
      await tab.evaluate(() => document.querySelector(".to-fly button.cursors").click());
      for (let k = 0; k < 20; k += 1) await tab.keyboard.press("ArrowLeft");
      await page.until((before) => [...document.querySelectorAll(".to-fly .plot")].every((plot, place) => {
        const now = plot.data.filter(({ legendgroup }) => legendgroup?.startsWith("inverse")).map(({ y }) => y.join()).join("|");
        return now && now !== before[place];
      }), before);
      await page.settled();
      const kept = await tab.evaluate(() => ({
        isHidden: [...document.querySelectorAll(".to-fly figure:first-of-type .plot")].every((plot) => plot.data.some(({ visible }) => visible === false)),
        range: document.querySelector(".to-fly .plot").layout.xaxis.range.map(Math.round),
        lines: document.querySelectorAll(".to-fly .plot .shapelayer path").length,
        isFocused: document.activeElement.matches("input.natural"),
        legend: [...document.querySelectorAll(".to-fly button.series")].map((button) => button.textContent),
        reading: document.querySelector(".slider output").textContent,
      }));
      assert.deepEqual({ ...kept, legend: null, reading: null }, { isHidden: true, range: [0, 100], lines: 2, isFocused: true, legend: null, reading: null });
      // The inverse is named after what the slider says.
      const natural = Number.parseFloat(kept.reading);
      assert.ok(kept.legend.some((name) => name === `inverse ${natural.toFixed(0)}`), `${kept.legend} at ${kept.reading}`);
      const frames = await slide(tab);
      await page.settled();
      await page.picture("slider");
      await ended(page);
      const sorted = [...frames].sort((a, b) => a - b);
      const slow = frames.filter((ms) => ms > FRAME_MS).length;
      return `${frames.length} frames, median ${sorted[frames.length >> 1].toFixed(0)} ms, longest ${sorted.at(-1).toFixed(0)} ms, ${slow} over ${FRAME_MS} ms`;
    }),
    test("purpose and kind decide what is designed, and the files are of it", async () => {
      const folder = await mkdtemp(join(tmpdir(), "page-"));
      const page = await browser.open();
      await page.take(small);
      await page.cdp.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: folder, browserContextId: page.page.browserContext().id });
      await page.click("lead", ".radios label");
      await page.settled();
      assert.equal(await page.page.evaluate(() => document.activeElement.parentElement.textContent.trim()), "lead", "the focus was lost");
      const lead = await page.download("compensator.toml", folder);
      assert.match(lead, /^zero_rad_s = /m);
      await page.click("rate loop", ".radios label");
      await page.settled();
      await page.page.focus("input.natural");
      await page.page.keyboard.press("ArrowRight");
      await page.settled();
      const natural = await page.page.$eval(".slider output", (output) => Number.parseFloat(output.textContent));
      const inverse = await page.download("compensator.toml", folder);
      const found = inverse.match(/natural_rad_s = ([\d.]+)|omega_f_rad_s = ([\d.]+)/);
      assert.ok(found && Math.abs(Number(found[1] ?? found[2]) - natural) < 1e-6 * natural, `${natural}: ${inverse.slice(0, 600)}`);
      const model = await page.download("model.toml", folder);
      assert.match(model, /^time_constant_s = /m);
      assert.match(await page.download("compensator.h", folder), /#define|static const|const /);
      assert.match(await page.download("report.html", folder), /^<!doctype html>/);
      // The program takes both.
      await run(program, ["bandwidth", "--model", join(folder, "model.toml"), "--compensator", join(folder, "compensator.toml"), "--json", join(folder, "b.json")]);
      assert.ok((await readdir(folder)).includes("b.json"));
      await rm(folder, { recursive: true });
      await ended(page);
      return `inverse of ${natural} rad/s`;
    }),
    test("every export is shown, or says why there is none", async () => {
      const page = await browser.open();
      await page.take(small);
      const names = await page.page.$$eval(".targets option", (options) => options.map(({ value }) => value));
      const shown = [];
      for (const name of names) {
        await page.page.select(".targets", name);
        await page.click("Show");
        const text = await page.until(() => document.querySelector(".exported")?.innerText);
        assert.ok(text.length > 20, `${name}: ${text}`);
        shown.push(/Download/.test(text) ? name : `${name} (refused: ${text.slice(0, 60)})`);
      }
      assert.ok(shown.filter((one) => !one.includes("refused")).length > names.length / 2, shown.join(", "));
      await page.picture("export");
      await ended(page);
      return shown.join(", ");
    }),
    test("a diagnosis says what is missing, with its pictures", async () => {
      const page = await browser.open();
      await page.take(small);
      await page.click("Diagnose");
      await page.until(() => document.querySelector("#diagnosis figure") && document.querySelector(".busy").hidden);
      await page.drawn();
      const plots = await page.page.$$eval("#diagnosis .plot .scatterlayer path", (paths) => paths.length);
      assert.ok(plots > 0);
      await page.picture("diagnosis");
      await ended(page);
      return page.page.isClosed() ? "drawn" : "";
    }),
    test("motors stand side by side, and are compared", async () => {
      const page = await browser.open();
      await page.take(small);
      await page.drop(other);
      await page.click("Another motor");
      await page.until(() => document.querySelectorAll("[role=tab]").length === 3 && document.querySelector(".busy").hidden && document.querySelector(".results .verdict"));
      const names = await page.page.$$eval("[role=tab]", (tabs) => tabs.map((tab) => tab.textContent));
      // By keyboard, as tabs are.
      await page.page.focus("[role=tab][aria-selected=true]");
      await page.page.keyboard.press("End");
      await page.until(() => document.querySelector("#panel .verdict .headline"));
      const compared = await page.page.$eval("#panel", (panel) => panel.innerText);
      for (const name of names.slice(0, 2)) assert.ok(compared.includes(name), `${name} is not in ${compared}`);
      assert.deepEqual(await page.barriers(), []);
      await page.picture("comparison");
      await page.page.keyboard.press("Home");
      await page.until(() => document.querySelector(".results .verdict"));
      await ended(page);
      return names.join(", ");
    }),
    test("a further run is held out, and judges the first", async () => {
      const folder = await mkdtemp(join(tmpdir(), "page-"));
      // Called as the first: both are runs all the same.
      const again = join(folder, "staircase.csv");
      await copyFile(staircase, again);
      const page = await browser.open();
      await page.take(staircase);
      const said = () => page.page.$eval(".results .verdict", (verdict) => verdict.innerText);
      assert.match(await said(), /held out/);
      await page.drop(again);
      await page.click("A further run of staircase");
      await page.until(() => document.querySelectorAll(".chips input").length === 2 && document.querySelector(".busy").hidden);
      const names = await page.page.$$eval(".chips .mono", (chips) => chips.map((chip) => chip.textContent));
      assert.deepEqual(names, ["staircase.csv", "staircase (2).csv"]);
      await page.page.click(".chips li:last-child input");
      await page.until(() => document.querySelector(".busy").hidden && !document.querySelector(".results .verdict").innerText.includes("held out that"));
      // What is held out cannot be all.
      await page.page.click(".chips li:first-child input");
      await page.until(() => document.querySelector(".notice")?.innerText.includes("nothing can be fitted"));
      assert.equal(await page.page.$eval(".chips li:first-child input", (box) => box.checked), false);
      await rm(folder, { recursive: true });
      await ended(page);
    }),
    test("several logs are chosen, each of another motor", async () => {
      const page = await browser.open();
      const chooser = await page.page.$("#choose-logs");
      await chooser.uploadFile(small, other);
      await page.click("Each of another motor");
      await page.until(() => document.querySelectorAll("[role=tab]").length === 3 && document.querySelector(".busy").hidden && document.querySelector(".results .verdict"));
      // Without one of two there is nothing to compare.
      await page.click("Remove log.bin");
      await page.until(() => document.querySelectorAll("[role=tab]").length === 1);
      assert.equal(await page.page.evaluate(() => document.activeElement.getAttribute("role")), "tab", "the focus was lost");
      await ended(page);
    }),
    test("a folder of an experiment is taken as one", async () => {
      const folder = await mkdtemp(join(tmpdir(), "page-"));
      const experiment = join(folder, "stand");
      await run(program, ["import", small, "--out", experiment]);
      const expected = JSON.parse((await run(program, ["identify", experiment, "--out", join(folder, "m.toml"), "--json", "-"])).stdout);
      const page = await browser.open();
      await page.drop(experiment);
      const { headline } = await page.shown();
      assert.ok(headline.endsWith(expected.judgement.state), `${headline}: ${expected.judgement.state}`);
      await page.clear();
      // Chosen, not dropped.
      const chooser = await page.page.$("#choose-folder");
      await chooser.uploadFile(experiment);
      const chosen = await page.shown();
      assert.equal(chosen.headline, headline);
      await rm(folder, { recursive: true });
      await ended(page);
      return headline;
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
      slider.value = 250 + Math.round(100 * Math.sin(k / 12));
      slider.dispatchEvent(new Event("input", { bubbles: true }));
      await new Promise(requestAnimationFrame);
      const now = performance.now();
      frames.push(now - last);
      last = now;
    }
    return frames;
  });
}

