// The engine as the page sees it: questions to a worker, answered later.

/** The worker ended before it answered. `reason` is `null` where that was wanted. */
export class Ended extends Error {
  constructor(reason) {
    super(reason ?? "stopped");
    this.reason = reason;
  }
}

// Compiled once, for all workers.
const compiled = (async () => {
  const response = await fetch(new URL("rotorlead_web_bg.wasm", import.meta.url));
  if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
  // Not every server knows what it serves.
  const isKnown = response.headers.get("content-type")?.startsWith("application/wasm");
  return isKnown ? WebAssembly.compileStreaming(response) : WebAssembly.compile(await response.arrayBuffer());
})();
// Who starts a worker hears of it.
compiled.catch(() => {});

/** Whether an error of the reader asks for what a log does not say of itself. */
export function isQuestion({ missing, columns }) {
  return Boolean(missing?.length || columns?.length);
}

/** A worker with the engine in it. */
export class Engine {
  #worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
  #waiting = new Map();
  #asked = 0;
  #ended = null;

  constructor() {
    this.#worker.addEventListener("message", ({ data }) => this.#take(data));
    this.#worker.addEventListener("error", (event) => {
      event.preventDefault();
      this.end(event.message || "its program could not be loaded");
    });
    compiled.then(
      (engine) => this.#worker.postMessage({ engine }),
      (error) => this.end(`the engine could not be loaded: ${error.message}`),
    );
  }

  /** Whether it ever answered. One that did not would not if it were started again. */
  hasAnswered = false;

  /** Whether it can be asked no more. */
  get hasEnded() {
    return this.#ended !== null;
  }

  /** Asks what `worker.js` answers. `watch` is called with the stage and the steps done. */
  ask(question, watch = () => {}) {
    if (this.#ended) return Promise.reject(this.#ended);
    this.#asked += 1;
    const id = this.#asked;
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject, watch });
      this.#worker.postMessage({ id, ...question });
    });
  }

  /** Ends the worker, whatever it does. */
  end(reason = null) {
    if (this.#ended) return;
    this.#ended = new Ended(reason);
    this.#worker.terminate();
    for (const { reject } of this.#waiting.values()) reject(this.#ended);
    this.#waiting.clear();
    this.onEnd?.(reason);
  }

  #take({ id, answer, broken, stage, steps }) {
    const waiting = this.#waiting.get(id);
    if (broken !== undefined) {
      this.end(broken);
    } else if (answer) {
      this.hasAnswered = true;
      this.#waiting.delete(id);
      waiting.resolve(answer);
    } else {
      waiting.watch(stage, steps);
    }
  }
}

/** A motor's engine: starts another worker where one ended, and brings it to where the last one was. */
export class MotorEngine {
  #engine = new Engine();
  // What was answered and has to be asked again in another worker: files and their reading, then the last answer, then what a slider shows.
  #past = [];
  #restored = Promise.resolve();

  /** `broke` is called where a worker ended that was not meant to: with why, and when another one is where that was, or `null` of a diagnosis. */
  constructor(broke) {
    this.broke = broke;
    this.#heed();
  }

  #heed() {
    const engine = this.#engine;
    engine.onEnd = (reason) => {
      // One that has never answered, or not come to where the last one was, would end again: the next reading starts another.
      if (reason === null || (engine.hasAnswered && !this.#isRestoring)) this.#restart();
      else this.#fail(new Ended(reason));
      if (reason !== null) this.broke(reason, this.#restored);
    };
  }

  #isRestoring = false;

  #restart() {
    this.#engine = new Engine();
    this.#heed();
    const [engine, past] = [this.#engine, this.#past];
    this.#isRestoring = true;
    this.#restored = (async () => {
      for (const { question } of past) {
        const { error } = await engine.ask(question);
        if (error) throw new Ended(error.message);
      }
      if (this.#engine === engine) this.#isRestoring = false;
    })();
    // Who asks next hears of it.
    this.#restored.catch(() => {});
  }

  #fail(error) {
    this.#restored = Promise.reject(error);
    this.#restored.catch(() => {});
  }

  /** Takes files, read with these options. */
  read(files, options, heldOut, watch) {
    return this.#ask("read", 0, { files, ask: { ask: "read", options, held_out: heldOut } }, watch);
  }

  /** Each file with what is wrong with it by itself, or `null`. */
  async check(files, options) {
    const apart = this.#apart = new Engine();
    const checked = [];
    try {
      for (const file of files) {
        const { error } = await apart.ask({ files: [file], ask: { ask: "read", options } });
        checked.push({ file, error: error && !isQuestion(error) ? error : null });
      }
    } finally {
      this.#apart = null;
      apart.end();
    }
    return checked;
  }

  /** What the records say. */
  answer(request, watch) {
    return this.#ask("answer", 1, { ask: { ask: "answer", ...request } }, watch);
  }

  /** What an inverse of this natural frequency gains. */
  fly(request) {
    return this.#ask("fly", 2, { ask: { ask: "fly", ...request } });
  }

  /** An export or a file, which changes nothing. */
  get(request) {
    return this.#ask(null, 3, { ask: request });
  }

  async #ask(name, depth, question, watch) {
    // Where restoring failed, a reading starts anew.
    await (depth === 0 ? null : this.#restored);
    if (depth === 0 && this.#engine.hasEnded) this.#restart();
    const engine = this.#engine;
    const answer = await engine.ask(question, watch);
    if (name && !answer.error) this.#past = [...this.#past.filter((one) => one.depth < depth), { depth, question }];
    return answer;
  }

  /** Asks for a long answer in a worker made for it, which takes the place of this one when it is done. */
  async answerApart(request, watch) {
    const apart = new Engine();
    this.#apart = apart;
    apart.onEnd = (reason) => reason !== null && this.broke(reason, null);
    try {
      const [read] = this.#past;
      const again = await apart.ask(read.question, watch);
      if (again.error) return again;
      const question = { ask: { ask: "answer", ...request } };
      const answer = await apart.ask(question, watch);
      if (!answer.error) {
        this.#engine.onEnd = null;
        this.#engine.end();
        this.#engine = apart;
        this.#heed();
        this.#past = [read, { depth: 1, question }];
        this.#restored = Promise.resolve();
        this.#isRestoring = false;
      }
      return answer;
    } finally {
      this.#apart = null;
      if (this.#engine !== apart) apart.end();
    }
  }
  #apart = null;

  /** Stops the long answer, or else what is asked now; the state before it is there again. */
  cancel() {
    (this.#apart ?? this.#engine).end();
  }

  /** Lets go of it. */
  close() {
    this.#engine.onEnd = null;
    this.#engine.end();
    this.#apart?.end();
  }
}
