// The box, over USB.

import { element, sentence } from "./element.js";

/** Fills the section of the box. */
export function deviceSection(host) {
  const isThere = "serial" in navigator;
  host.append(element("p", {}, sentence(isThere
    ? "This page has no part that speaks to the box; `rotorlead device` does."
    : "This browser has no Web Serial, which the box needs; Chromium, Chrome and Edge have it. `rotorlead device` does the same.")));
}
