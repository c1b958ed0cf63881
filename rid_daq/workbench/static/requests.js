// Sends requests to the service. Their duration and number are limited, so that they never delay a stop request.
import { inPageWords } from "./page_words.js";

export const LIST_MS = 60000; // timeout of lists: after its start, the service first reads every run
const AT_ONCE = 3; // a browser opens at most six connections; STOP and the heartbeat need the other three

// A request that was refused or not answered; `message` is a sentence for the user in the words of the page, and
// `original` the same sentence as the service wrote it.
export class Refusal extends Error {
  /** @param {string} kind @param {string} original @param {number} status */
  constructor(kind, original, status) {
    super(inPageWords(original));
    this.original = original;
    this.kind = kind;
    this.status = status;
  }
}

// True if a request was cancelled because a newer one replaces it: there is nothing to show.
/** @type {(error: Error) => boolean} */
export const isReplaced = (error) => error instanceof Refusal && error.kind === "Replaced";

let underWay = 0;
/** @type {(() => void)[]} */
const waiting = [];

async function turn() {
  if (underWay >= AT_ONCE) await new Promise((/** @type {(nothing: void) => void} */ resolve) => waiting.push(resolve));
  underWay += 1;
}

function leave() {
  underWay -= 1;
  waiting.shift()?.();
}

// Send a request and return its JSON. An `urgent` request does not wait for other requests; `signal` cancels it.
/** @type {(url: string, options?: RequestInit, more?: RequestLimits) => Promise<any>} */
export async function request(url, options = {}, { patienceMs, urgent = false, signal = null } = {}) {
  if (!urgent) await turn();
  const ending = new AbortController();
  const end = () => ending.abort();
  const patience = setTimeout(end, patienceMs);
  signal?.addEventListener("abort", end);
  let answer, text;
  try {
    signal?.throwIfAborted();
    answer = await fetch(url, { ...options, signal: ending.signal });
    text = await answer.text();
  } catch {
    if (signal?.aborted) throw new Refusal("Replaced", "A newer request replaces this one.", 0);
    throw new Refusal("OutOfReach", "The service does not answer.", 0);
  } finally {
    clearTimeout(patience);
    signal?.removeEventListener("abort", end);
    if (!urgent) leave();
  }
  if (!answer.ok) throw refusalOf(answer, text);
  return text ? JSON.parse(text) : null;
}

// Send a document to an address of the pages, which is not part of the API, and return the answer.
/** @type {(url: string, document: object, options: RequestLimits) => Promise<any>} */
export function post(url, document, options) {
  const headers = { "x-rid-daq": "page", "content-type": "application/json" };
  return request(url, { method: "POST", headers, body: JSON.stringify(document) }, options);
}

/** @type {(answer: Response, text: string) => Refusal} */
function refusalOf(answer, text) {
  try {
    const refusal = JSON.parse(text);
    if (refusal.message) return new Refusal(refusal.error, refusal.message, answer.status);
  } catch {
    // the answer has no message if the web server answered instead of the service
  }
  if (answer.status === 401) return new Refusal("NotKnownError", "This device no longer has access.", 401);
  return new Refusal("Refused", `The service refused the request (status ${answer.status}).`, answer.status);
}

// Return a function that returns a signal for each request of a series, and cancels the previous request.
export function newest() {
  /** @type {AbortController | null} */
  let ending = null;
  return () => {
    ending?.abort();
    ending = new AbortController();
    return ending.signal;
  };
}
