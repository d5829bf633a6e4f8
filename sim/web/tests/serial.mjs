// The page in headless Chromium, whose serial port is wired to a Pico that is emulated: from a log to the settings of the box.
//
// node serial.mjs FOLDER_OF_PAGE NODE_MODULES ROTORLEAD PICO: the program `rotorlead`, and the example `pico` of host-tests, which takes
// ROTORLEAD_RP2040_IMAGE. Prints a line for each test; fails where one does. With WHOLE=1 a motor is tuned to its end, too: minutes.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { cp, mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import readline from "node:readline";
import { fileURLToPath } from "node:url";

import { Browser, NARROW, OpenPage, WIDE } from "./browser.mjs";
import { serve } from "./serve.mjs";

const [folder, modules, rotorlead, picoProgram] = process.argv.slice(2).map((argument) => path.resolve(argument));
const here = path.dirname(fileURLToPath(import.meta.url));
const scratch = await mkdtemp(path.join(tmpdir(), "box-"));

/** The emulated box is slower than time: how long an answer is waited for in the page, and here. */
const [LIMIT, LONGER_LIMIT] = ["limitS = 1 }", "limitS = 20 }"];
/** What the emulated motors reach at 0.5, and a tenth more. */
const MOST_RPM = "12500";

let failures = 0;
let box = null;
const before = [];

async function test(name, run) {
  const start = performance.now();
  try {
    await run();
    console.log(`ok ${name} (${((performance.now() - start) / 1000).toFixed(1)} s)`);
  } catch (error) {
    failures += 1;
    console.log(`FAILED ${name}: ${error.stack}\n--- shown\n${await box.text().catch(String)}\n--- problems\n${box.opened.complaints.join("\n")}`);
  }
}

/** `what` as soon as it is something. */
async function eventually(what, seconds = 20) {
  const end = Date.now() + 1000 * seconds;
  for (;;) {
    const value = await what();
    if (value) return value;
    if (Date.now() > end) throw new Error(`${seconds} s are over: ${what}`);
    await new Promise((resolve) => { setTimeout(resolve, 30); });
  }
}

/** The emulated board: its address, and what is said to it on its standard input. */
async function startPico() {
  const child = spawn(picoProgram, ["0"], { stdio: ["pipe", "pipe", "pipe"] });
  before.push(() => child.kill());
  const said = readline.createInterface({ input: child.stderr });
  const answers = readline.createInterface({ input: child.stdout })[Symbol.asyncIterator]();
  const address = await new Promise((resolve, reject) => {
    said.on("line", (line) => {
      const found = /the Pico is at tcp:(\S+)/.exec(line);
      if (found) resolve(found[1]);
      else console.error(`pico: ${line}`);
    });
    child.on("exit", (code) => reject(new Error(`the Pico ended: ${code}`)));
  });
  const [host, port] = address.split(":");
  let last = Promise.resolve();
  const tell = (line) => {
    last = last.then(async () => {
      child.stdin.write(`${line}\n`);
      return (await answers.next()).value;
    });
    return last;
  };
  return { address, host, port: Number(port), tell, motors: async () => (await tell("motors")).split(" ").map(Number) };
}

/** The command line at the same board, while the page is not. */
function device(pico, ...words) {
  const json = path.join(scratch, "out.json");
  const run = spawnSync(rotorlead, ["device", "--port", `tcp:${pico.address}`, "--timeout", "20", "--json", json, ...words], { encoding: "utf8" });
  assert.equal(run.status, 0, run.stderr);
  return readFile(json, "utf8").then((text) => {
    const { generator, ...values } = JSON.parse(text);
    return values;
  });
}

/** A page whose port is wired to the board, with every write that went there. */
async function openPage(browser, url, pico) {
  const page = await browser.browser.newPage();
  const opened = new OpenPage(page, browser.axe, url);
  await opened.watch();
  const writes = [];
  let socket = null;
  await page.exposeFunction("portOpen", (baud) => new Promise((resolve, reject) => {
    assert.equal(baud, 1_000_000);
    socket = net.connect(pico.port, pico.host, resolve);
    socket.setNoDelay(true);
    socket.on("error", reject);
    socket.on("data", (bytes) => page.evaluate((text) => window.portBytes(text), bytes.toString("base64")).catch(() => {}));
    socket.on("close", () => page.evaluate(() => window.portLost()).catch(() => {}));
  }));
  await page.exposeFunction("portWrite", (text) => {
    const bytes = Buffer.from(text, "base64");
    writes.push({ bytes, at: Date.now() });
    return new Promise((resolve, reject) => { socket.write(bytes, (error) => (error ? reject(error) : resolve())); });
  });
  await page.exposeFunction("portClose", () => { socket.destroy(); });
  await page.evaluateOnNewDocument(await readFile(path.join(here, "serial-stand-in.js"), "utf8"));
  await page.setViewport(WIDE);
  await page.goto(url);
  await page.waitForSelector("html[data-ready]");
  const text = (selector = "#device") => page.$eval(selector, (element) => element.innerText);
  return {
    page, opened, writes, text,
    // The cable is pulled.
    lose: () => socket.destroy(),
    close: async () => {
      await page.close();
      socket.destroy();
    },
    press: async (name) => {
      const found = await eventually(() => page.$(`::-p-xpath(//section[@id="device"]//button[normalize-space()="${name}"][not(ancestor-or-self::*[@hidden])])`));
      await found.evaluate((element) => element.click());
    },
    says: (words, seconds) => eventually(async () => (await text()).includes(words), seconds),
    alert: () => eventually(() => page.$eval("#device [role=alert]", (element) => element.innerText)),
    /** The field of that label. */
    fill: async (label, value) => {
      const id = await page.$$eval("#device label", (labels, wanted) => labels.find((one) => one.innerText.includes(wanted)).htmlFor, label);
      await page.$eval(`#${id}`, (field, typed) => { field.value = typed; }, value);
    },
    unfold: (title) => page.$$eval("#device summary", (all, wanted) => { all.find((one) => one.textContent === wanted).parentElement.open = true; }, title),
  };
}

/** Refuses what keeps somebody out who does not see or point, and what is wider than a phone. */
async function isForAll(box) {
  // As a phone it would be loaded anew.
  await box.page.setViewport({ ...NARROW, isMobile: false, hasTouch: false });
  assert.deepEqual(await box.opened.barriers(), []);
  const width = await box.page.evaluate(() => document.documentElement.scrollWidth);
  await shoot(box, "narrow");
  assert.ok(width <= NARROW.width, `${width} px wide`);
  await box.page.setViewport(WIDE);
}

const shoot = (box, name) => box.opened.picture(`box-${name}`);

async function answer(box, question, typed) {
  await box.says(question);
  await box.page.type("#device form input", typed);
  await box.press("Answer");
}

async function tuneUpTo(box, answers, motors = "0") {
  const fields = [["--motors", motors], ["--nominal", "0.4,0.5"], ["--most-rpm", MOST_RPM], ["--motor-poles", "14"], ["--periods", "2"], ["--divisor", "1"], ["--kind", "inverse"]];
  for (const [option, value] of fields) await box.fill(option, value);
  await box.press("Tune the motors");
  const questions = ["fastened so that it cannot move", "signals disconnected", "cut the ESCs' power at once"];
  for (const [index, typed] of answers.entries()) await answer(box, questions[index], typed);
}

const pico = await startPico();
const served = path.join(scratch, "page");
await cp(folder, served, { recursive: true });
const section = await readFile(path.join(folder, "device.js"), "utf8");
assert.equal(section.split(LIMIT).length, 2, `device.js has not one \`${LIMIT}\``);
await writeFile(path.join(served, "device.js"), section.replace(LIMIT, LONGER_LIMIT));
const { address: url, close } = await serve(served);
before.push(close);
const browser = await Browser.start(modules, url);
before.push(() => browser.close());
/** A log that ships with the page. */
const log = path.join(folder, "staircase.csv");
box = await openPage(browser, url, pico);

await test("a box is shown as the command line shows it", async () => {
  await box.press("Connect");
  await box.says("Connected.");
  await box.says("outputs LOW: nobody has chosen the settings");
  const ticks = async () => /, (\d+) ticks/.exec(await box.text())[1];
  const first = await ticks();
  await eventually(async () => (await ticks()) !== first);
  const rows = await box.page.$$eval(".box-live tbody tr", (all) => all.map((row) => [...row.cells].map((cell) => cell.innerText.trim())));
  assert.deepEqual(rows, [0, 1, 2, 3].map((motor) => [String(motor), "NoSignal", "none", "no pulse", "no"]));
  await box.unfold("What went wrong since its start");
  await box.says("dead_man = 0");
  await shoot(box, "connected");
});

await test("what the box or the library refuses is shown, and nothing is set", async () => {
  await box.press("Set the compensator");
  assert.match(await box.alert(), /no compensator is designed yet/);
  await box.opened.take(log);
  await box.press("Set the compensator");
  await eventually(async () => /nobody has chosen the settings of this controller/.test(await box.alert()));
  await box.press("Store in the box");
  await eventually(async () => /storing them/.test(await box.alert()));
  await shoot(box, "refused");
  await box.press("Disconnect");
  await box.says("Disconnected.");
  assert.equal((await device(pico, "info")).settings, "DefaultsBlank");
});

// Short ramps, and a frame in each tick: emulated time is dear.
const settings = await device(pico, ..."set output.protocol dshot600_bidirectional loop_rate_hz 1000 output.frame_hz 1000 stop_pulses_ms 20 excitation.arm_ms 10 excitation.ramp_ms 100".split(" "));
assert.equal(settings.set.loop_rate_hz, "1000");
const all = await device(pico, "get");

await test("without the jumper, or without a typed yes, no motor turns and nothing is set", async () => {
  await pico.tell("jumper out");
  await box.press("Connect again");
  await box.says("bench jumper not fitted");
  await box.unfold("Tune the motors without a stand");
  await tuneUpTo(box, []);
  assert.match(await box.alert(), /bench jumper is not fitted/);
  await pico.tell("jumper in");
  await box.says("bench jumper fitted");
  await tuneUpTo(box, [], "0,4");
  await eventually(async () => /there is no motor 4/.test(await box.alert()));
  await tuneUpTo(box, ["yes", "y"]);
  await eventually(async () => /was not answered with yes/.test(await box.alert()));
  await tuneUpTo(box, []);
  await box.says("fastened so that it cannot move");
  await shoot(box, "asked");
  await isForAll(box);
  await box.press("No");
  await eventually(async () => /nobody near its propellers\? was not answered with yes/.test(await box.alert()));
  assert.deepEqual(await pico.motors(), [0, 0, 0, 0]);
});

await test("a hidden page stops the motors, and sends nothing behind that", async () => {
  await tuneUpTo(box, ["yes", "yes", "yes"]);
  await eventually(async () => (await pico.motors())[0] > 0.35, 60);
  await shoot(box, "turning");
  const front = await browser.browser.newPage();
  await front.bringToFront();
  await eventually(() => box.page.evaluate(() => document.hidden));
  const hidden = Date.now();
  await eventually(async () => (await pico.motors())[0] === 0);
  await box.says("The page was hidden while motors turned");
  assert.match(await box.alert(), /motor 0 was not measured, and no setting was changed/);
  const late = box.writes.filter(({ at }) => at > hidden + 100);
  assert.equal(late.length, 0, `${late.length} writes came later`);
  const keepAlives = box.writes.filter(({ at }) => at > hidden - 2000 && at <= hidden).length;
  assert.ok(keepAlives > 5, `${keepAlives} keep-alives before`);
  await front.close();
  await box.page.bringToFront();
  assert.deepEqual(await device(pico, "get"), all);
  assert.equal((await device(pico, "faults")).dead_man, 0, "the stop came before the dead-man's");
  await shoot(box, "hidden");
});

await test("a page that is closed while a motor turns keeps nothing alive", async () => {
  await box.press("Connect again");
  await box.says("bench jumper fitted");
  await box.unfold("Tune the motors without a stand");
  await tuneUpTo(box, ["yes", "yes", "yes"]);
  await eventually(async () => (await pico.motors())[0] > 0.35, 60);
  await box.page.close();
  const closed = Date.now();
  await eventually(async () => (await pico.motors())[0] === 0);
  assert.deepEqual(box.writes.filter(({ at }) => at > closed), []);
  box.lose();
  assert.deepEqual(await device(pico, "get"), all);
});

box = await openPage(browser, url, pico);
await box.opened.take(log);

await test("a port that is gone is said, and connected again", async () => {
  await box.press("Connect");
  await box.says("bench jumper fitted");
  box.lose();
  await box.says("the port is gone");
  await box.press("Connect again");
  await box.says("bench jumper fitted");
});

await test("from a log by the slider into the flash of the box", async () => {
  const { page, opened } = box;
  await page.focus("input.natural");
  for (let k = 0; k < 10; k += 1) await page.keyboard.press("ArrowLeft");
  await opened.settled();
  const natural = await page.$eval(".slider output", (output) => Number.parseFloat(output.textContent));
  await opened.cdp.send("Browser.setDownloadBehavior", { behavior: "allow", downloadPath: scratch });
  const kept = await opened.download("compensator.toml", scratch);
  await box.fill("Compensator in the path of", "0");
  await box.press("Set the compensator");
  await box.says("motor.*.time_constant_s = ");
  await box.press("Store in the box");
  await box.says("Stored: the box has these settings");
  await eventually(() => page.$$eval(".box-live tbody tr", (rows) => rows[0].innerText.endsWith("yes") && rows[1].innerText.endsWith("no")));
  await shoot(box, "set");
  assert.deepEqual(opened.complaints, []);
  await box.close();
  const set = await device(pico, "get");
  assert.equal(set.compensator, "inverse");
  assert.equal(set["motor.0.compensate"], "true");
  assert.equal(set["motor.1.compensate"], "false");
  assert.ok(Math.abs(Number(set["inverse.natural_rad_s"]) - natural) < 1e-6 * natural, `${set["inverse.natural_rad_s"]}: ${natural}`);
  await pico.tell("restart");
  assert.equal((await device(pico, "info")).settings, "Stored");
  assert.deepEqual(await device(pico, "get"), set);
  // The command line sets the same of the file.
  await device(pico, "set", "--compensator", path.join(scratch, "compensator.toml"));
  assert.deepEqual(await device(pico, "get"), set, kept);
});

await test("a browser without serial ports says so", async () => {
  const page = await browser.browser.newPage();
  await page.evaluateOnNewDocument(() => { delete Navigator.prototype.serial; });
  await page.goto(url);
  await eventually(() => page.$eval("#device", (section) => /no Web Serial/.test(section.innerText)));
  await page.close();
});

if (process.env.WHOLE) {
  await test("a motor is tuned through the page", async () => {
    await device(pico, "set", "motor.0.compensate", "false");
    box = await openPage(browser, url, pico);
    await box.press("Connect");
    await box.says("bench jumper fitted");
    await box.unfold("Tune the motors without a stand");
    await tuneUpTo(box, ["yes", "yes", "yes"], "0,3");
    await box.says("Write these settings and store them?", 600);
    await shoot(box, "proposed");
    console.log(await box.text(".box-proposed"));
    await answer(box, "Write these settings", "yes");
    await box.says("Set and saved.", 60);
    await shoot(box, "tuned");
    console.log(await box.text("#device > .files"));
    await box.close();
    const set = await device(pico, "get");
    assert.equal(set["motor.3.compensate"], "true");
    console.log(set["motor.3.time_constant_s"]);
  });
}

for (const undo of before.reverse()) await undo();
await rm(scratch, { recursive: true });
process.exit(failures > 0 ? 1 : 0);
