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
      const ours = address.host === location.host && address.pathname === "/api/v1/ws";
      super(target, ...(ours ? [["rid-daq", `rid-daq.${secret}`]] : more));
    }
  };

  const NOT_PAGES = /^\/(api|figures|metrics)(\/|$)/;
  let passed = null;
  document.addEventListener("click", async (event) => {
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
  });

  // ---- the page of this address takes this one's place
  const request = new XMLHttpRequest();
  request.open("GET", given ? "/" : location.href, false);
  request.setRequestHeader("authorization", bearer);
  try {
    request.send();
    if (new URL(request.responseURL).pathname !== location.pathname || given)
      history.replaceState(null, "", request.responseURL);
    document.write(request.responseText);
  } catch {
    document.write("<p>The service does not answer. To stop: rid-daq stop in a terminal, or the emergency stop.</p>");
  }
})();
