// What every page has: state, lease, reach, STOP; and `data-needs` on whatever needs more than a look.
import "./awake.js";
import { dialog } from "./dialog.js";
import { element, find } from "./dom.js";
import { begin, lease, mayMove, now, on, page } from "./service.js";
import { watchStop } from "./stop.js";

const [words, take, over, back] = ["lease-words", "lease-take", "lease-over", "lease-back"].map(find);
const reach = find("reach");
let problem = "";
const LOST = {
  stop: "If this page is closed, or its device sleeps or goes out of reach, the motion is stopped.",
  finish: "If this page is closed, or its device sleeps or goes out of reach, the motion goes on to its end.",
};

watchStop();

// ---- what needs something: data-needs="lease" (the cell is ours and no job has it) or "ready" (the
// same, and it may move), or "held" (the same, and it may move while a key is held), or "role" (we may do more than look). Elements with data-why="lease" or "ready" say what is missing.
export function missing(need) {
  const status = now.status;
  if (!status) return "The service does not answer yet.";
  if (!mayMove) return "This device may only look on. An administrator gives it the role operator.";
  if (need === "role") return "";
  if (!lease.key) return status.lease ? `${status.lease.owner} has the cell.` : "Take the cell first.";
  if (status.job) return `${status.job.kind} is under way: wait for its end, or stop it.`;
  if (need === "ready" && status.not_ready_because) return `Not ready: ${status.not_ready_because}`;
  if (need === "held" && status.not_held_because) return `Not ready: ${status.not_held_because}`;
  return "";
}

function showNeeds() {
  for (const part of document.querySelectorAll("[data-needs]")) {
    part.disabled = missing(part.dataset.needs) !== "";
  }
  for (const part of document.querySelectorAll("[data-why]")) {
    const why = missing(part.dataset.why);
    if (part.textContent !== why) part.textContent = why; // a change here brings us here again
  }
}

function showCell(status) {
  const state = find("state");
  if (state.dataset.state !== status.state) {
    state.dataset.state = status.state;
    state.textContent = status.state;
  }
  const mine = lease.key !== null;
  const owner = status.lease;
  let text = "Nobody has this cell.";
  if (owner) text = `${mine ? "You have" : `${owner.owner} has`} this cell${owner.note ? ` (${owner.note})` : ""}.`;
  if (!mine && lease.lost) text = `You do not have this cell any more. ${text}`;
  if (mine && status.job && status.state === "moving") text += ` ${LOST[status.job.on_lost_client]}`;
  words.textContent = problem || text;
  words.classList.toggle("problem", problem !== "");
  take.hidden = !mayMove || mine || owner !== null;
  over.hidden = !mayMove || mine || owner === null;
  back.hidden = !mine;
  showNeeds();
}

async function attempt(action) {
  problem = "";
  try {
    await action();
  } catch (error) {
    problem = error.message;
  }
  if (now.status) showCell(now.status);
}

const field = (label, id, attributes = {}) => {
  const input = element("input", { id, type: "text", autocomplete: "off", ...attributes });
  return [element("label", { for: id }, label), input];
};

take.addEventListener("click", async () => {
  const [label, input] = field("What for? Others see it.", "note", { maxlength: "80" });
  const read = () => ({ note: input.value.trim() });
  const wanted = await dialog(`Take cell ${page.cell}`, [label, input], "Take the cell", { read });
  if (wanted) await attempt(() => lease.take(wanted.note));
});

over.addEventListener("click", async () => {
  const owner = now.status?.lease?.owner ?? "somebody";
  const moving = now.status?.job ? element("p", { class: "problem" }, `${now.status.job.kind} is under way.`) : null;
  const [label, input] = field(`To take it over, type the cell's name: ${page.cell}`, "name", { autocapitalize: "off" });
  const [noteLabel, note] = field("What for? Others see it.", "note", { maxlength: "80" });
  const read = () => {
    if (input.value.trim() !== page.cell) throw new Error(`Type ${page.cell}.`);
    return { note: note.value.trim() };
  };
  const text = element("p", {}, `${owner} has the cell. Talk to them first: they cannot move it afterwards.`);
  const content = [text, moving, label, input, noteLabel, note].filter(Boolean);
  const wanted = await dialog(`Take cell ${page.cell} over`, content, "Take over", { danger: true, read });
  if (wanted) await attempt(() => lease.take(wanted.note, page.cell));
});

back.addEventListener("click", () => attempt(() => lease.giveBack()));

find("cell-choice")?.addEventListener("change", (event) => {
  const [, , , ...rest] = location.pathname.split("/");
  location.assign(["/cells", encodeURIComponent(event.target.value), ...rest.slice(0, 1)].join("/"));
});

document.querySelector("nav [aria-current]")?.scrollIntoView({ block: "nearest", inline: "center" });

on("cell", showCell);
on("reach", (reached) => {
  reach.hidden = reached;
  reach.textContent = reached
    ? ""
    : "The service does not answer: use the emergency stop. This page shows what was, and tries again.";
  document.body.classList.toggle("unreached", !reached);
});

new MutationObserver(showNeeds).observe(find("main"), { childList: true, subtree: true });
// only once the page's own module is there: a button that can be pressed does something
document.addEventListener("DOMContentLoaded", begin);
