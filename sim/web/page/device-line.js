// The serial port of the box, and the worker that speaks over it. All bytes pass through the page, so a page that is closed, hidden or hangs
// keeps nothing alive: the box then stops its motors by itself.

/** What the browser lacks for the box, as a sentence; `null` where it has all. */
export function whatIsMissing() {
  const instead = "`rotorlead device` on the command line does the same.";
  if (!window.isSecureContext) return `A page speaks to the box over https, or from this machine (localhost). ${instead}`;
  if (!("serial" in navigator)) return `This browser has no Web Serial, which the box needs; Chromium, Chrome and Edge have it. ${instead}`;
  const hasPromises = "Suspending" in WebAssembly && "promising" in WebAssembly;
  return hasPromises ? null : `This browser cannot wait for the box (WebAssembly's JSPI): Chromium, Chrome and Edge can from version 137 on. ${instead}`;
}

const IN_USE = "close what has it open, another page or `rotorlead device`; on Linux your user needs the group of the port, most often dialout";

/** A conversation with a box. `heard`, `asked` and `over` are called with what it says, with a question, and with why it ended. */
export class Line {
  #worker = new Worker(new URL("device-worker.js", import.meta.url), { type: "module" });
  #port;
  #reader = null;
  #writer = null;
  #waiting = new Map();
  #asked = 0;
  #over = null;
  #ready;

  constructor(port, { heard, asked, over }) {
    this.#port = port;
    this.heard = heard;
    this.asked = asked;
    this.over = over;
    this.#ready = new Promise((resolve) => { this.#start = resolve; });
    this.#worker.addEventListener("message", ({ data }) => this.#take(data));
    this.#worker.addEventListener("error", (event) => {
      event.preventDefault();
      this.cut(`the program of the box has ended: ${event.message ?? "it could not be loaded"}`);
    });
  }
  #start;

  /** Opens the port, and gives what there is to know of the box before it is asked. */
  async open(limitS) {
    const facts = await this.#ready;
    if (this.#over) throw new Error(this.#over);
    this.#stop = new Uint8Array(facts.stop);
    await this.#port.open({ baudRate: facts.baud, bufferSize: 1 << 16 }).catch((error) => {
      throw Object.assign(new Error(`the port cannot be opened: ${error.message}`), { help: IN_USE });
    });
    this.#reader = this.#port.readable.getReader();
    this.#writer = this.#port.writable.getWriter();
    this.#listen();
    await this.#send({ open: { name: nameOf(this.#port), limitS } });
    return facts;
  }
  #stop;

  get isOver() {
    return this.#over !== null;
  }

  /** Asks the box. */
  ask(ask) {
    return this.#send({ ask });
  }

  /** Answers its question. */
  answer(typed) {
    this.#worker.postMessage({ typed });
  }

  /** Sends what stops the motors and nothing behind it, and ends. */
  cut(reason) {
    if (this.#over) return;
    // It goes from here, whatever the worker does.
    const stopped = this.#writer?.write(this.#stop).catch(() => {});
    this.end(reason, stopped, "the page has cut the line");
  }

  /** Ends the conversation, and closes the port once `before` is done. `inShort` is what the program has for a reason. */
  async end(reason, before = null, inShort = reason) {
    if (this.#over) return;
    this.#over = reason;
    this.#start({ stop: [] });
    this.#worker.postMessage({ over: inShort });
    this.over(reason);
    // A box that takes nothing any more is not waited for.
    const within = (job) => Promise.race([job.then(() => true), new Promise((resolve) => { setTimeout(resolve, 1000, false); })]);
    if (before && !(await within(before))) this.#writer.abort().catch(() => {});
    // Whoever waits has the reason from the program itself, where it still answers.
    await within(this.#answered());
    this.#worker.terminate();
    for (const { reject } of this.#waiting.values()) reject(new Error(reason));
    this.#waiting.clear();
    await this.#reader?.cancel().catch(() => {});
    this.#reader?.releaseLock();
    this.#writer?.releaseLock();
    await this.#port.close().catch(() => {});
  }

  #answered() {
    return Promise.allSettled([...this.#waiting.values()].map(({ answer }) => answer));
  }

  #send(question) {
    if (this.#over) return Promise.reject(new Error(this.#over));
    this.#asked += 1;
    const id = this.#asked;
    const waiting = {};
    waiting.answer = new Promise((resolve, reject) => Object.assign(waiting, { resolve, reject }));
    this.#waiting.set(id, waiting);
    this.#worker.postMessage({ id, ...question });
    return waiting.answer;
  }

  #take({ facts, id, answer, broken, write, question, heard }) {
    if (facts) this.#start(facts);
    else if (answer) this.#resolve(id, answer);
    else if (broken !== undefined) this.cut(`the program of the box has ended: ${broken}`);
    else if (write) this.#write(id, write);
    else if (question) this.asked(question);
    else if (heard) this.heard(heard);
  }

  #resolve(id, answer) {
    const waiting = this.#waiting.get(id);
    this.#waiting.delete(id);
    waiting.resolve(answer);
  }

  async #write(wrote, bytes) {
    // Behind a cut nothing goes out.
    if (this.#over) return;
    try {
      await this.#writer.write(bytes);
      this.#worker.postMessage({ wrote });
    } catch (error) {
      this.#worker.postMessage({ wrote, unwritten: error.message });
    }
  }

  async #listen() {
    try {
      for (;;) {
        const { value, done } = await this.#reader.read();
        if (done) break;
        this.#worker.postMessage({ bytes: value }, [value.buffer]);
      }
      this.end("the port was closed");
    } catch (error) {
      this.end(`the port is gone: ${error.message}`);
    }
  }
}

function nameOf(port) {
  const { usbVendorId, usbProductId } = port.getInfo();
  const hex = (number) => number.toString(16).padStart(4, "0");
  return usbVendorId === undefined ? "the serial port" : `USB ${hex(usbVendorId)}:${hex(usbProductId)}`;
}
