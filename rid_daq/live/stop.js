// The STOP button: the first script of each page, without imports. The button works even if no other script loads. The
// script element names the cell ("*" for all cells), the address for the stop request, and the WebSocket.
"use strict";
(() => {
  window.endStop?.(); // ends the script of the previous page; this page takes over its unanswered stop request
  const AGAIN_MS = 250; // time between two attempts to send the stop request
  const REFUSED_MS = 1000; // time between two HTTP requests if the service refuses the stop request; WebSockets keep AGAIN_MS
  const LATE_MS = 2000; // time after which the page shows that the stop request has no answer
  const TWICE_MS = 1000; // events within this time count as one press; two presses of Escape within this time request a stop
  const SHOWN_MS = 8000;
  const SILENT_MS = 1500; // a WebSocket without a heartbeat for this time is replaced
  const STOOD_MS = 800; // a longer time between two calls of watch() means that this page was suspended
  const CONNECT_MS = [100, 250, 500, 1000, 2000, 5000];
  const MOST_LINES = 4;
  const MOST_REQUESTS = 2; // a browser opens at most six connections to a server
  const REQUEST_MS = 5000;
  const KEPT_MS = 60000;
  const KEY = "rid-daq stop";
  const here = /** @type {HTMLElement} */ (document.currentScript).dataset;

  /** @type {(StopPress & { from: number, refusal: string, refusedAt: number }) | null} */
  let asked = null; // the last press of STOP, until the service has acknowledged it
  let number = Math.floor(Math.random() * 1e9);
  /** @type {[string, string] | null} */
  let answer = null; // class and text of the acknowledgement; null if none is displayed
  /** @type {Set<StopLine>} */
  const lines = new Set();
  /** @type {Set<AbortController>} */
  const requests = new Set();

  // ---- status text
  /** @type {(id: string) => HTMLElement | null} */
  const find = (id) => document.getElementById(id);

  function show() {
    const words = find("stop-words");
    if (!words) return;
    let [kind, text] = answer ?? ["", ""];
    if (asked) [kind, text] = ["wait", "Sending the stop request…"];
    if (asked && performance.now() - asked.from >= LATE_MS)
      [kind, text] = ["bad", "No answer for more than 2 s: use the emergency stop. This page repeats the request."];
    if (asked?.refusal) [kind, text] = ["bad", `Not stopped: use the emergency stop. This page repeats the request. ${asked.refusal}`];
    if (words.textContent === text && words.className === (text && `banner ${kind}`)) return;
    words.textContent = text;
    words.className = text && `banner ${kind}`;
  }

  // ---- repeat the stop request of a press until the service acknowledges the request
  function stop() {
    begin({ number: ++number, cell: here.cell ?? "", request: here.request ?? "", at: Date.now() });
  }

  /** @type {(press: StopPress) => void} */
  function begin(press) {
    asked = { ...press, from: performance.now(), refusal: "", refusedAt: -Infinity };
    answer = null;
    document.documentElement.dataset.stop = "asked";
    keep(press);
    if (here.line && !newest) connect();
    attempt();
  }

  function attempt() {
    if (!asked) return;
    show();
    const press = asked;
    if (performance.now() - press.refusedAt >= REFUSED_MS) request(press);
    const message = JSON.stringify({ stop: press.cell, number: press.number });
    for (const line of lines) if (line.readyState === WebSocket.OPEN) line.send(message);
    document.dispatchEvent(new CustomEvent("stop-asked", { detail: message }));
  }

  /** @type {(reply: StopAcknowledgement) => void} */
  function acknowledge({ number: of, sent = true, sentence = "Stop requested: check that the axes come to rest." }) {
    if (!asked || (of !== undefined && of !== asked.number)) return;
    asked = null;
    delete document.documentElement.dataset.stop;
    keep(null);
    /** @type {[string, string]} */
    const shown = [sent ? "good" : "wait", sentence];
    answer = shown;
    show();
    setTimeout(() => {
      if (answer === shown) answer = null;
      show();
    }, SHOWN_MS);
    for (const each of requests) each.abort();
    for (const line of lines) if (line !== newest) drop(line);
  }

  // Store a press of STOP in this tab: if the user leaves the page, the next page repeats the request.
  /** @type {(press: StopPress | null) => void} */
  function keep(press) {
    try {
      if (press) sessionStorage.setItem(KEY, JSON.stringify(press));
      else sessionStorage.removeItem(KEY);
    } catch {
      // the browser has no session storage: the next page cannot repeat the stop request
    }
  }

  /** @type {() => StopPress | null} */
  function kept() {
    try {
      const press = JSON.parse(sessionStorage.getItem(KEY) ?? "null");
      return press && Math.abs(Date.now() - press.at) < KEPT_MS ? press : null;
    } catch {
      return null;
    }
  }

  // ---- send the stop request by HTTP, each attempt on a new connection
  /** @type {(press: NonNullable<typeof asked>) => Promise<void>} */
  async function request(press) {
    if (requests.size >= MOST_REQUESTS) return;
    const ending = new AbortController();
    requests.add(ending);
    const patience = setTimeout(() => ending.abort(), REQUEST_MS);
    try {
      const headers = { "x-rid-daq": "stop", "content-type": "application/json" };
      /** @type {RequestInit} */
      const options = { method: "POST", headers, body: "{}", keepalive: true, priority: "high", signal: ending.signal };
      const got = await fetch(press.request, options);
      const reply = await got.json().catch(() => ({}));
      if (got.ok) acknowledge({ ...reply, number: press.number });
      else if (asked === press) {
        press.refusal = reply.message ?? `The service answered ${got.status}.`;
        press.refusedAt = performance.now();
      }
    } catch {
      // no answer: the next attempt follows
    } finally {
      clearTimeout(patience);
      requests.delete(ending);
      show();
    }
  }

  // ---- send the stop request by a separate WebSocket, which is opened in advance
  /** @type {StopLine | null} */
  let newest = null;
  let failures = 0;
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let openAgain;
  let watchedAt = performance.now();

  function connect() {
    clearTimeout(openAgain);
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss:" : "ws:"}//${location.host}${here.line}`);
    const line = Object.assign(socket, { heardAt: performance.now() });
    newest = line;
    lines.add(line);
    while (lines.size > MOST_LINES) drop([...lines][0]);
    line.addEventListener("message", (message) => {
      line.heardAt = performance.now();
      failures = 0;
      const reply = JSON.parse(message.data);
      if (reply.type === "stopped") acknowledge(reply);
    });
    line.addEventListener("open", () => {
      line.heardAt = performance.now();
      if (asked) line.send(JSON.stringify({ stop: asked.cell, number: asked.number }));
    });
    line.addEventListener("close", () => {
      lines.delete(line);
      if (newest === line) later();
    });
  }

  function later() {
    newest = null;
    openAgain = setTimeout(connect, CONNECT_MS[Math.min(failures, CONNECT_MS.length - 1)]);
    failures += 1;
  }

  /** @type {(line: StopLine) => void} */
  function drop(line) {
    lines.delete(line);
    line.close();
  }

  function watch() {
    attempt();
    const at = performance.now();
    const stood = at - watchedAt;
    watchedAt = at;
    if (newest && stood > STOOD_MS) newest.heardAt = at; // after a suspension of the page, received heartbeats have not been read yet
    if (!newest || at - newest.heardAt < SILENT_MS) return;
    const silent = newest;
    later();
    // while a stop is requested, keep the silent WebSocket if it is open, because it may still deliver the request or
    // its answer; in all other cases drop it, because one that is still connecting would delay the next one
    if (!asked || silent.readyState !== WebSocket.OPEN) drop(silent);
  }

  // ---- keys and pointers: the stop is requested when the button is pressed, not when it is released
  let pressedAt = -Infinity;
  let escapedAt = -Infinity;

  /** @type {(event: Event) => void} */
  function press(event) {
    if (!(/** @type {Element} */ (event.target).closest?.("#stop")) || event.timeStamp - pressedAt < TWICE_MS) return;
    pressedAt = event.timeStamp;
    stop();
  }

  addEventListener("pointerdown", (event) => event.button === 0 && press(event), true);
  addEventListener("click", (event) => event.button === 0 && press(event), true);
  addEventListener("keydown", (event) => {
    if (event.repeat) return;
    if (event.key === "Enter" || event.key === " ") press(event);
    if (event.key !== "Escape") return;
    if (event.timeStamp - escapedAt < TWICE_MS) {
      escapedAt = -Infinity;
      stop();
    } else escapedAt = event.timeStamp;
  }, true);

  // ---- other scripts call this if the main WebSocket delivers the service's answer, or when a motion ends
  document.addEventListener("stop-answered", (event) => acknowledge(event.detail));

  // ---- show the button as soon as the browser has read it; show a warning if a script or style sheet fails to load
  let broken = false;
  function appear() {
    const warning = find("page-broken");
    if (broken && warning) warning.hidden = false;
    const button = find("stop");
    if (!button) return;
    button.hidden = false;
    find("stop-missing")?.remove();
    show();
  }
  const appearing = new MutationObserver(appear);
  appearing.observe(document.documentElement, { childList: true, subtree: true });
  addEventListener("DOMContentLoaded", () => {
    appearing.disconnect();
    appear();
  });
  addEventListener("error", (event) => {
    const source = /** @type {HTMLScriptElement & HTMLLinkElement} */ (event.target);
    const place = event.filename ?? source.src ?? source.href ?? "";
    if (!place.startsWith(`${location.origin}/static/`)) return;
    broken = true;
    appear();
  }, true);

  if (here.line) connect();
  const watching = setInterval(watch, AGAIN_MS);
  window.endStop = () => {
    clearInterval(watching);
    clearTimeout(openAgain);
    newest = null;
    for (const line of lines) {
      if (line.readyState === WebSocket.OPEN) line.close();
      else line.addEventListener("open", () => line.close()); // a close() before the WebSocket is open causes a warning in the browser's console
    }
  };
  const unanswered = kept();
  if (unanswered) begin(unanswered);
})();
