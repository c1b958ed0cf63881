// Without TLS: prove to the service which browser asks, without cookies. The session secret stays in the
// storage of this origin, which no other port can read; it ends with this run of the service.
"use strict";
(() => {
  const KEY = "rid-daq session";
  const given = document.currentScript.dataset.key;
  if (given) localStorage.setItem(KEY, given);
  const secret = localStorage.getItem(KEY) ?? "none";
  const bearer = `Bearer ${secret}`;

  // ---- every request of this page, its WebSocket, and what it opens or saves
  const plainFetch = window.fetch;
  window.fetch = (target, options = {}) => {
    if (new URL(target, location).origin !== location.origin) return plainFetch(target, options);
    const headers = new Headers(options.headers);
    headers.set("authorization", bearer);
    return plainFetch(target, { ...options, headers });
  };

  const PlainSocket = window.WebSocket;
  window.WebSocket = class extends PlainSocket {
    constructor(target, ...more) {
      const address = new URL(target, location);
      const ours = address.host === location.host && /^\/api\/v1\/(ws|stop-line)$/.test(address.pathname);
      super(target, ...(ours ? [["rid-daq", `rid-daq.${secret}`]] : more));
    }
  };

  const NOT_PAGES = /^\/(api|figures|metrics)(\/|$)/;
  let passed = null;
  async function showTicket(event) {
    const link = event.target.closest?.("a[href]");
    if (!link || link === passed || link.origin !== location.origin || !NOT_PAGES.test(link.pathname)) return;
    event.preventDefault();
    const copy = link.cloneNode(false);
    try {
      const headers = { "x-rid-daq": "page", "content-type": "application/json" };
      const body = JSON.stringify({ path: decodeURIComponent(link.pathname) });
      const signal = AbortSignal.timeout(5000);
      const answer = await fetch("/api/v1/tickets", { method: "POST", headers, body, signal });
      const address = new URL(link.href);
      address.searchParams.set("ticket", (await answer.json()).ticket);
      copy.href = address;
    } catch {
      // the address itself answers why
    }
    copy.hidden = true;
    document.body.append(copy);
    passed = copy;
    copy.dispatchEvent(new MouseEvent("click", event));
    copy.remove();
  }

  // ---- the page of this address takes this one's place; until then this one has STOP
  const PATIENCE_MS = 10000;
  const AGAIN_MS = 1000;
  // the page is loaded once that one is: a child that is still being written keeps it waiting
  const pending = document.createElement("iframe");
  pending.hidden = true;
  document.body.append(pending);
  pending.contentDocument.open();

  async function load() {
    let text;
    try {
      const answer = await fetch(given ? "/" : location.href, { signal: AbortSignal.timeout(PATIENCE_MS) });
      text = await answer.text();
      if (new URL(answer.url).pathname !== location.pathname || given) history.replaceState(null, "", answer.url);
    } catch {
      document.getElementById("door-words").textContent = "The service does not answer: use the emergency stop. Trying again…";
      setTimeout(load, AGAIN_MS);
      return;
    }
    document.open(); // forgets all listeners
    document.addEventListener("click", showTicket);
    document.write(text);
    document.close();
  }
  load();
})();
