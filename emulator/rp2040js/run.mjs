// Runs an RP2040 image in rp2040js. Each line on stdin is a run as JSON, of which the first has the image and every other one goes on where the
// one before has ended; each is answered on stdout by a line with its trace, and before that by one for each question of a responder that has
// no answers of its own, which a line on stdin answers. `Run`, `Trace` and `Live` in `../src/rp2040` are the other side. The argument is the
// folder that holds `node_modules`.

import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { readLine, writeLine } from './lines.mjs';
import { Machine } from './machine.mjs';

const library = join(process.argv[2], 'node_modules', 'rp2040js', 'dist', 'esm', 'index.js');
const rp2040js = await import(pathToFileURL(library));

function ask(question) {
  writeLine({ question });
  return readLine() ?? [];
}

let machine = null;
for (let run = readLine(); run !== null; run = readLine()) {
  machine ??= new Machine(rp2040js, run, ask);
  machine.run(run);
  writeLine({ trace: machine.trace() });
}
