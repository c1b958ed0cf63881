// Web worker with the timer of the lease renewal.
// Browsers slow the timers of a background page down to one call per minute, but not the timers of a web worker.
const BEAT_MS = 4000;

setInterval(() => postMessage("beat"), BEAT_MS);
