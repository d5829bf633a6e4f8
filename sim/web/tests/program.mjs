// The page as `rotorlead serve` gives it.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { readFile } from "node:fs/promises";
import { request } from "node:http";
import { connect } from "node:net";
import { networkInterfaces } from "node:os";
import { join } from "node:path";
import readline from "node:readline";

import { policyOf } from "./serve.mjs";

/** Starts the program; gives the address that it prints, and what ends it. */
export async function serve(program) {
  const child = spawn(program, ["serve", "--port", "0", "--no-browser"], { stdio: ["ignore", "pipe", "inherit"] });
  const ended = new Promise((resolve, reject) => {
    child.once("error", reject);
    child.once("exit", (status) => reject(new Error(`rotorlead serve ended with ${status}`)));
  });
  const line = new Promise((resolve) => readline.createInterface({ input: child.stdout }).once("line", resolve));
  const address = await Promise.race([line, ended]);
  ended.catch(() => {});
  return { address, close: () => child.kill() };
}

/** What a request gets: status, headers and bytes. */
function got(address, path, { method = "GET", headers = {} } = {}) {
  return new Promise((resolve, reject) => {
    const asked = request(new URL(path, address), { method, headers }, async (response) => {
      const parts = await response.toArray();
      resolve({ status: response.statusCode, headers: response.headers, bytes: Buffer.concat(parts) });
    });
    asked.once("error", reject);
    asked.end();
  });
}

export function served({ folder, server }) {
  const { address } = server;
  const test = (name, run) => ({ name, run });
  return [
    test("the program gives its files to this machine alone, and nothing else", async () => {
      const page = await got(address, "/");
      assert.equal(page.status, 200);
      assert.equal(page.headers["content-security-policy"], await policyOf(folder));
      // Packed only for who unpacks it.
      for (const name of ["index.html", "rotorlead_web_bg.wasm"]) {
        const file = await got(address, `/${name}`);
        assert.ok(file.bytes.equals(await readFile(join(folder, name))), name);
        const packed = await got(address, `/${name}`, { headers: { "accept-encoding": "gzip" } });
        assert.equal(packed.headers["content-encoding"], "gzip");
        assert.ok(packed.bytes.length < file.bytes.length / 1.5, `${name}: ${packed.bytes.length} of ${file.bytes.length}`);
      }
      const { port } = new URL(address);
      assert.equal((await got(address, "/", { headers: { host: `elsewhere.example:${port}` } })).status, 421);
      assert.equal((await got(address, "/", { headers: { host: `localhost:${port}` } })).status, 200);
      assert.equal((await got(address, "/", { method: "POST" })).status, 405);
      for (const path of ["/../Cargo.toml", "/%2e%2e/Cargo.toml", "/no-such-file"]) assert.equal((await got(address, path)).status, 404, path);
      const others = Object.values(networkInterfaces()).flat().filter(({ internal, family }) => !internal && family === "IPv4");
      for (const { address: other } of others) {
        const isOpen = await new Promise((resolve) => {
          const socket = connect(Number(port), other, () => resolve(true));
          socket.once("error", () => resolve(false));
        });
        assert.ok(!isOpen, `it listens on ${other}`);
      }
      return `${others.length} other addresses are closed`;
    }),
  ];
}
