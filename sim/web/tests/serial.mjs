// The section of the box in headless Chromium, whose serial port is wired to a Pico that is emulated.
//
// node serial.mjs FOLDER_OF_PAGE NODE_MODULES ROTORLEAD PICO: the program `rotorlead`, and the example `pico` of host-tests, which takes
// ROTORLEAD_RP2040_IMAGE. Prints a line for each test; fails where one does. With WHOLE=1 a motor is tuned to its end, too: minutes.

import assert from "node:assert/strict";
import { spawn, spawnSync } from "node:child_process";
import { createRequire } from "node:module";
import { mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import http from "node:http";
import net from "node:net";
import { tmpdir } from "node:os";
import path from "node:path";
import readline from "node:readline";
import { fileURLToPath } from "node:url";

const [folder, modules, rotorlead, picoProgram] = process.argv.slice(2);
const load = createRequire(path.join(path.resolve(modules), "x.js"));
const puppeteer = load("puppeteer-core");
const axe = await readFile(load.resolve("axe-core/axe.min.js"), "utf8");
const here = path.dirname(fileURLToPath(import.meta.url));
const scratch = await mkdtemp(path.join(tmpdir(), "box-"));

const POLICY = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm" };
/** Tests' own files; all others are the page's. */
const OWN = ["serial.html", "serial-page.js"];
/** What the emulated motors reach at 0.5, and a tenth more. */
const MOST_RPM = "12500";
const MODEL = "format = 1\n[[point]]\nnominal = 0.4\ngain = 18000.0\ntime_constant_s = 0.062\n[[point]]\nnominal = 0.5\ngain = 18000.0\ntime_constant_s = 0.055\n";

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
    console.log(`FAILED ${name}: ${error.stack}\n--- shown\n${await box.text().catch(String)}\n--- problems\n${box.problems.join("\n")}`);
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

async function serve() {
  const server = http.createServer(async (request, response) => {
    const name = path.basename(new URL(request.url, "http://x").pathname);
    try {
      const bytes = await readFile(path.join(OWN.includes(name) ? here : folder, name));
      response.writeHead(200, { "content-type": TYPES[path.extname(name)] ?? "application/octet-stream", "content-security-policy": POLICY });
      response.end(bytes);
    } catch {
      response.writeHead(404);
      response.end();
    }
  });
  await new Promise((resolve) => { server.listen(0, "127.0.0.1", resolve); });
  before.push(() => server.close());
  return `http://127.0.0.1:${server.address().port}`;
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
  const page = await browser.newPage();
  const writes = [];
  const problems = [];
  let socket = null;
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (message) => message.type() === "error" && problems.push(message.text()));
  await page.exposeFunction("portOpen", (baud) => new Promise((resolve, reject) => {
    assert.equal(baud, 1_000_000);
    socket = net.connect(pico.port, pico.host, resolve);
    socket.setNoDelay(true);
    socket.on("error", reject);
    socket.on("data", (bytes) => page.evaluate((text) => window.portBytes(text), bytes.toString("base64")).catch(() => {}));
  }));
  await page.exposeFunction("portWrite", (text) => {
    const bytes = Buffer.from(text, "base64");
    writes.push({ bytes, at: Date.now() });
    return new Promise((resolve, reject) => { socket.write(bytes, (error) => (error ? reject(error) : resolve())); });
  });
  await page.exposeFunction("portClose", () => new Promise((resolve) => { socket.end(resolve); }));
  await page.evaluateOnNewDocument(await readFile(path.join(here, "serial-stand-in.js"), "utf8"));
  await page.setViewport({ width: 1100, height: 1400 });
  await page.goto(`${url}/serial.html`);
  const text = (selector = "#device") => page.$eval(selector, (element) => element.innerText);
  return {
    page, writes, problems, text,
    press: async (name) => {
      const found = await eventually(() => page.$(`::-p-xpath(//section[@id="device"]//button[normalize-space()="${name}"][not(ancestor-or-self::*[@hidden])])`));
      await found.evaluate((element) => element.click());
    },
    says: (words, seconds) => eventually(async () => (await text()).includes(words), seconds),
    alert: () => eventually(() => page.$eval("[role=alert]", (element) => element.innerText)),
    /** The field of that label. */
    fill: async (label, value) => {
      const id = await page.$$eval("label", (labels, wanted) => labels.find((one) => one.innerText.includes(wanted)).htmlFor, label);
      await page.$eval(`#${id}`, (field, typed) => { field.value = typed; }, value);
    },
    unfold: (title) => page.$$eval("#device summary", (all, wanted) => { all.find((one) => one.textContent === wanted).parentElement.open = true; }, title),
  };
}

/** Refuses what keeps somebody out who does not see or point, and what is wider than a phone. */
async function isForAll(box) {
  await box.page.setViewport({ width: 390, height: 844 });
  await box.page.evaluate(axe);
  const found = await box.page.evaluate(() => window.axe.run("#device", { resultTypes: ["violations"] }));
  const grave = found.violations.filter(({ impact }) => ["serious", "critical"].includes(impact));
  assert.deepEqual(grave.map(({ id, nodes }) => [id, nodes[0].html]), []);
  const width = await box.page.evaluate(() => document.documentElement.scrollWidth);
  await shoot(box, "narrow");
  assert.ok(width <= 390, `${width} px wide`);
  await box.page.setViewport({ width: 1100, height: 1400 });
}

const shoot = async (box, name) => process.env.SHOTS && box.page.screenshot({ path: path.join(process.env.SHOTS, `box-${name}.png`), fullPage: true });

async function answer(box, question, typed) {
  await box.says(question);
  await box.page.type("form input", typed);
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
const url = await serve();
const browser = await puppeteer.launch({ executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium", args: ["--no-sandbox"] });
before.push(() => browser.close());
const model = path.join(scratch, "model.toml");
const designed = path.join(scratch, "compensator.toml");
await writeFile(model, MODEL);
const design = spawnSync(rotorlead, ["design", model, "--kind", "inverse", "--loop-rate", "1000", "--out", designed], { encoding: "utf8" });
assert.equal(design.status, 0, design.stderr);

box = await openPage(browser, url, pico);

await test("a box is shown as the command line shows it", async () => {
  await box.press("Connect");
  await box.says("Connected.");
  await box.says("outputs LOW: nobody has chosen the settings");
  const ticks = async () => /, (\d+) ticks/.exec(await box.text())[1];
  const first = await ticks();
  await eventually(async () => (await ticks()) !== first);
  const rows = await box.page.$$eval(".box-live tbody tr", (all) => all.map((row) => [...row.cells].map((cell) => cell.innerText.trim())));
  assert.deepEqual(rows, [0, 1, 2, 3].map((motor) => [String(motor), "NoSignal", "none", "no pulse", "not in the path"]));
  await box.unfold("What went wrong since its start");
  await box.says("dead_man = 0");
  await shoot(box, "connected");
});

await test("what the box or the library refuses is shown, and nothing is set", async () => {
  await box.press("Set the compensator");
  assert.match(await box.alert(), /no compensator is designed yet/);
  await box.page.$eval("#compensator", (field, text) => { field.value = text; }, await readFile(designed, "utf8"));
  await box.press("Set the compensator");
  await eventually(async () => /nobody has chosen the settings of this controller/.test(await box.alert()));
  await box.page.$eval("#compensator", (field) => { field.value = "kind = \"lead\"\nfoo = 1\n"; });
  await box.press("Set the compensator");
  await eventually(async () => /compensator\.toml/.test(await box.alert()));
  await box.press("Store in the box");
  await eventually(async () => /storing them/.test(await box.alert()));
  await shoot(box, "refused");
  await box.press("Disconnect");
  await box.says("Disconnected.");
  assert.equal((await device(pico, "info")).settings, "Defaults");
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
  const front = await browser.newPage();
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
  await shoot(box, "hidden");
});

await test("a compensator that is set and stored through the page is in the flash", async () => {
  await box.press("Connect again");
  await box.says("bench jumper fitted");
  await box.page.$eval("#compensator", (field, text) => { field.value = text; }, await readFile(designed, "utf8"));
  await box.fill("Compensator in the path of", "0");
  await box.press("Set the compensator");
  await box.says("motor.*.time_constant_s = ");
  await box.press("Store in the box");
  await box.says("Stored: the box has these settings");
  await eventually(() => box.page.$$eval(".box-live tbody tr", (rows) => /in the path/.test(rows[0].innerText) && /not in the path/.test(rows[1].innerText)));
  await shoot(box, "set");
  assert.deepEqual(box.problems, []);
  await box.page.close();
  const set = await device(pico, "get");
  assert.equal(set.compensator, "inverse");
  assert.equal(set["motor.0.compensate"], "true");
  assert.equal(set["motor.1.compensate"], "false");
  assert.notEqual(set["motor.0.time_constant_s"], "none");
  await pico.tell("restart");
  assert.equal((await device(pico, "info")).settings, "Stored");
  assert.deepEqual(await device(pico, "get"), set);
});

await test("a browser without serial ports says so", async () => {
  const page = await browser.newPage();
  await page.evaluateOnNewDocument(() => { delete Navigator.prototype.serial; });
  await page.goto(`${url}/serial.html`);
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
    console.log(await box.text(".box-tune .files"));
    await box.page.close();
    const set = await device(pico, "get");
    assert.equal(set["motor.3.compensate"], "true");
    console.log(set["motor.3.time_constant_s"]);
  });
}

for (const undo of before.reverse()) await undo();
await rm(scratch, { recursive: true });
process.exit(failures > 0 ? 1 : 0);
