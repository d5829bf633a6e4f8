// Serves a folder on this machine alone, as `rotorlead serve` does: with a policy that lets nothing in from outside.

import { createReadStream } from "node:fs";
import { readFile, stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";

const TYPES = { ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".wasm": "application/wasm", ".csv": "text/csv", ".txt": "text/plain" };

/** What a page states that it takes, and that no other page holds it, which a header alone can say. */
export async function policyOf(folder) {
  const page = await readFile(join(folder, "index.html"), "utf8");
  return `${page.match(/http-equiv="Content-Security-Policy" content="([^"]*)"/)[1]}; frame-ancestors 'none'`;
}

/** Gives the address, and what ends it. */
export async function serve(folder) {
  const policy = await policyOf(folder);
  const server = createServer(async (request, response) => {
    const path = normalize(decodeURIComponent(new URL(request.url, "http://host").pathname));
    const file = join(folder, path.endsWith("/") ? `${path}index.html` : path);
    const found = await stat(file).catch(() => null);
    if (!found?.isFile()) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream", "content-security-policy": policy });
    createReadStream(file).pipe(response);
  });
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { address: `http://127.0.0.1:${server.address().port}/`, close: () => server.close() };
}
