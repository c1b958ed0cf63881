// Access to the service from a page: requests, one WebSocket, and the lease of the page's cell.
import { HeldKey } from "./held_key.js";
import { Refusal, request } from "./requests.js";
import { lockForThisTab, unlock } from "./tab_lock.js";

export { Refusal };

/** @type {{ cell: string, role: string, who: string, simulated: boolean }} */
export const page = {
  cell: document.body.dataset.cell ?? "",
  role: document.body.dataset.role ?? "",
  who: document.body.dataset.who ?? "",
  simulated: document.body.dataset.simulated === "yes",
};
export const mayMove = page.role !== "viewer";

export const OLD_MS = 1500; // live values count as old if no new ones arrive for this time
const LEASE_S = 15;
const PATIENCE_MS = 10000;
const RENEW_MS = 2000;
const AGAIN_MS = 500;
// Two channels are watched: the WebSocket by its heartbeat, and requests by regular probe requests. While the page is
// visible, the loss of a channel is shown within 2 s.
const WATCH_MS = 100;
const STOOD_MS = 400; // a longer time between two checks means that this page was suspended
const STALE_MS = 1850; // time without a message after which a channel counts as lost
const PROBE_MS = 700; // time between two probe requests
const PROBE_PATIENCE_MS = 2000;
const MOST_PROBES = 2;
const FIRST_MS = 4000; // maximum wait for the first message of the WebSocket, while the page loads
const FRESH_MS = 1000; // before the user leaves a page, the service is not probed if it has answered within this time
const KEY = `rid-daq lease ${page.cell}`;
export const CELL = /** @type {const} */ (`/cells/${encodeURIComponent(page.cell)}`);

// Send a request to the API: ask("POST", "/cells/ir361/lease", {note}), with the lease key if we hold the cell.
// At most AT_ONCE GETs run at the same time; further ones wait. Other methods, and a GET with `urgent`, never wait and
// are not counted. `signal` cancels the request. A text as body is sent as it is: the content of a file.
/** @template {string} Method @template {string} Path @param {Method} method @param {Path} path @param {Api.BodyOf<Method, Api.Parts<Path>> | string} [body] @param {number} [patienceMs] @param {string | null} [key] @param {{ version?: string, keepalive?: boolean, urgent?: boolean, signal?: AbortSignal | null }} [more] @returns {Promise<Api.AnswerTo<Method, Api.Parts<Path>>>} */
export function ask(method, path, body = undefined, patienceMs = PATIENCE_MS, key = lease.key, { version, keepalive = false, ...more } = {}) {
  /** @type {Record<string, string>} */
  const headers = { "x-rid-daq": "page", "content-type": "application/json" };
  if (key) headers["x-rid-daq-lease"] = key;
  if (version !== undefined) headers["if-match"] = `"${version}"`;
  const options = { method, headers, keepalive, body: typeof body === "string" ? body : JSON.stringify(body) };
  return request(`/api/v1${path}`, options, { patienceMs, urgent: method !== "GET", ...more });
}

// Listeners by event, with their arguments: "cell" (status), "job" (job), "event" (job id, event, its number in the job),
// "samples" (picture, job id), "key" (job id, reason why a held key does not count),
// "signals" (binary message with live signals, after requestSignals),
// "reach" ({ values, requests }, true if the channel works),
// "again" (no arguments; after a gap, request everything that may have been missed).
/** @type {Map<keyof ServiceEvents, ((...values: any[]) => unknown)[]>} */
const listeners = new Map();

/** @template {keyof ServiceEvents} Type @param {Type} type @param {(...values: ServiceEvents[Type]) => unknown} listener */
export function on(type, listener) {
  listeners.set(type, [...(listeners.get(type) ?? []), /** @type {(...values: any[]) => unknown} */ (listener)]);
  if (type === "cell" && now.status) /** @type {(status: Api.CellStatus) => unknown} */ (listener)(now.status);
}

/** @template {keyof ServiceEvents} Type @param {Type} type @param {ServiceEvents[Type]} values */
function tell(type, ...values) {
  for (const listener of listeners.get(type) ?? []) listener(...values);
}

// `status`: newest status of the cell, null until known. `ageFrom`: time at which its preflight age was correct [ms].
/** @type {{ status: Api.CellStatus | null, ageFrom: number }} */
export const now = { status: null, ageFrom: 0 };
let statusFrom = 0;

// Store the status that was valid at the time `from`, unless a newer status is known: messages may arrive late.
/** @type {(status: SentStatus, from?: number) => void} */
function setStatus(status, from = performance.now()) {
  if (from < statusFrom) return;
  statusFrom = from;
  const fresh = "preflight_age_s" in status;
  const age = now.status?.preflight_age_s ?? null;
  /** @type {(of: SentStatus | null) => string} */
  const holder = (of) => `${of?.lease?.owner} ${of?.lease?.note}`;
  const another = holder(status) !== holder(now.status);
  const found = "preflight_age_s" in status ? status : { ...status, preflight_age_s: status.not_ready_because ? null : age };
  now.status = found;
  if (fresh) now.ageFrom = performance.now();
  if (lease.key && another) lease.renew(); // the service refuses this request if another client has the lease meanwhile
  tell("cell", found);
  if (!fresh && probes === 0) look(); // a probe that is under way, or the next one, brings the age of the preflight
}

/** @type {() => number | null} */
export function preflightAge() {
  const age = now.status?.preflight_age_s ?? null;
  return age === null ? null : age + (performance.now() - now.ageFrom) / 1000;
}

// ---- connection: the page watches two channels, the WebSocket and the HTTP requests. The service sends heartbeats on
// the WebSocket; to test the HTTP requests, the page requests the state of the cell.
// A channel without messages for STALE_MS counts as lost until a message arrives.
// A background page is checked when it is visible again.
/** @type {WebSocket | null} */
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
  // this page was suspended (by the drawing of a figure, or in the background): received messages have not been read
  // yet
  if (stood > STOOD_MS) [valuesAt, answeredAt, openedAt] = [valuesAt + stood, answeredAt + stood, openedAt + stood];
  if (document.visibilityState === "hidden") return;
  const found = { values: at - valuesAt < STALE_MS, requests: at - answeredAt < STALE_MS };
  if (found.values === reach.values && found.requests === reach.requests) return;
  const again = found.requests && !reach.requests;
  Object.assign(reach, found);
  tell("reach", reach);
  if (again) tell("again");
}

// Request the status of the cell; this request also shows that the service answers requests.
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
  mine.binaryType = "arraybuffer";
  mine.addEventListener("open", sendSignalsRequest);
  mine.addEventListener("message", (message) => {
    if (socket !== mine) return;
    judge();
    valuesAt = performance.now();
    judge();
    if (message.data instanceof ArrayBuffer) tell("signals", message.data);
    else dispatch(JSON.parse(message.data));
    if (again) tell("again");
    again = false;
  });
  mine.addEventListener("close", () => socket === mine && reconnect());
}

// Request the live signals of this page's cell on this and every later connection. `known` returns what the page
// already has: { key, known }, from the last message.
/** @type {(() => object) | null} */
let knownSignals = null;
/** @type {(known: () => object) => void} */
export function requestSignals(known) {
  knownSignals = known;
  sendSignalsRequest();
}

function sendSignalsRequest() {
  if (knownSignals === null || socket?.readyState !== WebSocket.OPEN) return;
  socket.send(JSON.stringify({ signals: page.cell, ...knownSignals() }));
}

// A WebSocket whose connection hangs does not close by itself: replace it.
function reconnect() {
  const old = socket;
  keys.cut();
  socket = null;
  old?.close();
  setTimeout(connect, AGAIN_MS, false);
}

// Return true if the service answers now. Without a probe, if both channels have just delivered data.
async function answers() {
  const at = performance.now();
  if (reach.values && reach.requests && at - Math.max(valuesAt, answeredAt) < FRESH_MS) return true;
  await look();
  return answeredAt >= at;
}

// Open another page of the service, but only if the service answers: an error page of the browser would have no STOP.
/** @type {(address: string) => Promise<void>} */
export async function go(address) {
  if (await answers()) location.assign(address);
  else stay();
}

// Say that this page stays open, because the service does not answer.
export const stay = () => tell("stay");

/** @type {(message: ServiceMessage) => void} */
function dispatch(message) {
  if (message.type === "cell" && message.cell.cell === page.cell) setStatus(message.cell);
  if (message.type === "job" && message.job.cell === page.cell) tell("job", message.job);
  if (message.type === "event") tell("event", message.job, message.event, message.number);
  if (message.type === "challenge") keys.challenge(message);
  if (message.type === "event" && message.event.kind === "key_refused") tell("key", message.job, message.event.text);
  if (message.type === "stopped") document.dispatchEvent(new CustomEvent("stop-answered", { detail: message }));
  if (message.type === "samples" && message.cell === page.cell) tell("samples", message.picture, message.job);
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

// Send the stop request on this WebSocket too.
document.addEventListener("stop-asked", ({ detail }) => {
  if (socket?.readyState === WebSocket.OPEN) socket.send(detail);
});

// ---- the lease: its key is stored in this tab.
// An open page of this tab renews the lease, even in the background (beat.js).
// A sleeping device or a copy of the tab does not renew the lease.
/** @type {{ key: string | null, lost: boolean, known: boolean, recall(): Promise<void>, take(note: string, confirmed?: string): Promise<void>, giveBack(): Promise<void>, renew(): Promise<void>, drop(): void, forget(): void }} */
export const lease = {
  key: null,
  lost: false,
  known: false,

  // Use the lease that the previous page in this tab had, if any.
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

  // Another client has taken the cell, or the lease has expired.
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

/** @type {(job: string, key: string) => void} */
export const hold = (job, key) => keys.hold(job, key);
export const letGo = () => keys.letGo();
/** @type {(job: string, key: string) => void} */
export const tap = (job, key) => keys.tap(job, key);
