// Identifies this browser to a service without TLS; no cookies are used. The session secret is in this origin's local
// storage, which a page of another port cannot read. The secret is valid until the service ends.
"use strict";
(() => {
  const KEY = "rid-daq session";
  const given = /** @type {HTMLElement} */ (document.currentScript).dataset.key;
  if (given) localStorage.setItem(KEY, given);
  const secret = localStorage.getItem(KEY) ?? "none";
  const bearer = `Bearer ${secret}`;

  // ---- add the session secret to requests and WebSockets of this page, and a ticket to links that the user opens or
  // saves
  const plainFetch = window.fetch;
  window.fetch = (target, options = {}) => {
    if (new URL(target instanceof Request ? target.url : target, location.href).origin !== location.origin) return plainFetch(target, options);
    const headers = new Headers(options.headers);
    headers.set("authorization", bearer);
    return plainFetch(target, { ...options, headers });
  };

  const PlainSocket = window.WebSocket;
  window.WebSocket = class extends PlainSocket {
    /** @param {string | URL} target @param {string | string[]} [protocols] */
    constructor(target, protocols) {
      const address = new URL(target, location.href);
      const ours = address.host === location.host && /^\/api\/v1\/(ws|stop-line)$/.test(address.pathname);
      super(target, ours ? ["rid-daq", `rid-daq.${secret}`] : protocols);
    }
  };

  const NOT_PAGES = /^\/(api|figures|metrics)(\/|$)/;
  /** @type {Element | null} */
  let passed = null;
  /** @type {(event: MouseEvent) => Promise<void>} */
  async function showTicket(event) {
    const link = /** @type {HTMLAnchorElement | null | undefined} */ (/** @type {Element} */ (event.target).closest?.("a[href]"));
    if (!link || link === passed || link.origin !== location.origin || !NOT_PAGES.test(link.pathname)) return;
    event.preventDefault();
    const copy = /** @type {HTMLAnchorElement} */ (link.cloneNode(false));
    try {
      const headers = { "x-rid-daq": "page", "content-type": "application/json" };
      const body = JSON.stringify({ path: decodeURIComponent(link.pathname) });
      const signal = AbortSignal.timeout(5000);
      const answer = await fetch("/api/v1/tickets", { method: "POST", headers, body, signal });
      if (!answer.ok) throw new Error(answer.statusText);
      const address = new URL(link.href);
      address.searchParams.set("ticket", (await answer.json()).ticket);
      copy.href = address.href;
    } catch {
      // no ticket was received: the link is opened without one, and the service answers why it refuses
    }
    copy.hidden = true;
    document.body.append(copy);
    passed = copy;
    copy.dispatchEvent(new MouseEvent("click", event));
    copy.remove();
  }

  // ---- load the page of this address; until it is loaded, this login page with its STOP button remains
  const PATIENCE_MS = 10000;
  const AGAIN_MS = 1000;
  // this open child document delays the load event of this page until the new page is written
  const pending = document.createElement("iframe");
  pending.hidden = true;
  document.body.append(pending);
  pending.contentDocument?.open();

  async function load() {
    let text;
    try {
      const answer = await fetch(given ? "/" : location.href, { signal: AbortSignal.timeout(PATIENCE_MS) });
      text = await answer.text();
      if (new URL(answer.url).pathname !== location.pathname || given) history.replaceState(null, "", answer.url);
    } catch {
      /** @type {HTMLElement} */ (document.getElementById("login-words")).textContent = "The service does not answer: use the emergency stop. This page tries again…";
      setTimeout(load, AGAIN_MS);
      return;
    }
    document.open(); // removes all listeners
    document.addEventListener("click", showTicket);
    document.write(text);
    document.close();
  }
  load();
})();
