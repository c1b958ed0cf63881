// The service as pages use it: requests, one WebSocket, the lease of this page's cell.
import { HeldKey } from "./held_key.js";

export const page = {
  cell: document.body.dataset.cell,
  role: document.body.dataset.role,
  who: document.body.dataset.who,
  simulated: document.body.dataset.simulated === "yes",
};
export const mayMove = page.role !== "viewer";

const LEASE_S = 15;
const BEAT_MS = 4000;
const PATIENCE_MS = 10000;
const ALIVE_MS = 2000;
const WATCH_MS = 200;
const SILENT_MS = 800;
const SIGN_MS = 1000;
const AGAIN_MS = 1000;
const KEY = `rid-daq lease ${page.cell}`;
const CELL = `/cells/${encodeURIComponent(page.cell)}`;

// What the service has refused, or that it does not answer: `message` is a sentence for people.
export class Refusal extends Error {
  constructor(kind, message, status) {
    super(message);
    this.kind = kind;
    this.status = status;
  }
}

// Ask the API: ask("POST", "/cells/ir361/lease", {note}); the cell's lease is shown where we have it.
export async function ask(method, path, body = undefined, patienceMs = PATIENCE_MS, key = lease.key) {
  const headers = { "x-rid-daq": "page", "content-type": "application/json" };
  if (key) headers["x-rid-daq-lease"] = key;
  let answer, text;
  try {
    answer = await fetch(`/api/v1${path}`, {
      method,
      headers,
      body: body === undefined ? undefined : JSON.stringify(body),
      signal: AbortSignal.timeout(patienceMs),
    });
    text = await answer.text();
  } catch {
    throw new Refusal("OutOfReach", "The service does not answer.", 0);
  }
  if (answer.ok) return text ? JSON.parse(text) : null;
  throw refusalOf(answer, text);
}

function refusalOf(answer, text) {
  try {
    const told = JSON.parse(text);
    if (told.message) return new Refusal(told.error, told.message, answer.status);
  } catch {
    // an answer of the server itself, without words
  }
  if (answer.status === 401) return new Refusal("NotKnownError", "This device is not let in any more.", 401);
  return new Refusal("Refused", `The service refuses this (${answer.status}).`, answer.status);
}

// Listeners: "cell" (status), "job" (job), "event" (job id, event), "samples" (picture, job id),
// "key" (job id and text: why a held key does not count), "reach" (true or false), "again" (after a gap: ask for what may have been missed).
const listeners = new Map();

export function on(type, listener) {
  listeners.set(type, [...(listeners.get(type) ?? []), listener]);
  if (type === "cell" && now.status) listener(now.status);
}

function tell(type, ...values) {
  for (const listener of listeners.get(type) ?? []) listener(...values);
}

// The newest status of the cell, null until it is known; ageFrom is when its age was true.
export const now = { status: null, ageFrom: 0 };

function setStatus(status) {
  const fresh = "preflight_age_s" in status;
  const age = now.status?.preflight_age_s ?? null;
  const holder = (of) => `${of?.lease?.owner} ${of?.lease?.note}`;
  const another = holder(status) !== holder(now.status);
  now.status = fresh ? status : { ...status, preflight_age_s: status.not_ready_because ? null : age };
  if (fresh) now.ageFrom = performance.now();
  if (lease.key && another) lease.renew(); // tells whether it is still ours
  tell("cell", now.status);
  if (!fresh) look();
}

export function preflightAge() {
  const age = now.status?.preflight_age_s ?? null;
  return age === null ? null : age + (performance.now() - now.ageFrom) / 1000;
}

// ---- reach: the socket is open, and the service answers within two seconds. While a job has the cell it
// is seldom silent: a page that hears nothing for a while asks, so that a person knows within two seconds.
let socket = null;
let answers = true;
let reached = null;
let heardAt = 0;
let watching = false;

function noteReach() {
  const reach = answers && socket?.readyState === WebSocket.OPEN;
  if (reach === reached) return;
  const again = reach && reached === false;
  reached = reach;
  tell("reach", reach);
  if (again) tell("again");
}

function hear() {
  heardAt = performance.now();
  answers = true;
  noteReach();
}

async function look(patienceMs = ALIVE_MS) {
  const from = performance.now();
  try {
    const status = await ask("GET", CELL, undefined, patienceMs);
    hear();
    setStatus(status);
  } catch (error) {
    if (error.status === 401) location.assign("/pair");
    answers = error.status !== 0 || heardAt > from;
    noteReach();
  }
}

async function watch() {
  if (watching || !now.status?.job || performance.now() - heardAt < SILENT_MS) return;
  watching = true;
  await look(SIGN_MS);
  watching = false;
}

export function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(`${scheme}//${location.host}/api/v1/ws`);
  socket.addEventListener("open", noteReach);
  socket.addEventListener("message", (message) => {
    hear();
    dispatch(JSON.parse(message.data));
  });
  socket.addEventListener("close", () => {
    keys.cut();
    noteReach();
    setTimeout(connect, AGAIN_MS);
  });
}

function dispatch(told) {
  if (told.type === "cell" && told.cell.cell === page.cell) setStatus(told.cell);
  if (told.type === "job" && told.job.cell === page.cell) tell("job", told.job);
  if (told.type === "event") tell("event", told.job, told.event);
  if (told.type === "challenge") keys.challenge(told);
  if (told.type === "event" && told.event.kind === "key_refused") tell("key", told.job, told.event.text);
  if (told.type === "samples" && told.cell === page.cell) tell("samples", told.picture, told.job);
}

export function begin() {
  connect();
  look();
  if (lease.key) lease.renew();
  setInterval(look, BEAT_MS);
  setInterval(watch, WATCH_MS);
  new Worker("/static/beat.js").addEventListener("message", () => lease.key && lease.renew());
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState === "visible") {
      look();
      if (lease.key) lease.renew();
    }
  });
}

// ---- the lease: its key stays in this tab, and is renewed as long as one of our pages is open, in
// the background too (beat.js); not by a device that sleeps
export const lease = {
  key: sessionStorage.getItem(KEY),
  lost: false,

  async take(note, confirmed = undefined) {
    const held = await ask("POST", `${CELL}/lease`, { note, seconds: LEASE_S, confirmed });
    this.key = held.key;
    this.lost = false;
    sessionStorage.setItem(KEY, held.key);
    await look();
  },

  async giveBack() {
    const key = this.key;
    this.forget();
    await ask("DELETE", `${CELL}/lease`, undefined, PATIENCE_MS, key);
    await look();
  },

  async renew() {
    const key = this.key;
    try {
      await ask("PUT", `${CELL}/lease`, { seconds: LEASE_S }, ALIVE_MS);
    } catch (error) {
      if (error.status === 409 && key === this.key) this.drop();
    }
  },

  // Somebody else has the cell now, or the lease has run out.
  drop() {
    this.forget();
    this.lost = true;
    if (now.status) tell("cell", now.status);
  },

  forget() {
    this.key = null;
    sessionStorage.removeItem(KEY);
  },
};

// ---- jobs
export const beginJob = (kind, request = {}, more = {}) =>
  ask("POST", `${CELL}/jobs`, { kind, request, ...more }, 3 * PATIENCE_MS);

export const answerJob = (job, question, text) => ask("POST", `/jobs/${job}/answer`, { question, text });

// ---- held keys
const keys = new HeldKey((message) => {
  if (socket?.readyState !== WebSocket.OPEN || !lease.key) return false;
  socket.send(JSON.stringify({ ...message, lease: lease.key }));
  return true;
}, (job, text) => tell("key", job, text));

export const hold = (job, key) => keys.hold(job, key);
export const letGo = () => keys.letGo();
export const tap = (job, key) => keys.tap(job, key);
