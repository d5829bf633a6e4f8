// What the compiled part of the box's worker waits for: its line, and somebody at the page. The page has both; this end speaks to it by
// messages.

const received = [];
// Called when something happens to the line.
let wake = null;
// Why the line is no more.
let ended = null;
let written = 0;
const writing = new Map();
let answering = null;

/** A message of the page, where it is one of the line or an answer. */
export function take({ bytes, wrote, unwritten, over, typed }) {
  if (bytes) received.push(bytes);
  if (wrote) settle(writing, wrote, unwritten);
  if (over) end(over);
  if (typed !== undefined) answering?.resolve(typed);
  wake?.();
}

function end(reason) {
  ended ??= new Error(reason);
  for (const id of [...writing.keys()]) settle(writing, id, ended.message);
  answering?.reject(ended);
}

function settle(waiting, id, problem) {
  const one = waiting.get(id);
  waiting.delete(id);
  if (problem) one?.reject(new Error(problem));
  else one?.resolve();
}

/** Bytes that have come, `most` of them or fewer; none where none come within the limit. */
export async function read(most, limitMs) {
  if (!ended && received.length === 0) await somethingWithin(limitMs);
  if (ended) throw ended;
  const [first] = received;
  if (!first) return new Uint8Array();
  if (first.length > most) received[0] = first.subarray(most);
  else received.shift();
  return first.subarray(0, most);
}

function somethingWithin(limitMs) {
  return new Promise((resolve) => {
    const limit = setTimeout(() => wake(), limitMs);
    wake = () => {
      clearTimeout(limit);
      wake = null;
      resolve();
    };
  });
}

/** Sends bytes, and waits until they have gone. */
export async function write(bytes, limitMs) {
  if (ended) throw ended;
  written += 1;
  const id = written;
  const gone = new Promise((resolve, reject) => writing.set(id, { resolve, reject }));
  const limit = setTimeout(() => settle(writing, id, "the other end does not take its bytes"), limitMs);
  postMessage({ write: bytes, id });
  await gone.finally(() => clearTimeout(limit));
}

/** What somebody types in answer to a question. */
export async function ask(question) {
  if (ended) throw ended;
  const answer = new Promise((resolve, reject) => { answering = { resolve, reject }; });
  postMessage({ question });
  return answer.finally(() => { answering = null; });
}

/** Says something to the page. */
export function tell(what) {
  postMessage({ heard: JSON.parse(what) });
}
