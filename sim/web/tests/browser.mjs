// The page in headless Chromium: what is done to it, and what it shows.

import { existsSync } from "node:fs";
import { mkdir } from "node:fs/promises";
import { createRequire } from "node:module";
import { delimiter, join } from "node:path";

const PROGRAMS = ["chromium", "chromium-browser", "google-chrome-stable", "google-chrome"];
const FLAGS = [
  "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--disable-extensions", "--disable-background-networking",
  "--disable-background-timer-throttling", "--disable-backgrounding-occluded-windows", "--disable-component-update", "--disable-default-apps",
  "--disable-quic", "--disable-renderer-backgrounding", "--disable-sync", "--hide-scrollbars", "--mute-audio", "--no-first-run",
];
export const WIDE = { width: 1280, height: 900 };
export const NARROW = { width: 390, height: 844, isMobile: true, hasTouch: true };

function program() {
  const places = process.env.PATH.split(delimiter).flatMap((folder) => PROGRAMS.map((name) => join(folder, name)));
  const found = places.find(existsSync);
  if (!found) throw new Error("there is no browser: `cargo xtask setup` installs Chromium");
  return found;
}

export class Browser {
  static async start(modules, address) {
    const require = createRequire(join(modules, "x.js"));
    const { default: puppeteer } = await import(require.resolve("puppeteer-core"));
    const made = new Browser();
    made.browser = await puppeteer.launch({ executablePath: program(), args: FLAGS, headless: true, protocolTimeout: 60_000 });
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
    if (isReady) await page.waitForSelector("html[data-ready]");
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

  /** What axe finds that is serious. */
  async barriers() {
    const { readFile } = await import("node:fs/promises");
    await this.page.evaluate(await readFile(this.axe, "utf8"));
    return this.page.evaluate(async () => {
      const { violations } = await axe.run(document, { resultTypes: ["violations"] });
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
    await this.page.screenshot({ path: join(folder, `${name}.png`), fullPage });
  }

  async close() {
    await this.page.browserContext().close();
  }
}
