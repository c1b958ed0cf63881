// Show data of the server as plain text only, never as HTML.
"use strict";
const OLD_MS = 500, HISTORY_MS = 60000;
/** @type {(id: string) => HTMLElement} */
const byId = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
const eventsAddress = /** @type {HTMLElement} */ (document.currentScript).dataset.events ?? "";
/** @type {JointCard[]} */
const cards = [];
/** @type {LivePicture | null} */
let shown = null;
let heardAt = 0, unknown = false;

/** @type {(element: Element, text: string) => void} */
function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
/** @type {(value: number | null, digits: number) => string} */
function number(value, digits) {
  return value === null ? "–" : value.toFixed(digits).replace("-", "\u2212");
}
/** @type {(share: number | null) => string} */
function percent(share) {
  return share === null ? "–" : `${Math.round(100 * share)} %`;
}
/** @type {(seconds: number) => string} */
function duration(seconds) {
  const whole = Math.max(0, Math.ceil(seconds)), rest = whole % 60;
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${String(rest).padStart(2, "0")} s`;
  return `${Math.floor(whole / 3600)} h ${String(Math.floor(whole / 60) % 60).padStart(2, "0")} min`;
}
/** @type {(element: Element, share: number | null) => void} */
function heat(element, share) {
  element.classList.toggle("warm", share !== null && share >= 0.7 && share < 0.9);
  element.classList.toggle("hot", share !== null && share >= 0.9);
}

/** @type {(joints: LiveJoint[]) => void} */
function makeCards(joints) {
  byId("joints").replaceChildren();
  cards.length = 0;
  document.body.classList.toggle("many", joints.length > 4);
  for (const joint of joints) {
    const made = /** @type {DocumentFragment} */ (/** @type {HTMLTemplateElement} */ (byId("joint")).content.cloneNode(true));
    const article = /** @type {HTMLElement} */ (made.firstElementChild);
    /** @type {(name: string) => HTMLElement} */
    const part = (name) => /** @type {HTMLElement} */ (article.querySelector(`[data-${name}]`));
    const card = /** @type {JointCard} */ (/** @type {object} */ ({ article, points: [] }));
    for (const name of /** @type {const} */ (["name", "temperature", "torque", "torque-bar", "torque-soft", "error", "error-bar",
      "error-soft", "position", "position-mark", "low", "high", "velocity", "velocity-mark", "slow", "fast",
      "canvas"])) card[name] = part(name);
    setText(card.name, joint.name);
    setText(card.low, number(joint.position_min, 2));
    setText(card.high, number(joint.position_max, 2));
    setText(card.slow, number(-joint.velocity_limit, 2));
    setText(card.fast, number(joint.velocity_limit, 2));
    byId("joints").append(article);
    cards.push(card);
  }
}

/** @type {(element: HTMLElement, share: number | null) => void} */
function bar(element, share) {
  element.style.width = `${100 * Math.min(1, share || 0)}%`;
  heat(element, share);
}
/** @type {(element: HTMLElement, share: number | null) => void} */
function mark(element, share) {
  element.hidden = share === null;
  if (share !== null) element.style.left = `calc(${Math.min(1, Math.max(0, share))} * (100% - .7rem))`;
}

/** @type {(card: JointCard, joint: LiveJoint, moving: boolean) => void} */
function showJoint(card, joint, moving) {
  setText(card.temperature, joint.temperature_c === null ? "" : `${number(joint.temperature_c, 1)} °C`);
  setText(card.torque, percent(joint.torque_share));
  heat(card.torque, joint.torque_share);
  bar(card["torque-bar"], joint.torque_share);
  setText(card["torque-soft"],
    `${number(joint.torque, 1)} of ${number(joint.torque_limit, 0)} ${joint.torque_unit}`);
  setText(card.error, percent(joint.following_error_share));
  heat(card.error, joint.following_error_share);
  bar(card["error-bar"], joint.following_error_share);
  const error = joint.following_error;
  setText(card["error-soft"], `${number(error === null ? null : 1000 * error, 1)} m${joint.unit}`);
  setText(card.position, `${number(joint.position, 3)} ${joint.unit}`);
  const span = joint.position_max - joint.position_min;
  mark(card["position-mark"], joint.position === null ? null : (joint.position - joint.position_min) / span);
  setText(card.velocity, `${number(joint.velocity, 2)} ${joint.unit}/s`);
  const speed = joint.velocity === null ? null : joint.velocity / joint.velocity_limit;
  mark(card["velocity-mark"], speed === null ? null : 0.5 + 0.5 * speed);
  heat(card["velocity-mark"], speed === null ? null : Math.abs(speed));
  heat(card.velocity, speed === null ? null : Math.abs(speed));
  card.article.classList.toggle("silent", joint.answers === false && moving);
  if (joint.torque_share !== null && moving) {
    card.points.push([performance.now(), joint.torque_share, joint.following_error_share]);
  }
}

/** @type {(card: JointCard, canvas: HTMLCanvasElement) => void} */
function draw(card, canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
  const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d")), style = getComputedStyle(document.documentElement);
  const now = performance.now();
  pen.clearRect(0, 0, width, height);
  pen.lineWidth = 1.5 * ratio;
  for (const [index, colour] of /** @type {[2 | 1, string][]} */ ([[2, "--second-line"], [1, "--calm-line"]])) {
    pen.strokeStyle = style.getPropertyValue(colour);
    pen.beginPath();
    for (const point of card.points) {
      const x = width * (1 - (now - point[0]) / HISTORY_MS);
      pen.lineTo(x, height * (1 - 0.94 * Math.min(1, point[index] ?? 0)) - ratio);
    }
    pen.stroke();
  }
}

/** @type {(picture: LivePicture) => void} */
function show(picture) {
  const first = shown === null || shown.joints.map((j) => j.name).join() !== picture.joints.map((j) => j.name).join();
  shown = picture;
  if (first) makeCards(picture.joints);
  setText(byId("title"), `${picture.cell}: ${picture.title}`);
  setText(byId("words"), picture.words);
  const share = picture.share;
  byId("done").style.width = `${100 * (share || 0)}%`;
  byId("way").setAttribute("aria-valuenow", String(Math.round(100 * (share || 0))));
  setText(byId("count"), `${share === null ? "" : `${Math.floor(100 * share)} %, `}${picture.count}`);
  setText(byId("left"), picture.left_s === null || picture.over || picture.stop !== null ? "" : `${duration(picture.left_s)} left`);
  picture.joints.forEach((joint, i) => showJoint(cards[i], joint, picture.moving));
  const lines = [...picture.notes];
  if (picture.recorder.startsWith("failed")) lines.unshift(`Recorder ${picture.recorder}`);
  const messages = byId("messages");
  if (messages.dataset.lines !== JSON.stringify(lines)) {
    messages.dataset.lines = JSON.stringify(lines);
    messages.replaceChildren(...lines.map((line) => {
      const paragraph = document.createElement("p");
      paragraph.textContent = line;
      return paragraph;
    }));
  }
  document.title = `${share === null ? "" : `${Math.floor(100 * share)} % `}${picture.words} – ${picture.cell}`;
}

/** @type {(text: string) => string} */
function stopWords(text) {
  return /^stopped /.test(text) ? `S${text.slice(1)}` : `Stopped: ${text}`;
}

/** @type {(kind: string, text: string) => void} */
function banner(kind, text) {
  const element = byId("banner");
  element.hidden = text === "";
  element.className = kind;
  setText(element, text);
}

function look() {
  const age = performance.now() - heardAt;
  const silent = shown === null || age > OLD_MS || (shown.moving && shown.age_s !== null && 1000 * shown.age_s > OLD_MS);
  const ended = shown !== null && shown.over;
  document.body.classList.toggle("old", silent && !ended);
  /** @type {HTMLButtonElement} */ (byId("stop")).disabled = ended && silent;
  const unsure = shown !== null && shown.over && !shown.drives_off ? " It is not confirmed that the drives are off." : "";
  const rest = shown && shown.at_rest_s !== null ? ` All axes at rest ${shown.at_rest_s.toFixed(2)} s later.` : "";
  if (unknown) banner("bad", "Access refused: open the complete address that the terminal shows.");
  else if (shown && shown.stop !== null) banner("bad", `${stopWords(shown.stop)}.${rest}${unsure}`);
  else if (shown && shown.problem !== null) banner("bad", `${shown.problem}${unsure ? `.${unsure}` : ""}`);
  else if (unsure) banner("bad", `The motion has ended.${unsure}`);
  else if (ended) banner("good", "The motion has ended; the drives are off.");
  else if (silent && shown !== null) banner("bad", "NOT LIVE: the values on this page are old.");
  else if (shown && shown.stop_asked) banner("wait", "Stop requested.");
  else banner("", "");
}

function paint() {
  const oldest = performance.now() - HISTORY_MS;
  for (const card of cards) {
    while (card.points.length && card.points[0][0] < oldest) card.points.shift();
    if (card.points.length) draw(card, /** @type {HTMLCanvasElement} */ (card.canvas));
  }
}

const events = new EventSource(eventsAddress);
events.onmessage = (event) => {
  heardAt = performance.now();
  unknown = false;
  /** @type {LivePicture} */
  const picture = JSON.parse(event.data);
  show(picture);
  look();
  // stop.js repeats a stop request until the server answers; this event may arrive before the answer
  if (picture.stop_asked) document.dispatchEvent(new CustomEvent("stop-answered", { detail: { sentence: "Stop requested." } }));
};
events.onerror = () => { unknown = events.readyState === EventSource.CLOSED && shown === null; look(); };
setInterval(look, 200);
setInterval(paint, 250);
