// Types of figure.js: a figure as the service sends it (rid_daq/figures/figure_item.py).

interface FigureItem {
  name: string;
  isGrid: boolean;
  themes: { light: Record<string, string>; dark: Record<string, string> };
  panels: FigurePanel[];
  columns: string[];
}

interface FigurePanel {
  title: string;
  x: FigureAxis;
  y: FigureAxis;
  height: number;
  hidesX?: boolean;
  isToScale: boolean;
  zoomsWithPrevious: boolean;
  limits: number[];
  lines: FigureLine[];
  marks: FigureMark[];
  rows: string[];
  spans: { row: number; from: number; to: number; colour: string }[];
  bars: { name: string; value: number }[];
}

interface FigureAxis {
  label: string;
  text: string;
  unit: string;
  isLog: boolean;
  isCount: boolean;
  ends: Ends | null;
}

interface FigureMark {
  x: number;
  y: number;
  text: string;
  colour: string;
}

/** A line; `x`, `y`, `reach` and `reachX` are numbers of columns. */
interface FigureLine {
  label: string;
  isNamed: boolean;
  x: number;
  y: number;
  reach: number | null;
  reachX: number | null;
  colour: string;
  dash: string;
  width: number;
  marker: string | null;
  isArea: boolean;
}

/** A line with its columns. */
interface DrawnLine extends Omit<FigureLine, "x" | "y" | "reach" | "reachX"> {
  x: Float32Array;
  y: Float32Array;
  reach: Float32Array | null;
  reachX: Float32Array | null;
  isAscending: boolean;
}

/** The point of a line that is nearest to the pointer, and its place [px]. */
interface Hit {
  line: DrawnLine;
  i: number;
  px: number;
  py: number;
  distance: number;
  toPointer: number;
}

/** Panels with the same range of x. */
interface PanelGroup {
  range: Ends | null;
  panels: { item: FigurePanel; shown(): DrawnLine[]; scale(): void }[];
}

/** What `showFigure` needs: the item, its drawing (an address, or a function that makes it), and its table. */
interface FigureSource {
  item: () => Promise<FigureItem>;
  svg: string | ((colours: Record<string, string>) => string);
  csv?: string;
}

/** Functions that convert a value of an axis to pixels. */
interface Pixels {
  x: (value: number) => number;
  y: (value: number) => number;
}

/** Both ends of an axis. */
type Ends = [number, number];

declare var uPlot: typeof import("uplot");

/** A report contains figure.js before report.js. */
declare const showFigure: (element: HTMLElement, source: FigureSource) => () => void;
