// The browser's own log of its network: that of all its pages and of all their workers.

import { readFile } from "node:fs/promises";

/** Every address that a page or a worker of one has asked for, in the log that `--log-net-log` has written. What the browser asks by itself, as
 * for a newer version, has no page that began it. */
export async function requestsOf(path) {
  const { constants, events } = JSON.parse(await readFile(path, "utf8"));
  const start = constants.logEventTypes.URL_REQUEST_START_JOB;
  const asked = events.filter(({ type, params }) => type === start && params?.url && params.initiator !== "not an origin");
  return [...new Set(asked.map(({ params }) => params.url))];
}
