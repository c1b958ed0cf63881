// Shows figures of rid-daq in a page that has loaded BokehJS. No code is evaluated.

const dark = matchMedia("(prefers-color-scheme: dark)");
const touch = matchMedia("(pointer: coarse)");

/**
 * Show a figure, and show it anew when the page turns light or dark.
 *
 * `from` is an address that answers with the figure's item (JSON); with `dark=true` in its dark
 * colours; with `as=csv` with its data. Or it is an object whose `item(dark)` promises the item, and
 * whose `csv` is the address of its data, if there is one. `element.dataset.figureState` is
 * "loading", "shown" or "failed". Returns a function that takes the figure out of the page again.
 */
export function showFigure(element, from) {
  const source = typeof from === "string" ? ofServer(from) : from;
  const words = document.createElement("p");
  words.setAttribute("role", "status");
  words.hidden = true;
  const place = document.createElement("div");
  const tell = (state, text = "") => {
    element.dataset.figureState = state;
    words.textContent = text;
    words.hidden = !text;
  };
  let number = 0;
  let shown = null;
  const show = async () => {
    const mine = ++number;
    tell("loading", shown ? "" : "Loading the figure …");
    try {
      const item = await source.item(dark.matches);
      if (mine !== number) return;
      shown?.clear();
      place.replaceChildren();
      shown = await embedded(item, place);
      if (mine === number) tell("shown");
    } catch (error) {
      if (mine === number) tell("failed", `The figure cannot be shown: ${error.message}`);
    }
  };
  const save = () => {
    try {
      saveSvg(shown, place);
    } catch (error) {
      tell("shown", `No SVG was made: ${error.message}`);
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

function ofServer(url) {
  return {
    csv: asked(url, { as: "csv" }),
    item: (isDark) => fetched(asked(url, { dark: isDark })),
  };
}

async function fetched(url) {
  let answer;
  try {
    answer = await fetch(url, { cache: "no-store" });
  } catch {
    throw new Error("the server does not answer. Check that it runs, then reload the page.");
  }
  if (!answer.ok) throw new Error(await reason(answer));
  return answer.json();
}

async function reason(answer) {
  const text = (await answer.text()).slice(0, 500);
  let said = text;
  try {
    const told = JSON.parse(text);
    said = told.message ?? told.detail ?? text;
  } catch {
    // The answer is plain text.
  }
  return typeof said === "string" && said ? said : `the server answered ${answer.status}.`;
}

function asked(url, values) {
  const whole = new URL(url, location.href);
  for (const [key, value] of Object.entries(values)) whole.searchParams.set(key, value);
  return whole;
}

async function embedded(item, place) {
  if (!globalThis.Bokeh) throw new Error("bokeh.min.js was not loaded. Reload the page.");
  if (touch.matches) withoutDrag(item);
  const views = await globalThis.Bokeh.embed.embed_item(item, place);
  const drawn = views.roots[0].model.document;
  if (!drawn.is_idle) await new Promise((done) => drawn.idle.connect(done));
  return views;
}

/** Return the colour that an element stands on. */
function background(element) {
  const color = getComputedStyle(element).backgroundColor;
  if (color !== "rgba(0, 0, 0, 0)" || !element.parentElement) return color;
  return background(element.parentElement);
}

/** Let a finger scroll the page: what a drag does is chosen in the toolbar first. */
function withoutDrag(value) {
  if (value === null || typeof value !== "object") return;
  if (value.name === "Toolbar" && value.attributes) value.attributes.active_drag = null;
  Object.values(value).forEach(withoutDrag);
}

function buttons(table, save) {
  const bar = document.createElement("div");
  bar.className = "figure-buttons";
  if (table) {
    const csv = document.createElement("a");
    csv.textContent = "CSV";
    csv.title = "The figure's data as a table";
    csv.href = table;
    csv.download = "";
    bar.append(csv, " ");
  }
  const svg = document.createElement("button");
  svg.type = "button";
  svg.textContent = "SVG";
  svg.title = "The figure as it is drawn now";
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
