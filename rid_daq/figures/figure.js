// Shows figures of rid-daq in a page that has loaded BokehJS. It evaluates no code.

const dark = matchMedia("(prefers-color-scheme: dark)");
const touch = matchMedia("(pointer: coarse)");

/**
 * Show a figure, and redraw it when the page switches between light and dark colours.
 *
 * `from` is either a URL or an object. The URL returns the figure's item (JSON); the parameter
 * `dark=true` selects dark colours, and `as=csv` returns the data. The object has a method
 * `item(dark)`, which returns a promise of the item, and an optional `csv`, the URL of the data.
 * `element.dataset.figureState` is "loading", "shown" or "failed". Returns a function that removes
 * the figure from the page.
 */
export function showFigure(element, from) {
  const source = typeof from === "string" ? serverSource(from) : from;
  const words = document.createElement("p");
  words.setAttribute("role", "status");
  words.hidden = true;
  const place = document.createElement("div");
  const setState = (state, text = "") => {
    element.dataset.figureState = state;
    words.textContent = text;
    words.hidden = !text;
  };
  let number = 0;
  let shown = null;
  const show = async () => {
    const mine = ++number;
    setState("loading", shown ? "" : "Loading the figure …");
    try {
      const item = await source.item(dark.matches);
      if (mine !== number) return;
      shown?.clear();
      place.replaceChildren();
      shown = await embed(item, place);
      if (mine === number) setState("shown");
    } catch (error) {
      if (mine === number) setState("failed", `The figure cannot be shown: ${error.message}`);
    }
  };
  const save = () => {
    try {
      saveSvg(shown, place);
    } catch (error) {
      setState("shown", `The SVG file cannot be made: ${error.message}`);
    }
  };
  element.replaceChildren(buttons(source.csv, save), words, place);
  dark.addEventListener("change", show);
  show();
  return () => {
    number += 1;
    dark.removeEventListener("change", show);
    shown?.clear();
    element.replaceChildren();
  };
}

function serverSource(url) {
  return {
    csv: withParameters(url, { as: "csv" }),
    item: (isDark) => fetchJson(withParameters(url, { dark: isDark })),
  };
}

async function fetchJson(url) {
  let answer;
  try {
    answer = await fetch(url, { cache: "no-store" });
  } catch {
    throw new Error("the server does not answer. Check that the service runs, then reload the page.");
  }
  if (!answer.ok) throw new Error(await reason(answer));
  return answer.json();
}

async function reason(answer) {
  const text = (await answer.text()).slice(0, 500);
  let message = text;
  try {
    const parsed = JSON.parse(text);
    message = parsed.message ?? parsed.detail ?? text;
  } catch {
    // The response is not JSON: show its text.
  }
  return typeof message === "string" && message ? message : `the server answered ${answer.status}.`;
}

function withParameters(url, values) {
  const whole = new URL(url, location.href);
  for (const [key, value] of Object.entries(values)) whole.searchParams.set(key, value);
  return whole;
}

async function embed(item, place) {
  if (!globalThis.Bokeh) throw new Error("bokeh.min.js was not loaded. Reload the page.");
  if (touch.matches) disableDrag(item);
  const views = await globalThis.Bokeh.embed.embed_item(item, place);
  const drawn = views.roots[0].model.document;
  if (!drawn.is_idle) await new Promise((done) => drawn.idle.connect(done));
  return views;
}

/** Return the background colour that is visible behind an element. */
function background(element) {
  const color = getComputedStyle(element).backgroundColor;
  if (color !== "rgba(0, 0, 0, 0)" || !element.parentElement) return color;
  return background(element.parentElement);
}

/** Disable drag tools on touch screens, so that a finger scrolls the page; the toolbar enables them. */
function disableDrag(value) {
  if (value === null || typeof value !== "object") return;
  if (value.name === "Toolbar" && value.attributes) value.attributes.active_drag = null;
  Object.values(value).forEach(disableDrag);
}

function buttons(table, save) {
  const bar = document.createElement("div");
  bar.className = "figure-buttons";
  if (table) {
    const csv = document.createElement("a");
    csv.textContent = "CSV";
    csv.title = "Download the figure's data as a CSV table";
    csv.href = table;
    csv.download = "";
    bar.append(csv, " ");
  }
  const svg = document.createElement("button");
  svg.type = "button";
  svg.textContent = "SVG";
  svg.title = "Download the figure with its present zoom as SVG";
  svg.addEventListener("click", save);
  bar.append(svg);
  return bar;
}

function saveSvg(views, place) {
  if (!views) throw new Error("the figure is not shown yet.");
  const [view] = views.roots;
  const drawing = view.export("svg", false).canvas;
  drawing.style.backgroundColor = background(place);
  const text = new XMLSerializer().serializeToString(drawing);
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
  link.download = `${view.model.name}.svg`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
