// Page of the live signals: time plots with pause and zoom, and a table with the values at the cursor.
// Between motions, the job "watch" reads the values of the drives while the robot is at rest.
import { clockOf, duration, element, find, kindWords } from "./dom.js";
import { JobPanel } from "./job_panel.js";
import { html, render } from "./lit.js";
import { OLD_MS, now, on, reach, requestSignals } from "./service.js";
import { chartsOf, lineOf, SignalPlots } from "./signal_plots.js";
import { SignalStore } from "./signal_store.js";

const FIRST_SPAN_S = 30;
const LEAST_SPAN_S = 0.5;
const MOST_SPAN_S = 600;
const OLD_S = 0.5; // live values that are older than this at the service count as old
const DRAW_MS = 100; // time between two redraws
const WATCH_MS = 250;
const NEAR_S = 0.2; // maximum distance between the cursor and the bin whose values are shown

const section = find("signals");
/** @type {SignalJoint[]} */
const joints = JSON.parse(section.dataset.joints ?? "[]");
const charts = chartsOf(joints, section.dataset.monitor === "yes");
const panel = new JobPanel(find("job"));
const store = new SignalStore();
const plots = new SignalPlots(find("charts"), charts, joints, { zoomed: freezeAt, pointed });

let span = FIRST_SPAN_S; // duration of the visible time [s]
/** @type {number | null} */
let end = null; // end of the visible time [s] if the plots are paused; null: the plots follow the newest values
/** @type {number | null} */
let cursor = null; // time at the cursor [s]; null: the newest values
let liveAt = -Infinity; // time at which the newest live values arrived
/** @type {{ seconds: number, at: number | null } | null} */
let lost = null; // { seconds, at }: duration of the values that did not arrive on this page, and the time of the loss
let isDue = true; // true if the picture must be drawn again

find("watch").addEventListener("click", () => panel.begin("watch"));

// ---- visible time
const rightEnd = () => end ?? store.newestTime ?? Date.now() / 1000;

/** @type {(from: number, to: number) => void} */
function freezeAt(from, to) {
  span = Math.min(MOST_SPAN_S, Math.max(LEAST_SPAN_S, to - from));
  end = (from + to + span) / 2;
  showSoon();
}

/** @type {(factor: number) => void} */
function zoom(factor) {
  const centre = rightEnd() - span / 2;
  span = Math.min(MOST_SPAN_S, Math.max(LEAST_SPAN_S, span * factor));
  if (end !== null) end = centre + span / 2;
  showSoon();
}

/** @type {(share: number) => void} */
function move(share) {
  end = rightEnd() + share * span;
  showSoon();
}

/** @type {Record<string, () => unknown>} */
const actions = {
  pause: () => (end = end === null ? rightEnd() : null),
  "zoom-in": () => zoom(0.5),
  "zoom-out": () => zoom(2),
  earlier: () => move(-0.5),
  later: () => move(0.5),
  reset: () => ([span, cursor] = [FIRST_SPAN_S, null]),
};
for (const [id, action] of Object.entries(actions))
  document.getElementById(id)?.addEventListener("click", () => {
    action();
    if (id === "reset") plots.point(null);
    showSoon();
  });

// ---- cursor
/** @type {(time: number | null) => void} */
function pointed(time) {
  cursor = time;
  showSoon();
}

find("cursor").addEventListener("input", () => {
  if (end === null) end = rightEnd(); // the plots must not move while the user points at them
  plots.point(end - span + span * Number(find("cursor").value));
});

// ---- joints
const toggles = joints.map(({ name }, i) => {
  const { colour, dash } = lineOf(i);
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const line = document.createElementNS("http://www.w3.org/2000/svg", "line");
  const drawn = { x1: "0", x2: "100%", y1: "50%", y2: "50%", "stroke-width": "4", "stroke-dasharray": dash.join(" ") };
  for (const [key, value] of Object.entries(drawn)) line.setAttribute(key, value);
  line.style.stroke = `var(${colour})`;
  svg.setAttribute("aria-hidden", "true");
  svg.append(line);
  const button = element("button", { type: "button", class: "joint-line", "aria-pressed": "true" }, svg, name);
  button.addEventListener("click", () => {
    const isShown = plots.hidden.delete(i) || !plots.hidden.add(i);
    button.setAttribute("aria-pressed", String(isShown));
    showSoon();
  });
  return button;
});
section.signals = { store, plots };
find("lines").append(...toggles);

// ---- picture
function showSoon() {
  isDue = true;
}

function draw() {
  if (!isDue || document.visibilityState === "hidden") return;
  isDue = false;
  const right = rightEnd();
  plots.draw(store, right - span, right);
  find("pause").textContent = end === null ? "Pause" : "Continue";
  find("span").textContent = `${span < 90 ? `${Number(span.toPrecision(2))} s` : duration(span)} visible`;
  const shown = cursor === null ? null : (cursor - right + span) / span;
  const slider = find("cursor");
  if (document.activeElement !== slider || shown === null) slider.value = String(shown ?? 1);
  showValues();
}

function showValues() {
  const shownAt = cursor ?? store.newestTime;
  const place = shownAt === null ? null : store.placeAt(shownAt, cursor === null ? 0 : NEAR_S);
  const time = place === null ? NaN : store.times[place];
  const words = place === null ? (cursor === null ? "no values yet" : `no values at ${clockOf(cursor)}`) : clockOf(time);
  find("cursor").setAttribute("aria-valuetext", words);
  find("values-time").textContent = cursor === null && place !== null ? `Newest values, ${words}` : `Values at the cursor: ${words}`;
  /** @type {(chart: SignalChart, joint: number | null) => string} */
  const cell = (chart, joint) => {
    if (chart.joints !== null && !chart.joints.includes(joint ?? -1)) return "";
    if (place === null) return "–";
    const [low, high] = [chart.low, chart.high].map((lane) => chart.factor * store.value(lane, place, joint ?? 0));
    return Number.isNaN(low) ? "–" : between(low, high);
  };
  const ofJoints = charts.filter((chart) => chart.joints !== null);
  const bus = charts[charts.length - 1]; // chartsOf ends with it
  render(html`<table><thead><tr><th scope="col">Joint</th>${ofJoints.map((chart) => html`<th scope="col">${chart.title} [${chart.unit}]</th>`)}</tr></thead>
    <tbody>${joints.map(({ name }, i) => html`<tr><th scope="row">${name}</th>${ofJoints.map((chart) => html`<td>${cell(chart, i)}</td>`)}</tr>`)}</tbody></table>`, find("values"));
  find("bus").textContent = `${bus.title}: ${cell(bus, null)} ${bus.unit}.`;
}

// Return minimum and maximum as text, or a single number if both have the same digits.
/** @type {(low: number, high: number) => string} */
function between(low, high) {
  const digits = Math.max(0, Math.min(3, 3 - Math.floor(Math.log10(Math.max(Math.abs(low), Math.abs(high), 1e-3)))));
  const [from, to] = [low, high].map((value) => value.toFixed(digits).replace(/^-(0\.?0*)$/, "$1"));
  return from === to ? from : `${from} to ${to}`;
}

// ---- state: live, old or paused
function showState() {
  const newest = store.newestTime;
  const known = newest === null ? "" : ` Newest values: ${clockOf(newest)}.`;
  const isLive = reach.values && performance.now() - liveAt < OLD_MS;
  const job = now.status?.job;
  let text = `No values are measured now.${known || " They appear during a motion, or while you watch the drives at rest."}`;
  if (isLive) text = job?.kind === "watch" ? "LIVE: values of the drives at rest." : "LIVE: values of the present motion.";
  else if (!reach.values) text = `NOT LIVE: no values arrive from the service.${known}`;
  else if (job && ["moving", "stopping"].includes(now.status?.state ?? "")) text = `NOT LIVE: ${kindWords(job.kind)} is running, but there are no new values.${known}`;
  if (end !== null) text += ` PAUSED at ${clockOf(end)}: the plots are frozen; new values are kept.`;
  const oldest = store.oldestTime;
  if (end !== null && oldest !== null && end - span < oldest && store.newest >= 12000) text += ` Values before ${clockOf(oldest)} are no longer kept.`;
  const state = find("signal-state");
  if (state.textContent !== text) state.textContent = text;
  state.dataset.kind = section.dataset.kind = isLive ? "live" : "old";
  const problem = lost === null ? "" : `Values of ${lost.seconds.toFixed(1)} s did not reach this page by ${clockOf(lost.at ?? NaN)}: the connection or the device is too slow.`;
  if (find("lost").textContent !== problem) find("lost").textContent = problem;
}

on("signals", (buffer) => {
  const head = store.add(buffer);
  if (head.joints.join() !== joints.map(({ name }) => name).join()) {
    location.reload(); // the cell's files have changed
    return;
  }
  if (head.isNew && head.age_s <= OLD_S) liveAt = performance.now();
  if (head.lost) lost = { seconds: (lost?.seconds ?? 0) + head.lost * head.bin_s, at: store.newestTime };
  if (end === null || !head.isNew) showSoon();
});
on("reach", showState);
on("cell", showState);
requestSignals(() => store.known());
setInterval(showState, WATCH_MS);
setInterval(() => requestAnimationFrame(draw), DRAW_MS);
document.addEventListener("visibilitychange", showSoon);
