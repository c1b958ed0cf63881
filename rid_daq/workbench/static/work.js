// Functions that several work pages share: blocks, figures, findings, choices.
import { blockParts } from "./blocks.js";
import { linked } from "./commands.js";
import { addressOf, element, find, parseNumber, seen, timeOf } from "./dom.js";
import { keptChoice } from "./entries.js";
import { refuseField } from "./fields.js";
import { showFigure } from "./figure.js";
import { html, render } from "./lit.js";
import { failedPart, loadingPart } from "./loading.js";
import { LIST_MS, request } from "./requests.js";
import { ask, page } from "./service.js";

export const wanted = new URLSearchParams(location.search);

// Request a document that is made for the pages; its address is not part of the API.
/** @type {(path: string, limits?: RequestLimits) => Promise<any>} */
export const look = (path, { signal = null, patienceMs = 30000 } = {}) => request(path, {}, { patienceMs, signal });

// Return the address of the blocks at `path`, with `values` as its query.
/** @type {(path: string, values?: Record<string, any> | string[][]) => string} */
export const blocksUrl = (path, values = []) => `/blocks${path}?${new URLSearchParams(values)}`;
/** @type {(run: string, ...sections: string[]) => string} */
export const ofRun = (run, ...sections) => blocksUrl(`/runs/${encodeURIComponent(run)}`, sections.map((name) => ["section", name]));

const FIGURE_MS = 120000; // timeout of a figure: a long run over a slow connection takes long

// Cancel the loading of a figure.
/** @type {(place: HTMLElement) => void} */
function endFigure(place) {
  place.loading?.abort();
  place.loading = null;
  delete place.dataset.again;
}

// Show a figure: it is loaded when its element is nearly visible, and drawn when it is visible, because drawing delays the
// 3-D view of the same page by seconds on a slow computer. The previous figure remains until the new one is drawn.
// If another figure is still being loaded there, this loading is cancelled; if it is the same figure, it is loaded again
// afterwards.
/** @type {(place: HTMLElement, url: string) => Promise<void>} */
export async function figureIn(place, url) {
  if (place.loading && place.dataset.url === url) {
    place.dataset.again = "yes";
    return;
  }
  endFigure(place);
  const loading = new AbortController();
  const { signal } = loading;
  place.loading = loading;
  place.dataset.url = url;
  place.dataset.figureState = "waiting";
  const before = place.lastElementChild;
  const drawn = element("div", {}, element("p", { class: "soft" }, "Loading the figure …"));
  place.append(drawn);
  signal.addEventListener("abort", () => drawn.remove());
  try {
    await seen(place, "50%", signal);
    if (signal.aborted) return;
    place.dataset.figureState = "loading";
    await import("./uplot.js"); // uPlot is loaded with the first figure, so that buttons work earlier
  } catch (error) {
    if (signal.aborted) return;
    place.loading = null;
    place.dataset.figureState = "failed";
    place.replaceChildren(element("p", { class: "problem" }, error.message));
    return;
  }
  if (signal.aborted) return;
  /** @type {(values: Record<string, string>) => string} */
  const of = (values) => `${url}&${new URLSearchParams(values)}`;
  const takeOut = showFigure(drawn, {
    csv: of({ as: "csv" }),
    svg: of({ as: "svg" }),
    item: () => look(url, { signal, patienceMs: FIGURE_MS }).then((item) => seen(place, "0%", signal).then(() => item)),
  });
  const watch = new MutationObserver(() => {
    const state = drawn.dataset.figureState;
    if (state === "loading") return;
    watch.disconnect();
    place.loading = null;
    before?.takeOut?.();
    before?.remove();
    place.dataset.figureState = state;
    if (place.dataset.again) {
      delete place.dataset.again;
      figureIn(place, url);
    }
  });
  watch.observe(drawn, { attributes: true, attributeFilter: ["data-figure-state"] });
  drawn.takeOut = takeOut;
  signal.addEventListener("abort", () => {
    watch.disconnect();
    takeOut();
  });
}

// Show the blocks of an address; each plot is loaded when it becomes visible. While the blocks load, a text says so; after
// an error, a button loads them again. The promise resolves with the blocks once they are shown, or with null if other
// blocks are requested there first.
/** @type {(place: HTMLElement, url: string, options?: { keep?: (block: PageBlock) => boolean, what?: string }) => Promise<PageBlock[] | null>} */
export async function showBlocks(place, url, { keep = () => true, what = "result" } = {}) {
  endFigure(place);
  const loading = new AbortController();
  const { signal } = loading;
  place.loading = loading;
  place.style.minHeight = `${place.offsetHeight}px`; // what the user reads below must not jump
  renderBlocks(place, loadingPart(what));
  try {
    const blocks = (await look(url, { signal, patienceMs: FIGURE_MS })).filter(keep);
    if (signal.aborted) return null;
    /** @type {(plot: PlotBlock) => HTMLElement} */
    const figure = ({ name, number }) => {
      const made = element("div", { class: "figure", "data-figure": name });
      figureIn(made, `${url}&plot=${number}`);
      return made;
    };
    renderBlocks(place, blockParts(blocks, figure, 15, (number) => `${url}&image=${number}`));
    place.loading = null;
    return blocks;
  } catch (error) {
    if (signal.aborted) return null;
    return new Promise((resolve) => {
      const again = () => {
        place.loading = null;
        resolve(showBlocks(place, url, { keep, what }));
      };
      signal.addEventListener("abort", () => resolve(null));
      renderBlocks(place, failedPart(error, again));
    });
  } finally {
    if (!signal.aborted) place.style.minHeight = "";
  }
}

/** @type {(place: HTMLElement, parts: unknown) => void} */
function renderBlocks(place, parts) {
  for (const old of /** @type {NodeListOf<HTMLElement>} */ (place.querySelectorAll(".figure"))) {
    endFigure(old);
    old.lastElementChild?.takeOut?.();
  }
  render(parts, place);
}

// Show sections of a run's result.
/** @type {(place: HTMLElement, run: string, ...sections: string[]) => Promise<PageBlock[] | null>} */
export const showRun = (place, run, ...sections) => showBlocks(place, ofRun(run, ...sections));

// ---- words
/** @type {Record<string, [string, string]>} */
const FINDINGS = { true: ["good", "Good: "], false: ["bad", "Problem: "], null: ["", ""] };
/** @type {(list: Api.Finding[]) => Part[]} */
export const findings = (list) => list.map(({ passed, text }) => {
  const [kind, word] = FINDINGS[String(passed)];
  return html`<li class=${kind}><b>${word}</b>${linked(text)}</li>`;
});

// ---- choices
/** @type {(select: HTMLSelectElement, list: { value: string, words: string }[], chosen?: string | null) => void} */
export function options(select, list, chosen = null) {
  const before = chosen || select.value || (keptChoice(select) ?? "");
  const empty = select.dataset.none ?? (list.length ? null : "none yet");
  const none = empty === null ? [] : [element("option", { value: "" }, empty)];
  select.replaceChildren(...none, ...list.map(({ value, words }) => element("option", { value }, words)));
  if ([...select.options].some((option) => option.value === before)) select.value = before;
}

// Add a file that a job has written to the options of a selection field, and select this file.
/** @type {(select: HTMLSelectElement, path: string, words?: string, kind?: string) => void} */
export function offer(select, path, words = path, kind = "") {
  const there = [...select.options].find((option) => option.value === path);
  if (!there) select.prepend(element("option", { value: path, "data-kind": kind }, words));
  select.value = path;
  select.dispatchEvent(new Event("change"));
}

/** @type {(run: Api.RunEntry) => string} */
export const runWords = (run) => `${run.label || run.id}, ${timeOf(run.created_utc)}`;

/** @type {() => Promise<Api.RunEntry[]>} */
export async function completeRuns() {
  const runs = await ask("GET", `/runs?limit=200&cell=${encodeURIComponent(page.cell)}`, undefined, LIST_MS);
  return runs.filter((run) => run.kind !== "payload session" && (run.status === "complete" || run.status === "recovered"));
}

// Return complete runs without axis tests and jogs, which have no motion file.
/** @type {() => Promise<Api.RunEntry[]>} */
export const motionRuns = async () => (await completeRuns()).filter(({ kind, motion }) => kind !== "record" || motion);

// Return the number that the user has entered in a field; throw an error with a message if it is not valid.
/** @type {(id: InputId, limits?: { least?: number, whole?: boolean }) => number} */
export function numberOf(id, { least = -Infinity, whole = false } = {}) {
  const input = find(id);
  const value = parseNumber(input.value);
  const label = input.labels?.[0].firstChild?.textContent?.trim();
  if (Number.isNaN(value) || value < least || (whole && !Number.isInteger(value)))
    throw refuseField(input, `${label}: ${input.value.trim() ? `"${input.value.trim()}" is not valid; ` : ""}give a ${whole ? "whole " : ""}number${least > -Infinity ? ` of at least ${least}` : ""}, such as ${whole ? "10" : "9.6"}.`);
  return value;
}

// Return the selected model and payload as fields of a request.
/** @type {() => { model?: string, payload?: string }} */
export function modelOf() {
  const [model, payload] = [find("model").value, find("payload").value];
  return model ? { model, ...(payload ? { payload } : {}) } : {};
}

// Return the name that the user has entered for an output file, with the file name ending `ending`.
/** @type {(id: InputId, ending: string) => string} */
export function nameOf(id, ending) {
  const name = find(id).value.trim();
  if (!/^[A-Za-z0-9][\w.-]{0,80}$/.test(name)) throw new Error("Name of the file: begin with a letter or a digit, and use only letters, digits, dots, - and _.");
  return name.endsWith(ending) ? name : name + ending;
}

// When the user clicks a button, run its action; show an error in the panel.
/** @type {(id: keyof PageElements, panel: import("./job_panel.js").JobPanel, kind: string, action: () => unknown) => void} */
export function press(id, panel, kind, action) {
  find(id).addEventListener("click", async () => {
    try {
      await action();
    } catch (error) {
      panel.refuse(kind, error);
    }
  });
}

/** @type {(path: string, text: string) => Part} */
export const fileLink = (path, text) =>
  html`<a class="button" download href="/api/v1/files/${addressOf(path)}">${text}</a>`;
