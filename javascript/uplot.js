// uPlot and its style sheet, for the plots of live signals.
import "uplot/dist/uPlot.min.css";
export { default as uPlot } from "uplot";
