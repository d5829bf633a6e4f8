// Lines of JSON on stdin and stdout, which whoever reads them waits for: the emulated time stands still meanwhile.

import { readSync, writeSync } from 'node:fs';

const [STDIN, STDOUT] = [0, 1];
const LINE_FEED = 10;
const chunk = Buffer.alloc(1 << 16);
// What has been read of the lines that follow.
let rest = Buffer.alloc(0);

// The next line; `null` at the end.
export function readLine() {
  const parts = [];
  for (;;) {
    const end = rest.indexOf(LINE_FEED);
    if (end >= 0) {
      parts.push(rest.subarray(0, end));
      rest = rest.subarray(end + 1);
      return JSON.parse(Buffer.concat(parts).toString());
    }
    parts.push(rest);
    const length = readSync(STDIN, chunk);
    if (length === 0) {
      return null;
    }
    rest = Buffer.from(chunk.subarray(0, length));
  }
}

export function writeLine(value) {
  const bytes = Buffer.from(JSON.stringify(value) + '\n');
  for (let from = 0; from < bytes.length;) {
    from += writeSync(STDOUT, bytes, from);
  }
}
