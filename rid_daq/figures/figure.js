// Shows figures of rid-daq, drawn with uPlot. The page has loaded uPlot as a global name.

const darkPage = matchMedia("(prefers-color-scheme: dark)");
/** @type {Record<string, number[]>} */
const DASHES = { solid: [], dashed: [7, 4], dotted: [1.5, 3], dotdash: [7, 3, 1.5, 3] };
const FONT = "12px system-ui, sans-serif";
const BAND = 0.2; // opacity of intervals and areas
const MARKER_PX = 6;
const LOW_PX = 120, SPACE_PX = 30, LEAST_SPACE_PX = 16; // height of a low panel, and distance of the numbers at the y axis: a low panel with wider distances would show only one number [px]
const ROW_PX = 24; // height of a row of spans (named ranges of x) [px]
const LEAST_DRAG_PX = 8;
const ALONG_PX = 16; // values within this distance of the pointer along x are shown
const POINT_PX = 40; // points within this distance of the pointer are shown
const MOST_VALUES = 6;
const X_MARGIN = 0.02;
const Y_MARGIN = 0.07;

/**
 * Show a figure.
 *
 * `source.item()` returns a promise of the figure's item (rid_daq/figures/figure_item.py). `source.svg` is the address of
 * its drawing, or a function that returns the drawing as text; `source.csv`, if there is one, is the address of its data.
 * `element.dataset.figureState` is "loading", "shown" or "failed". Returns a function that removes the figure from the page.
 *
 * @type {(element: HTMLElement, source: FigureSource) => () => void}
 */
export function showFigure(element, source) {
  const words = make("p", { role: "status" });
  const place = make("div", { class: "figure-panels" });
  const bar = make("div", { class: "figure-buttons" });
  /** @type {Figure | null} */
  let figure = null;
  let isRemoved = false;
  /** @type {(state: string, text: string) => void} */
  const setState = (state, text) => {
    if (isRemoved) return; // the element may show another figure by now
    element.dataset.figureState = state;
    words.textContent = text;
    words.hidden = !text;
  };
  element.replaceChildren(bar, words, place);
  setState("loading", "Loading the figure …");
  source.item().then(
    (item) => {
      if (isRemoved) return;
      figure = new Figure(item, place);
      fillButtons(bar, source, figure);
      setState("shown", "");
    },
  ).catch((error) => setState("failed", `The figure cannot be shown: ${error.message}`));
  return () => {
    isRemoved = true;
    figure?.remove();
    element.replaceChildren();
  };
}

/** @type {(bar: HTMLElement, source: FigureSource, figure: Figure) => void} */
function fillButtons(bar, source, figure) {
  const whole = make("button", { type: "button", title: "Show the whole figure again", hidden: "" }, "Whole");
  whole.addEventListener("click", () => figure.showWhole());
  figure.zoomed = (isZoomed) => (whole.hidden = !isZoomed);
  bar.append(whole);
  /** @type {(href: string, name: string, title: string) => void} */
  const file = (href, name, title) => bar.append(make("a", { href, download: name, title }, name.slice(name.lastIndexOf(".") + 1).toUpperCase()));
  if (source.csv) file(source.csv, `${figure.name}.csv`, "Download the figure's data as a CSV table");
  const { svg: drawing } = source;
  if (typeof drawing === "string") return file(drawing, `${figure.name}.svg`, "Download the whole figure as SVG");
  const svg = make("button", { type: "button", title: "Download the whole figure as SVG" }, "SVG");
  svg.addEventListener("click", () => save(drawing(figure.themes.light), `${figure.name}.svg`));
  bar.append(svg);
}

/** @type {(text: string, name: string) => void} */
function save(text, name) {
  const link = make("a", { href: URL.createObjectURL(new Blob([text], { type: "image/svg+xml" })), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

class Figure {
  /** @param {FigureItem} item @param {HTMLElement} place */
  constructor(item, place) {
    this.name = item.name;
    this.themes = item.themes;
    /** @type {(isZoomed: boolean) => void} */
    this.zoomed = () => {};
    const columns = item.columns.map(numbersOf);
    const longest = Math.max(0, ...item.panels.flatMap(({ rows }) => rows.map((row) => row.length)));
    const room = Math.min(190, Math.max(70, 24 + 7 * longest)); // one width, so that the x axes of all panels agree
    place.classList.toggle("figure-grid", item.isGrid);
    this.place = place;
    /** @type {Panel[]} */
    this.panels = [];
    for (const each of item.panels) {
      const group = (each.zoomsWithPrevious && this.panels.at(-1)?.group) || { range: null, panels: [] };
      const panel = new Panel(this, each, columns, group, room);
      this.panels.push(panel);
      place.append(panel.element);
    }
    for (const panel of this.panels) panel.begin();
    this.paint = () => {
      for (const [name, colour] of Object.entries(this.theme)) place.style.setProperty(`--figure-${name}`, colour);
      for (const { plot } of this.panels) plot.redraw(false, true);
    };
    darkPage.addEventListener("change", this.paint);
    this.paint();
    this.size = new ResizeObserver(() => this.panels.forEach((panel) => panel.fit()));
    this.size.observe(place);
  }

  get theme() {
    return darkPage.matches ? this.themes.dark : this.themes.light;
  }

  update() {
    this.zoomed(this.panels.some((panel) => panel.group.range !== null || panel.yRange !== null));
  }

  showWhole() {
    for (const panel of this.panels) panel.group.range = panel.yRange = null;
    for (const panel of this.panels) panel.scale();
    this.update();
  }

  remove() {
    darkPage.removeEventListener("change", this.paint);
    this.size.disconnect();
    for (const { plot } of this.panels) plot.destroy();
    this.place.replaceChildren();
  }
}

// One pair of axes: lines, bars side by side, or rows of spans.
class Panel {
  /** @type {Figure} */
  figure;
  /** @type {FigurePanel} */
  item;
  /** @type {PanelGroup} */
  group;
  room = 0;
  /** @type {Ends | null} */
  yRange = null;
  /** @type {Set<string>} */
  hidden = new Set();
  /** @type {DrawnLine[]} */
  lines;
  /** @type {uPlot} */
  plot;
  /** @type {HTMLElement} */
  tip;
  /** @type {HTMLElement} */
  dot;

  /** @param {Figure} figure @param {FigurePanel} item @param {Float32Array[]} columns @param {PanelGroup} group @param {number} room */
  constructor(figure, item, columns, group, room) {
    [this.figure, this.item, this.group, this.room] = [figure, item, group, room];
    group.panels.push(this);
    /** @type {(number: number | null) => Float32Array | null} */
    const column = (number) => (number === null ? null : columns[number]);
    this.lines = item.lines.map((line) => {
      const [x, y] = [columns[line.x], columns[line.y]];
      const isAscending = x.every((value, i) => i === 0 || value >= x[i - 1]);
      return { ...line, x, y, reach: column(line.reach), reachX: column(line.reachX), isAscending };
    });
    this.body = make("div", { class: "figure-body", role: "img", "aria-label": this.description() });
    const heading = item.title || (item.spans.length ? item.y.label : "");
    this.element = make("div", { class: "figure-panel" });
    if (heading) this.element.append(make("p", { class: "figure-title" }, heading));
    const legend = this.legend();
    if (legend) this.element.append(legend);
    this.element.append(this.body);
    this.height = item.spans.length ? 60 + ROW_PX * item.rows.length : item.height;
  }

  description() {
    const { item } = this;
    const names = [...new Set([...item.lines.map(({ label }) => label), ...item.rows])];
    return `${[item.title, item.y.text].filter(Boolean).join(", ")} over ${item.x.text}${names.length ? `: ${names.join(", ")}` : ""}`;
  }

  legend() {
    /** @type {Map<string, DrawnLine>} */
    const named = new Map();
    for (const line of this.lines) if (line.isNamed && !named.has(line.label)) named.set(line.label, line);
    if (!named.size) return null;
    /** @type {(entry: [string, DrawnLine]) => HTMLElement} */
    const entry = ([label, line]) => {
      const button = make("button", { type: "button", "aria-pressed": "true", title: `Hide or show ${label}` }, swatch(line), label);
      button.addEventListener("click", () => {
        const isShown = this.hidden.delete(label);
        if (!isShown) this.hidden.add(label);
        button.setAttribute("aria-pressed", String(isShown));
        for (const panel of this.group.panels) panel.scale(); // they share the range of x
      });
      return button;
    };
    return make("div", { class: "figure-legend" }, ...[...named].map(entry));
  }

  // Create the plot; the panel is in the page, and so its width is known.
  begin() {
    const { item } = this;
    /** @type {(name: string) => () => string} */
    const ink = (name) => () => this.figure.theme[name];
    const axis = { stroke: ink("ink"), grid: { stroke: ink("grid"), width: 1 }, ticks: { stroke: ink("grid"), width: 1, size: 5 }, font: FONT, labelFont: FONT, labelSize: 20, gap: 4 };
    const isNamed = item.bars.length > 0;
    /** @type {(axis: FigureAxis) => import("uplot").Scale} */
    const scale = ({ isLog }) => ({ time: false, auto: false, distr: isLog ? 3 : 1 });
    /** @type {(axis: FigureAxis) => import("uplot").Axis} */
    const marks = ({ isLog, isCount }) => (isLog ? { splits: logMarks } : isCount ? { incrs: COUNT_STEPS } : {});
    /** @type {(isLog: boolean) => (_: uPlot, splits: (number | null)[], __: number, ___: number, step: number) => string[]} */
    const numbers = (isLog) => (_, splits, __, ___, step) => splits.map((value) => (value === null ? "" : isLog ? digits(value, 3) : axisNumber(value, step)));
    /** @type {(names: string[]) => import("uplot").Axis} */
    const named = (names) => ({ splits: () => names.map((_, i) => i), values: () => names, grid: { show: false }, ticks: { show: false } });
    const rows = item.rows.toReversed();
    this.plot = new globalThis.uPlot(
      {
        width: this.width(),
        height: this.height,
        pxAlign: 0,
        legend: { show: false },
        padding: [8, 14, 0, 0],
        scales: { x: scale(item.x), y: scale(item.y) },
        axes: [
          {
            ...axis,
            size: item.hidesX ? 8 : isNamed ? 56 : 32,
            ...(item.hidesX ? {} : { label: item.x.text }),
            values: item.hidesX ? () => [] : numbers(item.x.isLog),
            ...marks(item.x),
            ...(isNamed ? { ...named(item.bars.map(({ name }) => name)), rotate: 35 } : {}),
          },
          { ...axis, space: (_, __, ___, ____, length) => (length < LOW_PX ? LEAST_SPACE_PX : SPACE_PX), size: this.room - 20, label: rows.length ? " " : item.y.text, values: numbers(item.y.isLog), ...marks(item.y), ...(rows.length ? named(rows) : {}) },
        ],
        series: [{}, { scale: "y", paths: () => null, points: { show: false } }],
        cursor: {
          y: false,
          points: { show: false },
          drag: { x: true, y: true, uni: 30, dist: LEAST_DRAG_PX, setScale: false },
          bind: { dblclick: () => () => (this.figure.showWhole(), null) },
        },
        hooks: { draw: [() => this.draw()], setSelect: [() => this.select()], setCursor: [() => this.point()] },
      },
      [[1, 2], [1, 2]],
      this.body,
    );
    this.tip = make("div", { class: "figure-tip", hidden: "" });
    this.dot = make("div", { class: "figure-dot", hidden: "" });
    this.plot.over.append(this.dot, this.tip);
    this.plot.over.addEventListener("wheel", (event) => this.turn(event), { passive: false });
    /** @type {((x: number) => number)[]} */
    const [shown, value] = item.x.isLog ? [Math.log10, (exponent) => 10 ** exponent] : [(x) => x, (x) => x]; // linear in pixels
    new Touches(this.plot.over, {
      move: (x, y) => this.plot.setCursor({ left: x, top: y }),
      pinch: (from, to) => this.zoom([value(from), value(to)], null),
      at: (x) => shown(this.plot.posToVal(x, "x")),
    });
    this.scale();
  }

  width() {
    return Math.max(240, Math.floor(this.body.getBoundingClientRect().width)); // `clientWidth` may be rounded up
  }

  fit() {
    if (this.plot.width === this.width()) return;
    this.plot.setSize({ width: this.width(), height: this.height });
    this.scale();
  }

  /** @type {() => DrawnLine[]} */
  shown() {
    return this.lines.filter(({ label }) => !this.hidden.has(label));
  }

  // Set both axes to the zoomed range, to the ends of the declared axis, or to the values.
  scale() {
    let x = this.group.range ?? this.item.x.ends ?? this.ownX();
    let y = this.yRange ?? this.item.y.ends ?? this.ownY(x);
    if (this.item.isToScale) [x, y] = this.toScale(x, y);
    this.plot.batch(() => {
      this.plot.setScale("x", { min: x[0], max: x[1] });
      this.plot.setScale("y", { min: y[0], max: y[1] });
    });
    this.point();
  }

  /** @type {() => Ends} */
  ownX() {
    const { bars } = this.item;
    if (bars.length) return [-0.6, bars.length - 0.4];
    const isLog = this.item.x.isLog;
    const spread = new Spread(isLog);
    for (const panel of this.group.panels) {
      for (const { from, to } of panel.item.spans) spread.add(from, to);
      for (const { x, reachX } of panel.shown()) for (let i = 0; i < x.length; i += 1) spread.add(...interval(x[i], reachX?.[i]));
    }
    return spread.range(X_MARGIN);
  }

  /** @type {(x: Ends) => Ends} */
  ownY([from, to]) {
    const { rows, bars, limits, marks, y: axis } = this.item;
    if (rows.length) return [-0.5, rows.length - 0.5];
    const spread = new Spread(axis.isLog);
    if (bars.length) spread.add(0);
    for (const { value } of bars) spread.add(value);
    for (const { x, y, reach, marker } of this.shown()) {
      /** @type {(i: number) => number[]} */
      const around = (i) => (marker ? [x[i]] : [x[i], x[i - 1] ?? x[i], x[i + 1] ?? x[i]]); // a line also reaches from a point outside into the range
      /** @type {(i: number) => boolean} */
      const isInside = (i) => Math.max(...around(i)) >= from && Math.min(...around(i)) <= to;
      for (let i = 0; i < x.length; i += 1) if (isInside(i)) spread.add(...interval(y[i], reach?.[i]));
    }
    spread.add(...limits, ...marks.map(({ y }) => y));
    return spread.range(Y_MARGIN);
  }

  // Widen one of two ranges so that a unit has the same length on both axes.
  /** @type {(x: Ends, y: Ends) => [Ends, Ends]} */
  toScale(x, y) {
    const { width, height } = this.plot.bbox;
    const unit = Math.max((x[1] - x[0]) / width, (y[1] - y[0]) / height);
    /** @type {(range: Ends, pixels: number) => Ends} */
    const widen = ([from, to], pixels) => [(from + to - unit * pixels) / 2, (from + to + unit * pixels) / 2];
    return [widen(x, width), widen(y, height)];
  }

  /** @type {(x: Ends | null, y: Ends | null) => void} */
  zoom(x, y) {
    if ((x && !isUsable(x, this.item.x)) || (y && !isUsable(y, this.item.y))) return;
    if (x) this.group.range = x;
    if (y) this.yRange = y;
    for (const panel of this.group.panels) panel.scale();
    this.figure.update();
  }

  select() {
    const { plot } = this;
    const { left, top, width, height } = plot.select;
    if (Math.max(width, height) < LEAST_DRAG_PX) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    /** @type {(part: number, whole: number) => boolean} */
    const isWhole = (part, whole) => part >= whole - 1;
    /** @type {Ends | null} */
    const x = isWhole(width, plot.over.clientWidth) ? null : [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")];
    /** @type {Ends | null} */
    const y = isWhole(height, plot.over.clientHeight) ? null : [plot.posToVal(top + height, "y"), plot.posToVal(top, "y")];
    this.zoom(x, y);
  }

  // The wheel zooms with the control key, and moves the figure with the shift key; otherwise the page scrolls.
  /** @type {(event: WheelEvent) => void} */
  turn(event) {
    if (!event.ctrlKey && !event.shiftKey) return;
    event.preventDefault();
    const width = this.plot.over.clientWidth;
    const turned = Math.sign(event.deltaY || event.deltaX);
    const at = event.clientX - this.plot.over.getBoundingClientRect().left;
    const factor = event.ctrlKey ? 1.25 ** turned : 1;
    const begin = event.ctrlKey ? at - factor * at : 0.1 * turned * width;
    this.zoom([this.plot.posToVal(begin, "x"), this.plot.posToVal(begin + factor * width, "x")], null);
  }

  // Show the values at the pointer.
  point() {
    const { left, top } = this.plot.cursor;
    const found = left === undefined || top === undefined || left < 0 ? null : this.valuesAt(left, top);
    this.tip.hidden = this.dot.hidden = !found;
    if (!found || left === undefined || top === undefined) return;
    this.tip.replaceChildren(...found.texts.map((text) => make("div", {}, text)));
    const { clientWidth: width } = this.plot.over;
    this.tip.classList.toggle("figure-tip-left", left > width / 2);
    this.tip.style.left = `${left}px`;
    this.tip.style.top = `${Math.max(0, top - 10)}px`;
    this.dot.hidden = !found.at || found.at[1] < 0 || found.at[1] > this.plot.over.clientHeight; // the value may be outside a zoomed range
    if (found.at) [this.dot.style.left, this.dot.style.top] = found.at.map((pixels) => `${pixels}px`);
  }

  /** @type {(left: number, top: number) => { at?: [number, number], texts: string[] } | null} */
  valuesAt(left, top) {
    const { item, plot } = this;
    const [atX, atY] = [plot.posToVal(left, "x"), plot.posToVal(top, "y")];
    if (item.spans.length) {
      const row = item.rows.length - 1 - Math.round(atY);
      const span = item.spans.find((each) => each.row === row && each.from <= atX && atX <= each.to);
      return span ? { texts: [item.rows[row], `from ${valueText(span.from, item.x)} to ${valueText(span.to, item.x)}`] } : null;
    }
    if (item.bars.length) {
      const bar = item.bars[Math.round(atX)];
      return bar ? { texts: [bar.name, `${item.y.label} ${valueText(bar.value, item.y)}`] } : null;
    }
    const lines = this.shown().filter(({ isArea }) => !isArea);
    const isAlong = !item.isToScale && lines.every(({ isAscending }) => isAscending);
    const hits = lines.map((line) => this.nearest(line, left, top, isAlong)).filter((hit) => hit !== null).filter(({ distance }) => distance <= (isAlong ? ALONG_PX : POINT_PX));
    if (!hits.length) return null;
    hits.sort((a, b) => a.toPointer - b.toPointer);
    const [first] = hits;
    const listed = isAlong ? hits.slice(0, MOST_VALUES) : [first];
    /** @type {(hit: Hit) => string} */
    const lineText = ({ line, i }) => `${line.label} ${valueText(line.y[i], item.y)}${line.reach ? ` ± ${digits(line.reach[i], 2)}` : ""}`;
    return { at: [first.px, first.py], texts: [`${item.x.label} ${valueText(first.line.x[first.i], item.x)}`, ...listed.map(lineText)] };
  }

  /** @type {(line: DrawnLine, left: number, top: number, isAlong: boolean) => Hit | null} */
  nearest(line, left, top, isAlong) {
    /** @type {Hit | null} */
    let best = null;
    for (let i = 0; i < line.x.length; i += 1) {
      if (!Number.isFinite(line.y[i])) continue;
      const [px, py] = [this.plot.valToPos(line.x[i], "x"), this.plot.valToPos(line.y[i], "y")];
      const toPointer = Math.hypot(px - left, py - top);
      const distance = isAlong ? Math.abs(px - left) : toPointer;
      if (!best || distance < best.distance) best = { line, i, px, py, distance, toPointer };
    }
    return best;
  }

  draw() {
    const { ctx, bbox } = this.plot;
    const ratio = globalThis.uPlot.pxRatio;
    /** @type {Pixels} */
    const at = { x: (value) => this.plot.valToPos(value, "x", true), y: (value) => this.plot.valToPos(value, "y", true) };
    const pen = new Pen(ctx, ratio, at, this.figure.theme);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    const { item } = this;
    const rows = item.rows.length;
    for (const { row, from, to, colour } of item.spans) pen.box(from, to, rows - 1 - row - 0.35, rows - 1 - row + 0.35, colour);
    const base = item.y.ends?.[0] ?? (item.y.isLog ? this.plot.scales.y.min ?? 0 : 0);
    item.bars.forEach(({ value }, i) => pen.box(i - 0.4, i + 0.4, base, value, "blue"));
    const lines = this.shown();
    for (const line of lines) if (line.isArea) pen.area(line.x, line.y, line.colour);
    for (const line of lines) if (line.reach && !line.marker && !line.isArea) pen.band(line, line.reach);
    for (const line of lines) if (!line.isArea) (line.marker ? pen.points(line) : pen.line(line));
    for (const limit of item.limits) pen.limit(limit, bbox);
    for (const mark of item.marks) pen.text(mark);
    ctx.restore();
  }
}

// Draws in the canvas of a plot.
class Pen {
  /** @param {CanvasRenderingContext2D} ctx @param {number} ratio @param {Pixels} at @param {Record<string, string>} theme */
  constructor(ctx, ratio, at, theme) {
    this.ctx = ctx;
    this.ratio = ratio;
    this.at = at;
    this.theme = theme;
  }

  /** @type {(colour: string, dash?: string, width?: number) => void} */
  set(colour, dash = "solid", width = 1.2) {
    this.ctx.strokeStyle = this.ctx.fillStyle = this.theme[colour];
    this.ctx.lineWidth = width * this.ratio;
    this.ctx.setLineDash(DASHES[dash].map((length) => length * this.ratio));
    this.ctx.lineJoin = "round";
  }

  /** @type {(line: DrawnLine) => void} */
  line({ x, y, colour, dash, width }) {
    this.set(colour, dash, width);
    this.ctx.beginPath();
    let isDown = false;
    for (let i = 0; i < x.length; i += 1) {
      const [px, py] = [this.at.x(x[i]), this.at.y(y[i])];
      const isFinite = Number.isFinite(px) && Number.isFinite(py);
      if (isFinite) isDown ? this.ctx.lineTo(px, py) : this.ctx.moveTo(px, py);
      isDown = isFinite;
    }
    this.ctx.stroke();
  }

  /** @type {(x: ArrayLike<number>, y: ArrayLike<number>, colour: string) => void} */
  area(x, y, colour) {
    this.set(colour);
    this.ctx.globalAlpha = BAND;
    this.ctx.beginPath();
    for (let i = 0; i < x.length; i += 1) this.ctx.lineTo(this.at.x(x[i]), this.at.y(y[i]));
    this.ctx.fill();
    this.ctx.globalAlpha = 1;
  }

  /** @type {(line: DrawnLine, reach: Float32Array) => void} */
  band({ x, y, colour }, reach) {
    const known = [...x.keys()].filter((i) => Number.isFinite(y[i]));
    const there = known.map((i) => [x[i], y[i] + reach[i]]);
    const outline = [...there, ...known.toReversed().map((i) => [x[i], y[i] - reach[i]])];
    this.area(outline.map(([px]) => px), outline.map(([, py]) => py), colour);
  }

  /** @type {(line: DrawnLine) => void} */
  points({ x, y, reach, reachX, colour, marker }) {
    this.set(colour);
    for (let i = 0; i < x.length; i += 1) {
      const [px, py] = [this.at.x(x[i]), this.at.y(y[i])];
      if (!Number.isFinite(px) || !Number.isFinite(py)) continue;
      this.ctx.beginPath();
      if (reach) this.segment(px, this.at.y(y[i] - reach[i]), px, this.at.y(y[i] + reach[i]));
      if (reachX) this.segment(this.at.x(x[i] - reachX[i]), py, this.at.x(x[i] + reachX[i]), py);
      this.ctx.stroke();
      this.ctx.beginPath();
      this.outline(marker, px, py, (MARKER_PX * this.ratio) / 2);
      this.ctx.fill();
    }
  }

  /** @type {(fromX: number, fromY: number, toX: number, toY: number) => void} */
  segment(fromX, fromY, toX, toY) {
    this.ctx.moveTo(fromX, fromY);
    this.ctx.lineTo(toX, toY);
  }

  /** @type {(marker: string | null, x: number, y: number, half: number) => void} */
  outline(marker, x, y, half) {
    if (marker === "circle") return this.ctx.arc(x, y, half, 0, 2 * Math.PI);
    for (const [dx, dy] of CORNERS[marker ?? "square"]) this.ctx.lineTo(x + dx * half, y + dy * half);
    return this.ctx.closePath();
  }

  /** @type {(fromX: number, toX: number, fromY: number, toY: number, colour: string) => void} */
  box(fromX, toX, fromY, toY, colour) {
    this.set(colour);
    const [left, bottom] = [this.at.x(fromX), this.at.y(fromY)];
    const [right, top] = [this.at.x(toX), this.at.y(toY)];
    if ([left, right, top, bottom].every(Number.isFinite)) this.ctx.fillRect(left, top, right - left, bottom - top);
  }

  /** @type {(value: number, bbox: { left: number, width: number }) => void} */
  limit(value, { left, width }) {
    this.set("red", "dashed");
    this.ctx.beginPath();
    this.segment(left, this.at.y(value), left + width, this.at.y(value));
    this.ctx.stroke();
  }

  /** @type {(mark: FigureMark) => void} */
  text({ x, y, text, colour }) {
    this.set(colour);
    this.ctx.font = `${12 * this.ratio}px system-ui, sans-serif`;
    this.ctx.textAlign = "left";
    this.ctx.textBaseline = "middle";
    this.ctx.fillText(text, this.at.x(x) + 6 * this.ratio, this.at.y(y));
  }
}

/** @type {Record<string, [number, number][]>} */
const CORNERS = {
  square: [[-1, -1], [1, -1], [1, 1], [-1, 1]],
  diamond: [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]],
  triangle: [[0, -1.1], [1.1, 0.9], [-1.1, 0.9]],
  inverted_triangle: [[0, 1.1], [1.1, -0.9], [-1.1, -0.9]],
};

// Least and greatest of the values added; on a logarithmic axis only positive ones count.
class Spread {
  /** @param {boolean} isLog */
  constructor(isLog) {
    this.isLog = isLog;
    this.least = Infinity;
    this.most = -Infinity;
  }

  /** @type {(...values: number[]) => void} */
  add(...values) {
    for (const value of values) {
      if (!Number.isFinite(value) || (this.isLog && value <= 0)) continue;
      this.least = Math.min(this.least, value);
      this.most = Math.max(this.most, value);
    }
  }

  // Return the range with a margin on both sides, as a fraction of it.
  /** @type {(margin: number) => Ends} */
  range(margin) {
    if (this.least > this.most) return this.isLog ? [1, 10] : [0, 1];
    const [from, to] = this.isLog ? [Math.log10(this.least), Math.log10(this.most)] : [this.least, this.most];
    const add = Math.max(margin * (to - from), 1e-6 * Math.max(Math.abs(from), Math.abs(to)), to === from ? 0.5 : 0);
    return this.isLog ? [10 ** (from - add), 10 ** (to + add)] : [from - add, to + add];
  }
}

/** Touch input on a plot: one finger moves the cursor, two fingers zoom; one finger can still scroll the page. */
export class Touches {
  /** @param {HTMLElement} place @param {{ move: (x: number, y: number) => void, pinch: (from: number, to: number) => void, at: (x: number) => number }} actions */
  constructor(place, { move, pinch, at }) {
    /** @type {Map<number, number>} */
    const fingers = new Map(); // horizontal position of each finger [px]
    /** @type {number[] | null} */
    let pinned = null; // values under the two fingers when the second finger touched the plot
    /** @type {(event: PointerEvent) => number} */
    const x = (event) => event.clientX - place.getBoundingClientRect().left;
    /** @type {(event: PointerEvent) => number} */
    const y = (event) => event.clientY - place.getBoundingClientRect().top;
    /** @type {(event: PointerEvent) => void} */
    const end = (event) => {
      fingers.delete(event.pointerId);
      pinned = null;
    };
    place.addEventListener("pointerdown", (event) => {
      if (event.pointerType !== "touch") return;
      fingers.set(event.pointerId, x(event));
      if (fingers.size === 2) pinned = [...fingers.values()].map(at).sort((a, b) => a - b);
      else if (fingers.size === 1) move(x(event), y(event));
    });
    place.addEventListener("pointermove", (event) => {
      if (!fingers.has(event.pointerId)) return;
      fingers.set(event.pointerId, x(event));
      if (fingers.size === 1) move(x(event), y(event));
      if (fingers.size !== 2 || pinned === null) return;
      const [left, right] = [...fingers.values()].sort((a, b) => a - b);
      if (right - left < LEAST_DRAG_PX) return;
      const perPixel = (pinned[1] - pinned[0]) / (right - left); // each finger keeps the value that was under it at first
      const from = pinned[0] - perPixel * left;
      pinch(from, from + perPixel * place.clientWidth);
    });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel", "pointerleave"])) place.addEventListener(name, end);
  }
}

// Return a value and the ends of its interval; on a logarithmic axis, the lower end may not count.
/** @type {(value: number, reach?: number) => number[]} */
const interval = (value, reach = 0) => [value, value - reach, value + reach];

// Return true if an axis can show a range: it must be wider than the rounding of 32-bit numbers.
/** @type {(range: Ends, axis: FigureAxis) => boolean} */
const isUsable = ([from, to], { isLog }) => to - from > 1e-6 * Math.max(Math.abs(from), Math.abs(to)) && Number.isFinite(to - from) && (!isLog || from > 0);

/** @type {(text: string) => Float32Array} */
const numbersOf = (text) => new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
/** @type {(value: number, count: number) => string} */
const digits = (value, count) => String(Number(value.toPrecision(count)));
/** @type {(value: number, axis: FigureAxis) => string} */
const valueText = (value, { unit }) => `${digits(value, 5)}${unit === "1" ? "" : ` ${unit}`}`;

// Return a number at a linear axis, with the decimals that the distance of the marks needs.
/** @type {(value: number, step: number) => string} */
function axisNumber(value, step) {
  if (step < 1e-4 || Math.abs(value) >= 1e6) return digits(value, 6);
  let decimals = 0;
  while (decimals < 6 && Math.abs(step * 10 ** decimals - Math.round(step * 10 ** decimals)) > 1e-3) decimals += 1;
  return value.toFixed(decimals);
}

// Distances between the marks of an axis that counts something.
const COUNT_STEPS = [0, 1, 2, 3, 4, 5, 6].flatMap((power) => [1, 2, 5].map((factor) => factor * 10 ** power));

// Return the marks of a logarithmic axis: the multiples of powers of ten; in a narrow range, multiples of a smaller step.
// uPlot's own marks never end if a range begins less than 5 % below a power of ten.
/** @type {(_plot: uPlot, _axis: number, from: number, to: number) => number[]} */
function logMarks(_plot, _axis, from, to) {
  /** @type {number[]} */
  const marks = [];
  if (!(0 < from && from < to)) return marks;
  /** @type {(value: number) => unknown} */
  const add = (value) => value >= from && value <= to && marks.push(value);
  for (let power = Math.floor(Math.log10(from)); 10 ** power <= to; power += 1) for (let i = 1; i < 10; i += 1) add(Number(`${i}e${power}`));
  if (marks.length > 2) return marks;
  marks.length = 0;
  const step = Math.floor(Math.log10(to - from));
  for (let i = Math.ceil(from / 10 ** step); i <= to / 10 ** step; i += 1) add(Number(`${i}e${step}`));
  return marks;
}

// Return a picture of a line for the legend.
/** @type {(line: DrawnLine) => SVGElement} */
function swatch({ colour, dash, width, marker, isArea }) {
  /** @type {(name: "svg" | "rect" | "path" | "circle" | "polygon", attributes: Record<string, string | number>) => SVGElement} */
  const draw = (name, attributes) => {
    const part = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) part.setAttribute(key, String(value));
    return part;
  };
  const picture = draw("svg", { width: 26, height: 12, viewBox: "0 0 26 12", "aria-hidden": "true", class: "figure-swatch" });
  picture.style.color = `var(--figure-${colour})`;
  if (isArea) picture.append(draw("rect", { x: 2, y: 1, width: 22, height: 10, fill: "currentColor", opacity: 0.4 }));
  else if (!marker) picture.append(draw("path", { d: "M1 6H25", stroke: "currentColor", "stroke-width": width, "stroke-dasharray": DASHES[dash].join(" ") }));
  else if (marker === "circle") picture.append(draw("circle", { cx: 13, cy: 6, r: 3.5, fill: "currentColor" }));
  else picture.append(draw("polygon", { points: CORNERS[marker].map(([x, y]) => `${13 + 3.5 * x},${6 + 3.5 * y}`).join(" "), fill: "currentColor" }));
  return picture;
}

/** @template {keyof HTMLElementTagNameMap} Tag @param {Tag} name @param {Record<string, string>} attributes @param {...(Node | string)} children @returns {HTMLElementTagNameMap[Tag]} */
function make(name, attributes, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children);
  return made;
}
