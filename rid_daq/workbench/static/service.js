// The service as pages use it: requests, one WebSocket, the lease of this page's cell.
import { HeldKey } from "./held_key.js";
import { Refusal, request } from "./requests.js";
import { lockForThisTab, unlock } from "./tab_lock.js";

export { Refusal };

export const page = {
  cell: document.body.dataset.cell,
  role: document.body.dataset.role,
  who: document.body.dataset.who,
  simulated: document.body.dataset.simulated === "yes",
};
export const mayMove = page.role !== "viewer";

const LEASE_S = 15;
const PATIENCE_MS = 10000;
const RENEW_MS = 2000;
const AGAIN_MS = 500;
// Both channels have a heartbeat; silence is told within 2 s.
const WATCH_MS = 100;
const STOOD_MS = 400; // between two looks
const STALE_MS = 1850; // without a word on a channel
const PROBE_MS = 700; // from one probe of the requests to the next
const PROBE_PATIENCE_MS = 2000;
const MOST_PROBES = 2;
const FIRST_MS = 4000; // for the first word of the WebSocket, while the page loads
const FRESH_MS = 1000; // a service that was heard so lately is not asked before a page is left
const KEY = `rid-daq lease ${page.cell}`;
export const CELL = `/cells/${encodeURIComponent(page.cell)}`;

// Ask the API: ask("POST", "/cells/ir361/lease", {note}); the cell's lease is shown where we have it.
// A GET waits while others are under way; what changes something does not. `signal` ends it.
export function ask(method, path, body = undefined, patienceMs = PATIENCE_MS, key = lease.key, more = {}) {
  const headers = { "x-rid-daq": "page", "content-type": "application/json" };
  if (key) headers["x-rid-daq-lease"] = key;
  const options = { method, headers, body: body === undefined ? undefined : JSON.stringify(body) };
  return request(`/api/v1${path}`, options, { patienceMs, urgent: method !== "GET", ...more });
}

// Listeners: "cell" (status), "job" (job), "event" (job id, event), "samples" (picture, job id),
// "key" (job id and text: why a held key does not count), "reach" ({ values, requests }: whether each
// channel is alive), "again" (after a gap: ask for what may have been missed).
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
let statusFrom = 0;

// Take the status that was true at `from`, unless a newer one is known: links deliver late.
function setStatus(status, from = performance.now()) {
  if (from < statusFrom) return;
  statusFrom = from;
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

// ---- reach: the WebSocket beats twice a second; requests are probed. A channel that was silent for
// too long is dead until it is heard again. A page in the background is judged once it is seen again.
let socket = null;
let openedAt = 0;
let valuesAt = 0;
let answeredAt = 0;
let probedAt = -Infinity;
let judgedAt = 0;
let probes = 0;
export const reach = { values: true, requests: true };

function judge() {
  const at = performance.now();
  const stood = at - judgedAt;
  judgedAt = at;
  // this page itself stood (it drew a figure, or was in the background): what came is yet to be read
  if (stood > STOOD_MS) [valuesAt, answeredAt, openedAt] = [valuesAt + stood, answeredAt + stood, openedAt + stood];
  if (document.visibilityState === "hidden") return;
  const found = { values: at - valuesAt < STALE_MS, requests: at - answeredAt < STALE_MS };
  if (found.values === reach.values && found.requests === reach.requests) return;
  const again = found.requests && !reach.requests;
  Object.assign(reach, found);
  tell("reach", reach);
  if (again) tell("again");
}

// The cell as it is now: also the heartbeat of requests.
async function look() {
  const from = performance.now();
  probedAt = from;
  probes += 1;
  try {
    const status = await ask("GET", CELL, undefined, PROBE_PATIENCE_MS, lease.key, { urgent: true });
    judge();
    answeredAt = performance.now();
    setStatus(status, from);
  } catch (error) {
    if (error.status === 401) location.assign("/pair");
    if (error.status !== 0) answeredAt = performance.now();
  } finally {
    probes -= 1;
  }
  judge();
}

function watch() {
  const at = performance.now();
  judge();
  if (socket && at - Math.max(valuesAt, openedAt) > STALE_MS) reconnect();
  if (at - probedAt > PROBE_MS && probes < MOST_PROBES) look();
}

function connect(first = false) {
  const mine = new WebSocket(`${location.protocol === "https:" ? "wss:" : "ws:"}//${location.host}/api/v1/ws`);
  let again = !first;
  socket = mine;
  openedAt = performance.now();
  mine.addEventListener("message", (message) => {
    if (socket !== mine) return;
    judge();
    valuesAt = performance.now();
    judge();
    dispatch(JSON.parse(message.data));
    if (again) tell("again");
    again = false;
  });
  mine.addEventListener("close", () => socket === mine && reconnect());
}

// A WebSocket that hangs does not close by itself: another one takes its place.
function reconnect() {
  const old = socket;
  keys.cut();
  socket = null;
  old.close();
  setTimeout(connect, AGAIN_MS, false);
}

// True if the service answers now; it is not asked if both channels work and it was heard just now.
async function answers() {
  const at = performance.now();
  if (reach.values && reach.requests && at - Math.max(valuesAt, answeredAt) < FRESH_MS) return true;
  await look();
  return answeredAt >= at;
}

// Go to another page of ours. A page that cannot be reached would be the browser's own, without STOP.
export async function go(address) {
  if (await answers()) location.assign(address);
  else tell("stay");
}

function dispatch(told) {
  if (told.type === "cell" && told.cell.cell === page.cell) setStatus(told.cell);
  if (told.type === "job" && told.job.cell === page.cell) tell("job", told.job);
  if (told.type === "event") tell("event", told.job, told.event);
  if (told.type === "challenge") keys.challenge(told);
  if (told.type === "event" && told.event.kind === "key_refused") tell("key", told.job, told.event.text);
  if (told.type === "stopped") document.dispatchEvent(new CustomEvent("stop-answered", { detail: told }));
  if (told.type === "samples" && told.cell === page.cell) tell("samples", told.picture, told.job);
}

export function begin() {
  const at = performance.now();
  [valuesAt, answeredAt, judgedAt] = [at + FIRST_MS - STALE_MS, at + FIRST_MS - STALE_MS, at];
  connect(true);
  look();
  lease.recall();
  setInterval(watch, WATCH_MS);
  new Worker(new URL("./beat.js", import.meta.url)).addEventListener("message", () => lease.key && lease.renew());
  document.addEventListener("visibilitychange", () => {
    if (document.visibilityState !== "visible") return;
    look();
    if (lease.key) lease.renew();
  });
}

// STOP goes by this WebSocket too.
document.addEventListener("stop-asked", ({ detail }) => {
  if (socket?.readyState === WebSocket.OPEN) socket.send(detail);
});

// ---- the lease: its key stays in this tab, and is renewed as long as one of our pages is open, in
// the background too (beat.js); not by a device that sleeps, nor by a copy of the tab
export const lease = {
  key: null,
  lost: false,
  known: false,

  // The page before in this tab may have had the lease.
  async recall() {
    const key = sessionStorage.getItem(KEY);
    if (key !== null && (await lockForThisTab(`${KEY} ${key}`))) this.key = key;
    else sessionStorage.removeItem(KEY);
    this.known = true;
    if (this.key) this.renew();
    if (now.status) tell("cell", now.status);
  },

  async take(note, confirmed = undefined) {
    const held = await ask("POST", `${CELL}/lease`, { note, seconds: LEASE_S, confirmed });
    this.key = held.key;
    this.lost = false;
    sessionStorage.setItem(KEY, held.key);
    await lockForThisTab(`${KEY} ${held.key}`);
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
      await ask("PUT", `${CELL}/lease`, { seconds: LEASE_S }, RENEW_MS);
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
    unlock();
    sessionStorage.removeItem(KEY);
  },
};

// ---- held keys
const keys = new HeldKey((message) => {
  if (socket?.readyState !== WebSocket.OPEN || !lease.key) return false;
  socket.send(JSON.stringify({ ...message, lease: lease.key }));
  return true;
}, (job, text) => tell("key", job, text));

export const hold = (job, key) => keys.hold(job, key);
export const letGo = () => keys.letGo();
export const tap = (job, key) => keys.tap(job, key);
