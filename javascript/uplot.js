// uPlot and its style sheet, for live signals and figures. A report has no imports: its scripts use the global name.
import "uplot/dist/uPlot.min.css";
import uPlot from "uplot";

Object.assign(globalThis, { uPlot });
export { uPlot };
