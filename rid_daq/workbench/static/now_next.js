// Line "now and next" of the sticky header: the running job with its progress and time left, the question that waits for
// an answer, or the next step. The panel of a job gives its state; on pages without a panel, the service gives it.
import { duration, find, kindWords } from "./dom.js";
import { html, nothing, render } from "./lit.js";
import { CELL, lease, mayMove, now, on } from "./service.js";

const line = find("now-next");
const check = document.getElementById("check");
/** @type {NowNext | null} */
let shown = null; // the newest state of the page's panel
/** @type {LivePicture | null} */
let picture = null;

/** @type {(state: NowNext | null) => void} */
export function showNowNext(state) {
  shown = state;
  draw();
}

function draw() {
  const parts = stateParts();
  line.hidden = parts === nothing;
  render(parts, line);
}

/** @type {() => unknown} */
function stateParts() {
  const status = now.status;
  const job = status?.job;
  if (shown?.isRunning) return runningParts(shown);
  if (status && job) return runningParts(runningJob(job));
  if (shown) return html`<p class=${shown.kind}>${shown.words}</p>${shown.steps}`;
  if (!lease.key || !mayMove || !status?.not_ready_because) return nothing;
  const isFault = status.state === "fault" || !check;
  const step = isFault ? html`<a class="button main" href=${CELL}>Open the cell</a>` : html`<button type="button" class="main" @click=${() => check?.click()}>Check</button>`;
  return html`<p>Not ready: ${status.not_ready_because}</p>${step}`;
}

// Return the state of a job that no panel of this page shows; the button leads to a page that shows it.
/** @type {(job: Api.Job) => NowNext} */
function runningJob({ kind }) {
  const path = kind === "payload_session" ? "/payload" : "";
  const left = picture?.left_s == null ? "" : `${duration(picture.left_s)} left`;
  const step = html`<a class="button" href="${CELL}${path}">Show</a>`;
  return { isRunning: true, words: kindWords(kind), count: picture?.words ?? "", left, share: picture?.share ?? null, steps: [step] };
}

/** @type {(state: NowNext) => unknown} */
const runningParts = ({ words, count = "", left = "", share, steps }) => html`
  <p class="number"><b>${words}</b> ${count}</p><p class="left number">${left}</p>${steps}
  <progress max="1" aria-label="progress of the job" value=${share ?? nothing}></progress>`;

on("cell", ({ job }) => {
  if (!job) picture = null;
  draw();
});
on("samples", (newest) => {
  picture = newest;
  if (!shown?.isRunning) draw();
});

// The sticky header covers the top of the page, so scrolling to a section must end below the header. On a small screen
// only the header's last rows stay visible: the state of the cell and this line.
const header = /** @type {HTMLElement} */ (line.closest("header"));
new ResizeObserver(() => {
  const above = find("bar").offsetTop;
  header.style.setProperty("--above", `${-above}px`);
  const isSmall = getComputedStyle(header).top !== "0px";
  document.documentElement.style.scrollPaddingTop = `${header.offsetHeight - (isSmall ? above : 0) + 16}px`;
}).observe(header);
