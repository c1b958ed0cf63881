// Time plots of the live signals: one chart for each signal and unit, all with the same time axis and cursor.
import { clockOf, element } from "./dom.js";
import { Touches } from "./figure.js";
import { timesOf, valuesOf } from "./signal_store.js";
import { uPlot } from "./uplot.js";

const HEIGHT_PX = 220;
const LEAST_DRAG_PX = 8;
const COLOURS = 8;
const DASH = [8, 4]; // dashed lines for the joints after the first COLOURS joints
const SYNC = "signals";
const DEGREES = 180 / Math.PI;

// Signals of the joints: their columns in the data (rid_daq/service/signals/signal_bins.py), and unit and factor for
// each kind of joint.
/** @type {{ title: string, lane: string, units: Record<JointKind, [string, number]>, titles?: Partial<Record<JointKind, string>> }[]} */
const SIGNALS = [
  { title: "Position", lane: "position", units: { revolute: ["°", DEGREES], prismatic: ["mm", 1000] } },
  { title: "Speed", lane: "velocity", units: { revolute: ["°/s", DEGREES], prismatic: ["mm/s", 1000] } },
  { title: "Torque", lane: "torque", units: { revolute: ["N m", 1], prismatic: ["N", 1] }, titles: { prismatic: "Force" } },
  { title: "Following error", lane: "following_error", units: { revolute: ["°", DEGREES], prismatic: ["mm", 1000] } },
];
const TEMPERATURE = { title: "Motor temperature", low: "temperature", high: "temperature", unit: "°C", factor: 1 };
const BUS = { title: "Bus: time from SYNC to the last answer", low: "exchange_low", high: "exchange_high", unit: "% of the cycle", factor: 100, isFromZero: true };

// Return the charts for joints ({ name, kind }). A chart has a title, a unit, the columns of its data, a factor, and
// the indices of its joints (null: a signal of the cell).
/** @type {(joints: SignalJoint[], hasMonitor: boolean) => SignalChart[]} */
export function chartsOf(joints, hasMonitor) {
  /** @type {(kind: JointKind | null) => number[]} */
  const of = (kind) => joints.map((_, i) => i).filter((i) => kind === null || joints[i].kind === kind);
  /** @type {SignalChart[]} */
  const found = [];
  for (const { title, lane, units, titles } of SIGNALS)
    for (const [kind, [unit, factor]] of /** @type {[JointKind, [string, number]][]} */ (Object.entries(units)))
      if (of(kind).length)
        found.push({ title: titles?.[kind] ?? title, low: `${lane}_low`, high: `${lane}_high`, unit, factor, joints: of(kind) });
  if (hasMonitor) found.push({ ...TEMPERATURE, joints: of(null) });
  return [...found, { ...BUS, joints: null }];
}

// Return the custom property with the colour of a joint's line, and its dashes.
/** @type {(joint: number) => { colour: string, dash: number[] }} */
export const lineOf = (joint) => ({ colour: `--line-${1 + (joint % COLOURS)}`, dash: joint < COLOURS ? [] : DASH });

export class SignalPlots {
  // `zoomed(from, to)` is called when the user has chosen another time range by dragging or with two fingers,
  // `pointed(time)` when the cursor has moved (null: it is hidden).
  /** @param {HTMLElement} place @param {SignalChart[]} charts @param {SignalJoint[]} joints @param {{ zoomed: (from: number, to: number) => void, pointed: (time: number | null) => void }} listeners */
  constructor(place, charts, joints, { zoomed, pointed }) {
    this.place = place;
    this.joints = joints;
    this.zoomed = zoomed;
    this.pointed = pointed;
    /** @type {Set<number | null>} */
    this.hidden = new Set(); // indices of the joints whose lines are hidden
    /** @type {[number, number]} */
    this.range = [0, 1];
    /** @type {number | null} */
    this.pointedAt = null;
    this.isSetting = false;
    this.plots = charts.map((chart) => this.make(chart));
    new ResizeObserver(() => this.fit()).observe(place);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.plots.forEach(({ plot }) => plot.redraw(false)));
  }

  /** @type {(chart: SignalChart) => { plot: uPlot, chart: SignalChart }} */
  make(chart) {
    const title = `${chart.title} [${chart.unit}]`;
    const body = element("div", { role: "img", "aria-label": `${title} over time. The table shows the values at the cursor.` });
    this.place.append(element("figure", { class: "signal-chart" }, element("h2", {}, title), body));
    /** @type {(name: string) => () => string} */
    const colour = (name) => () => getComputedStyle(this.place).getPropertyValue(name);
    const axis = { stroke: colour("--ink"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--grid"), width: 1 }, font: "14px sans-serif" };
    const lines = (chart.joints ?? [null]).map((joint) => {
      const { colour: name, dash } = joint === null ? { colour: "--ink", dash: [] } : lineOf(joint);
      return { label: joint === null ? chart.title : this.joints[joint].name, stroke: colour(name), width: 1.5, dash, spanGaps: false, points: { show: false } };
    });
    const plot = new uPlot({
      width: this.width(), height: HEIGHT_PX, pxAlign: 0, legend: { show: false }, padding: [null, 28, null, null],
      cursor: { sync: { key: SYNC, setSeries: false }, drag: { x: true, y: false, setScale: false, dist: LEAST_DRAG_PX }, points: { show: false }, y: false, bind: { dblclick: () => null } },
      scales: { x: { time: true, range: () => this.range }, y: { range: chart.isFromZero ? rangeFromZero : rangeOfValues } },
      axes: [{ ...axis, space: 90, values: (_, times) => times.map(clockOf) }, { ...axis, size: 64 }],
      series: [{}, ...lines],
      hooks: {
        setCursor: [(self) => this.isPointing(self) && this.pointed((self.cursor.left ?? -1) < 0 ? null : self.posToVal(self.cursor.left ?? 0, "x"))],
        setSelect: [(self) => this.select(self)],
      },
    }, [[], ...lines.map(() => [])], body);
    new Touches(plot.over, {
      move: (x) => this.point(plot.posToVal(x, "x")),
      pinch: (from, to) => this.zoomed(from, to), at: (x) => plot.posToVal(x, "x"),
    });
    return { plot, chart };
  }

  // All charts show the cursor, but only the chart under the mouse reports its movements.
  /** @type {(plot: uPlot) => boolean} */
  isPointing(plot) {
    return !this.isSetting && plot.cursor.event !== null && plot.cursor.event !== undefined;
  }

  /** @type {(plot: uPlot) => void} */
  select(plot) {
    const { left, width } = plot.select;
    if (width < LEAST_DRAG_PX || plot.cursor.event === null) return;
    const [from, to] = [plot.posToVal(left, "x"), plot.posToVal(left + width, "x")];
    for (const each of this.plots) each.plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.zoomed(from, to);
  }

  // Draw the values between two times [s].
  /** @type {(store: import("./signal_store.js").SignalStore, from: number, to: number) => void} */
  draw(store, from, to) {
    this.range = [from, to];
    const columns = store.columns(from, to, Math.max(100, this.width()));
    const times = timesOf(store, columns);
    const empty = times.map(() => null);
    for (const { plot, chart } of this.plots) {
      /** @type {(lane: string, joint: number | null) => Float32Array} */
      const row = (lane, joint) => store.values[(store.rows.get(lane) ?? 0) + (joint ?? 0)];
      const lines = (chart.joints ?? [null]).map((joint) => {
        if (this.hidden.has(joint) || !store.rows.has(chart.low)) return empty;
        return valuesOf(columns, row(chart.low, joint), row(chart.high, joint), chart.factor);
      });
      plot.setData([times, ...lines]);
    }
    if (this.pointedAt !== null) this.point(this.pointedAt, false);
  }

  // Show the cursor at a time [s] in all charts (null: hide it).
  /** @type {(time: number | null, isNew?: boolean) => void} */
  point(time, isNew = true) {
    this.pointedAt = time;
    this.isSetting = true;
    for (const { plot } of this.plots) {
      const isInside = time !== null && time >= this.range[0] && time <= this.range[1];
      plot.setCursor(isInside ? { left: plot.valToPos(time, "x"), top: 0 } : { left: -10, top: -10 }, false);
    }
    this.isSetting = false;
    if (isNew) this.pointed(time);
  }

  width() {
    return Math.max(200, this.place.firstElementChild?.clientWidth ?? this.place.clientWidth);
  }

  fit() {
    for (const { plot } of this.plots) if (plot.width !== this.width()) plot.setSize({ width: this.width(), height: HEIGHT_PX });
  }
}

// Return the range of the vertical axis: it contains all values with a margin, and is wide enough that rounding errors
// do not fill the chart.
/** @type {(_: uPlot, least: number, most: number) => [number, number]} */
function rangeOfValues(_, least, most) {
  if (!Number.isFinite(least ?? NaN)) return [0, 1];
  const margin = Math.max(0.05 * (most - least), 1e-4 * Math.max(Math.abs(least), Math.abs(most)), 1e-6);
  return [least - margin, most + margin];
}

/** @type {(_: uPlot, least: number, most: number) => [number, number]} */
const rangeFromZero = (_, __, most) => [0, Number.isFinite(most ?? NaN) ? 1.2 * most : 1];
