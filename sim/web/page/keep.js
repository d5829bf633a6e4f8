// Files to keep.

import { element } from "./element.js";

/** Gives a file to whoever reads the page. */
export function keep(name, content, type = "text/plain") {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = element("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  // When the download runs the address is not needed any more.
  setTimeout(() => URL.revokeObjectURL(address), 60_000);
}

/** Base64 as bytes. */
export function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}
