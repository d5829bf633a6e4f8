// Each log says in the page what it says on the command line.

import assert from "node:assert/strict";
import { execFile } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, join } from "node:path";
import { promisify } from "node:util";

import { CASES, typed } from "./cases.mjs";

const run = promisify(execFile);

export function judgements({ browser, program, data }) {
  // A page takes one log after the other.
  const idle = [];
  return CASES.map(({ log, options }) => ({
    name: `${log} is judged as on the command line`,
    run: async () => {
      const file = join(data, log);
      const [expected, page] = await Promise.all([identify(program, file, options), idle.pop() ?? browser.open()]);
      await page.drop(file);
      let shown = await page.shown();
      if (Object.keys(options).length) {
        await (shown.asked ? page.answer(options) : page.say(options));
        shown = await page.shown();
      }
      const said = expected.judgement ? agreed(shown, expected.judgement) : refused(shown, expected.message);
      assert.deepEqual(page.complaints, []);
      await page.clear();
      idle.push(page);
      return said;
    },
  }));
}

/** What `identify` answers, or why it does not. */
async function identify(program, file, options) {
  const folder = await mkdtemp(join(tmpdir(), "page-"));
  try {
    const out = join(folder, "identify.json");
    await run(program, ["identify", file, ...typed(options), "--out", join(folder, "model.toml"), "--json", out]);
    return JSON.parse(await readFile(out, "utf8"));
  } catch (error) {
    if (!error.stderr) throw error;
    return { message: error.stderr.replaceAll(file, basename(file)) };
  } finally {
    await rm(folder, { recursive: true });
  }
}

const plain = (text) => text.replaceAll("`", "").replaceAll("+-", "±").replaceAll(/\s+/g, " ").trim().toLowerCase();

function agreed({ verdict, headline, asked, alerts }, { state, limits }) {
  assert.equal(asked, "");
  assert.deepEqual(alerts, []);
  const states = ["ready within limits", "ready", "measure again", "not a lag"];
  const shown = states.find((one) => plain(headline).includes(one));
  assert.equal(shown, state, headline);
  for (const limit of limits) assert.ok(plain(verdict).includes(plain(limit)), `"${limit}" is not in "${verdict}"`);
  return `${state}, ${limits.length} limits`;
}

function refused({ verdict, asked, alerts }, message) {
  // The command line breaks its lines, and draws a frame around them.
  const words = (text) => new Set(plain(text).replaceAll(/[│×╰─▶]/g, " ").split(/[^\p{L}\p{N}]+/u).filter((word) => word.length > 3));
  const said = words([verdict, asked, ...alerts].join(" "));
  const first = [...words(message.split(/\n\s*help:/)[0])];
  const missed = first.filter((word) => !said.has(word));
  assert.ok(missed.length <= 0.2 * first.length, `${message}\nis in the page: ${[verdict, asked, ...alerts].join(" ")}`);
  return "refused in the same words";
}
