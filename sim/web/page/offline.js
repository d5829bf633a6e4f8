// Keeps the page's files, so that it works where there is no network: the browser runs this for it. Where there is one its files are the newest.

importScripts("files.js");

// Others may keep something for the same host. Another build has other files, and all of them are kept anew.
const PREFIX = "rotorlead page ";
const NAME = PREFIX + VERSION;
const ADDRESSES = new Set(["./", ...FILES].map((name) => new URL(name, location.href).href));

addEventListener("install", (event) => {
  // Not what the browser has from before.
  const files = [...ADDRESSES].map((address) => new Request(address, { cache: "no-cache" }));
  event.waitUntil((async () => (await caches.open(NAME)).addAll(files))());
});

addEventListener("activate", (event) => {
  event.waitUntil((async () => {
    const others = (await caches.keys()).filter((name) => name.startsWith(PREFIX) && name !== NAME);
    await Promise.all(others.map((name) => caches.delete(name)));
    await clients.claim();
  })());
});

addEventListener("fetch", (event) => {
  const { request } = event;
  if (request.method === "GET" && ADDRESSES.has(request.url.split(/[?#]/)[0])) event.respondWith(answer(request));
});

async function answer(request) {
  const found = await fetch(request).catch((error) => error);
  if (found instanceof Response && found.ok) return found;
  const kept = await (await caches.open(NAME)).match(request, { ignoreSearch: true });
  if (kept) return kept;
  if (found instanceof Response) return found;
  throw found;
}
