// Runs an RP2040 image in rp2040js: a run as JSON on stdin, its trace as JSON on stdout.
// `Run` and `Trace` in `../src/rp2040` are the two forms. The argument is the folder that holds `node_modules`.

import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import { Machine } from './machine.mjs';

const library = join(process.argv[2], 'node_modules', 'rp2040js', 'dist', 'esm', 'index.js');
const rp2040js = await import(pathToFileURL(library));
const machine = new Machine(rp2040js, JSON.parse(readFileSync(0, 'utf8')));
machine.run();
process.stdout.write(JSON.stringify(machine.trace()));
