// Frame of every page: state of the cell, lease, connection, STOP. It also enables elements with the attribute
// `data-needs`.
import "./awake.js";
import "./entries.js";
import "./now_next.js";
import { dialog } from "./dialog.js";
import { element, find, kindWords } from "./dom.js";
import { begin, go, lease, mayMove, now, on, page, reach, stay } from "./service.js";

const [words, take, over, back] = [find("lease-words"), find("lease-take"), find("lease-over"), find("lease-back")];
const banner = find("reach");
let stays = false;
let problem = "";
/** @type {Record<string, string>} */
const MOTION = { moving: "The motion", "at rest": "The job", waiting: "The job" }; // by state of the cell
const LOST = { stop: "stops", finish: "continues" };

// ---- requirements of elements, in the attribute data-needs
// "lease": this page holds the cell, and no job uses the cell.
// "ready": in addition to "lease", the cell may move.
// "held": in addition to "lease", the cell may move while a key is held.
// "role": the user has more than read-only access.
// An element with data-why="lease" or "ready" shows which requirement is not met.
/** @type {(need: string | undefined) => string} */
export function missing(need) {
  const status = now.status;
  if (!status) return "The service does not answer yet.";
  if (!mayMove) return "This device has read-only access. An administrator can revoke it in Settings and admit it as operator.";
  if (need === "role") return "";
  if (!lease.key) return status.lease ? `${status.lease.owner} holds the cell.` : "Take the cell first.";
  if (status.job) return `${kindWords(status.job.kind)} is running: wait for its end, or stop it.`;
  if (need === "ready" && status.not_ready_because) return `Not ready: ${status.not_ready_because}`;
  if (need === "held" && status.not_held_because) return `Not ready: ${status.not_held_because}`;
  return "";
}

function showNeeds() {
  for (const part of /** @type {NodeListOf<HTMLButtonElement>} */ (document.querySelectorAll("[data-needs]"))) {
    part.disabled = missing(part.dataset.needs) !== "";
  }
  for (const part of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-why]"))) {
    const why = missing(part.dataset.why);
    // do not set an equal text again: every change of a text calls this function
    if (part.textContent !== why) part.textContent = why;
  }
}

/** @type {(status: Api.CellStatus) => void} */
function showCell(status) {
  const state = find("state");
  const known = reach.values || reach.requests;
  const shown = known ? status.state.replace("closed", "not ready") : "unknown";
  if (state.textContent !== shown || state.dataset.state !== status.state) {
    state.dataset.state = known ? status.state : "unknown";
    state.textContent = shown;
  }
  const mine = lease.key !== null;
  const owner = status.lease;
  let text = "No one holds this cell.";
  const another = owner?.owner === page.who ? "Another page that is open on this device" : owner?.owner;
  if (owner) text = `${mine ? "You hold" : `${another} holds`} this cell${owner.note ? ` (${owner.note})` : ""}.`;
  if (!mine && lease.lost) text = `You no longer hold this cell. ${text}`;
  const motion = MOTION[status.state];
  if (mine && status.job && motion)
    text = `You hold this cell. ${motion} ${LOST[status.job.on_lost_client]} if this page closes, the device sleeps or the connection is lost.`;
  words.textContent = problem || (lease.known ? text : "…");
  words.classList.toggle("problem", problem !== "");
  take.hidden = !mayMove || !lease.known || mine || owner !== null;
  over.hidden = !mayMove || !lease.known || mine || owner === null;
  back.hidden = !mine;
  showNeeds();
}

/** @type {(action: () => Promise<void>) => Promise<void>} */
async function attempt(action) {
  problem = "";
  try {
    await action();
  } catch (error) {
    problem = error.message;
  }
  if (now.status) showCell(now.status);
}

/** @type {(label: string, id: string, attributes?: Attributes) => [HTMLLabelElement, HTMLInputElement]} */
const field = (label, id, attributes = {}) => {
  const input = element("input", { id, type: "text", autocomplete: "off", ...attributes });
  return [element("label", { for: id }, label), input];
};

take.addEventListener("click", async () => {
  const [label, input] = field("Purpose (optional; others can read it)", "note", { maxlength: "80" });
  const read = () => ({ note: input.value.trim() });
  const wanted = await dialog(`Take cell ${page.cell}`, [label, input], "Take the cell", { read });
  if (wanted) await attempt(() => lease.take(wanted.note));
});

over.addEventListener("click", async () => {
  const owner = now.status?.lease?.owner ?? "another client";
  const moving = now.status?.job ? element("p", { class: "problem" }, `${kindWords(now.status.job.kind)} is running.`) : null;
  const [label, input] = field(`To take it over, type the cell's name: ${page.cell}`, "name", { autocapitalize: "off" });
  const [noteLabel, note] = field("Purpose (optional; others can read it)", "note", { maxlength: "80" });
  const read = () => {
    if (input.value.trim() !== page.cell) throw new Error(`Type ${page.cell}.`);
    return { note: note.value.trim() };
  };
  const text = element("p", {}, `${owner} holds the cell. Talk to ${owner} first: if you take it over, ${owner} can no longer move the cell.`);
  const content = [text, moving, label, input, noteLabel, note].filter((each) => each !== null);
  const wanted = await dialog(`Take cell ${page.cell} over`, content, "Take over", { danger: true, read });
  if (wanted) await attempt(() => lease.take(wanted.note, page.cell));
});

back.addEventListener("click", () => attempt(() => lease.giveBack()));

find("cell-choice")?.addEventListener("change", () => {
  const [, , , ...rest] = location.pathname.split("/");
  go(["/cells", encodeURIComponent(find("cell-choice").value), ...rest.slice(0, 1)].join("/"));
});

document.querySelector("nav [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });

// Follow a link to our own pages only if the service answers; otherwise this page with its STOP remains. A link that opens
// another tab or saves a file is not followed later either: it would replace this page.
document.addEventListener("click", (event) => {
  const link = /** @type {HTMLAnchorElement | null | undefined} */ (/** @type {Element} */ (event.target).closest?.("a[href]"));
  if (!link || event.defaultPrevented || event.button !== 0 || event.ctrlKey || event.metaKey || event.shiftKey || event.altKey) return;
  const within = link.pathname === location.pathname && link.search === location.search && link.hash;
  const isApart = Boolean(link.target) || link.hasAttribute("download");
  if (link.origin !== location.origin || within || (isApart && reach.requests)) return;
  event.preventDefault();
  if (isApart) stay();
  else go(link.href);
});

function showReach() {
  const { values, requests } = reach;
  if (values && requests) stays = false;
  let text = "";
  if (!values && !requests) text = "The service does not answer: use the emergency stop. The values on this page are old. The page tries again.";
  else if (!values) text = "NOT LIVE: no values arrive from the service, so the values on this page may be old. The page tries again.";
  else if (!requests) text = "The service does not answer requests: buttons and links do not work now, except STOP. Values still arrive. The page tries again.";
  if (stays) text += " This page stays open, because the next page would not load.";
  banner.hidden = text === "";
  banner.textContent = text;
  document.body.classList.toggle("unreached", !values && !requests);
  if (now.status) showCell(now.status);
}

// After a restart, the service may be a newer version, whose pages differ: reload as soon as the cell has no job.
let isOutdated = false;
async function checkVersion() {
  const answer = await fetch(`${import.meta.url}?is-current`, { cache: "no-store" }).catch(() => null);
  if (answer?.status === 404) isOutdated = true;
  reloadAtRest();
}

function reloadAtRest() {
  if (!isOutdated || !now.status || now.status.job) return;
  isOutdated = false; // a second call would abort the reload that the first has begun
  location.reload();
}

on("again", checkVersion);
on("cell", reloadAtRest);
on("cell", showCell);
on("reach", showReach);
on("stay", () => {
  stays = true;
  showReach();
});

new MutationObserver(showNeeds).observe(find("main"), { childList: true, subtree: true });
// buttons are enabled only after the page's own module has loaded, so that every enabled button works
document.addEventListener("DOMContentLoaded", begin);
