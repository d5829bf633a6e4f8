// The page in headless Chromium: what is done to it, and what it shows.

import { existsSync } from "node:fs";
import { mkdir, readFile, rm } from "node:fs/promises";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

const PROGRAMS = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"];
const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions", "--disable-background-networking",
  "--disable-background-timer-throttling", "--disable-backgrounding-occluded-windows", "--disable-component-update", "--disable-default-apps",
  "--disable-quic", "--disable-renderer-backgrounding", "--disable-sync", "--hide-scrollbars", "--mute-audio", "--no-first-run",
];
/** Longest wait for a page to start. */
const START_WITHIN_MS = 10_000;
/** Height of the pieces in which a long page is kept. */
const PIECE = 1600;
export const WIDE = { width: 1280, height: 900 };
export const NARROW = { width: 390, height: 844, isMobile: true, hasTouch: true };

function program() {
  const places = process.env.PATH.split(delimiter).flatMap((folder) => PROGRAMS.map((name) => join(folder, name)));
  const found = places.find(existsSync);
  if (!found) throw new Error("there is no browser: `cargo xtask setup` installs Chromium");
  return found;
}

export class Browser {
  /** `netLog` is where the browser writes what it asks of the network. */
  static async start(modules, address, netLog = null) {
    const require = createRequire(join(modules, "x.js"));
    const { default: puppeteer } = await import(require.resolve("puppeteer-core"));
    const made = new Browser();
    made.browser = await puppeteer.launch({ executablePath: program(), args: netLog ? [...FLAGS, `--log-net-log=${netLog}`] : FLAGS, headless: true, protocolTimeout: 60_000 });
    made.axe = require.resolve("axe-core/axe.min.js");
    made.address = address;
    return made;
  }

  /** The page in a window of its own, when it is ready. */
  async open({ viewport = WIDE, dark = false, address = this.address, isReady = true } = {}) {
    const context = await this.browser.createBrowserContext();
    const page = await context.newPage();
    const opened = new OpenPage(page, this.axe, address);
    await opened.watch();
    await page.setViewport(viewport);
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }]);
    await page.goto(address);
    if (isReady) {
      await page.waitForSelector("html[data-ready]", { timeout: START_WITHIN_MS }).catch((error) => {
        throw new Error(`the page does not start: ${opened.complaints.join("\n")}`, { cause: error });
      });
    }
    return opened;
  }

  close() {
    return this.browser.close();
  }
}

export class OpenPage {
  /** What the browser's own log says: requests beyond the page's host, errors, console. */
  complaints = [];
  requests = [];

  constructor(page, axe, address) {
    Object.assign(this, { page, axe, address });
  }

  async watch() {
    const { page } = this;
    this.cdp = await page.createCDPSession();
    await this.cdp.send("Network.enable");
    await this.cdp.send("Log.enable");
    this.cdp.on("Network.requestWillBeSent", ({ request: { url } }) => {
      this.requests.push(url);
      if (!url.startsWith(this.address) && !/^(data|blob):/.test(url)) this.complaints.push(`request: ${url}`);
    });
    this.cdp.on("Log.entryAdded", ({ entry }) => this.complaints.push(`log: ${entry.text} ${entry.url ?? ""}`));
    page.on("pageerror", (error) => this.complaints.push(`exception: ${error.message}`));
    page.on("console", (message) => this.complaints.push(`console: ${message.text()}`));
  }

  /** Drops files as a hand does. */
  async drop(...files) {
    const data = { items: [], files, dragOperationsMask: 1 };
    for (const type of ["dragEnter", "dragOver", "drop"]) await this.cdp.send("Input.dispatchDragEvent", { type, x: 200, y: 120, data });
  }

  /** Clicks what bears a text, or has a label of it. */
  async click(text, within = "button, summary, a, [role=tab]") {
    const handle = await this.page.waitForFunction((name, selector) => [...document.querySelectorAll(selector)]
      .find((one) => (one.getAttribute("aria-label") ?? one.textContent).trim() === name && one.checkVisibility()), {}, text, within);
    await handle.click();
  }

  /** Waits until a function of the page gives something, and gives that. */
  async until(fn, ...values) {
    const handle = await this.page.waitForFunction(fn, { polling: 50, timeout: 50_000 }, ...values);
    return handle.jsonValue();
  }

  /** The verdict that the page shows, when nothing is going on; with what it complains of. */
  shown() {
    return this.until(() => {
      const busy = [...document.querySelectorAll(".busy")].some((one) => !one.hidden);
      const wanted = document.querySelector(".results .verdict, .ask, .alerts .notice");
      if (busy || !wanted) return null;
      const text = (one) => one?.textContent.trim() ?? "";
      return {
        headline: text(document.querySelector(".results .verdict .headline, .results .verdict p")),
        verdict: text(document.querySelector(".results .verdict")),
        asked: text(document.querySelector(".ask [role=alert]")),
        alerts: [...document.querySelectorAll(".alerts .notice")].map(text),
      };
    });
  }

  /** Drops a log that says all of itself, and waits for what it says. */
  async take(file) {
    await this.drop(file);
    const shown = await this.shown();
    if (shown.asked || shown.alerts.length) throw new Error(`${file}: ${shown.asked}${shown.alerts}`);
    return shown;
  }

  /** Answers what is asked of a log, as `rotorlead import` has its options. */
  async answer(options) {
    await this.page.waitForSelector(".ask form");
    await this.#fill(".ask form", options);
  }

  /** Says what is in a log that is taken already. */
  async say(options) {
    await this.click("Say what is in it");
    await this.#fill(".about form", options);
  }

  async #fill(selector, options) {
    await this.page.evaluate((selector, options) => {
      const form = document.querySelector(selector);
      if (!form) throw new Error(`there is no ${selector}`);
      const set = (control, value) => {
        control.value = value;
        if (control.value !== value) throw new Error(`${control.ariaLabel ?? control.name} has no ${value}`);
        control.dispatchEvent(new Event("change", { bubbles: true }));
      };
      for (const [name, value] of Object.entries(options)) {
        if (name !== "column") set(form.elements[name], value);
      }
      for (const column of options.column ?? []) {
        const [, quantity, header, sign, unit] = column.match(/^([^=]*)=(.*):(-?)([^:]*)$/);
        set(form.querySelector(`[aria-label="Column of the ${quantity}"]`), header);
        set(form.querySelector(`[aria-label="Unit of the ${quantity}"]`), unit);
        if (sign) form.querySelector(`[aria-label="Turn the sign of the ${quantity}"]`).click();
      }
      form.requestSubmit();
    }, selector, options);
  }

  /** Waits until what was asked is shown. */
  async settled() {
    await this.until(() => document.querySelector(".busy").hidden && !document.querySelector(".tuning[aria-busy=true]"));
  }

  /** Has a file of the page's, and gives its text. */
  async download(name, folder) {
    const file = join(folder, name);
    await rm(file, { force: true });
    await this.click(name);
    for (let k = 0; k < 400; k += 1) {
      const text = await readFile(file, "utf8").catch(() => "");
      if (text) return text;
      await new Promise((resolve) => setTimeout(resolve, 25));
    }
    throw new Error(`${name} does not come`);
  }

  /** Removes the logs of the motor that is shown, and what was complained of. */
  async clear() {
    await this.page.evaluate(() => {
      for (const name of [".remove", ".ask .leave", ".notice button"]) document.querySelectorAll(name).forEach((button) => button.click());
    });
    await this.until(() => !document.querySelector("[role=tab], .ask, .notice"));
  }

  /** What axe finds that is serious. */
  async barriers() {
    await this.page.evaluate(await readFile(this.axe, "utf8"));
    return this.page.evaluate(async () => {
      // Within a plot there are thousands of elements, and nothing to be operated.
      const { violations } = await axe.run({ exclude: [".plot"] }, { resultTypes: ["violations"] });
      return violations
        .filter(({ impact }) => ["serious", "critical"].includes(impact))
        .flatMap(({ id, nodes }) => nodes.map(({ target, failureSummary }) => `${id}: ${target}: ${failureSummary.replaceAll("\n", " ")}`));
    });
  }

  /** Waits until all figures are drawn; they are when they come into view. */
  async drawn() {
    await this.page.evaluate(async () => {
      for (const plot of document.querySelectorAll(".plot")) {
        plot.scrollIntoView({ behavior: "instant", block: "center" });
        while (!plot.querySelector(".main-svg")) await new Promise((resolve) => setTimeout(resolve, 10));
      }
      scrollTo({ top: 0, behavior: "instant" });
    });
  }

  /** Keeps a picture, where pictures are wanted. */
  async picture(name, { fullPage = true } = {}) {
    const folder = process.env.SHOTS;
    if (!folder) return;
    await mkdir(folder, { recursive: true });
    if (fullPage) await this.drawn();
    await new Promise((resolve) => setTimeout(resolve, 200));
    if (!fullPage) {
      await this.page.screenshot({ path: join(folder, `${name}.png`) });
      return;
    }
    const { width, height } = await this.page.evaluate(() => ({ width: innerWidth, height: document.documentElement.scrollHeight }));
    for (let y = 0; y < height; y += PIECE) {
      const clip = { x: 0, y, width, height: Math.min(PIECE, height - y) };
      await this.page.screenshot({ path: join(folder, `${name}-${y / PIECE}.png`), clip, captureBeyondViewport: true });
    }
  }

  async close() {
    await this.page.browserContext().close();
  }
}
