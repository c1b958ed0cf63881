// A worker that keeps the beat of the lease: browsers slow the timers of a page in the background
// down to one a minute, those of its workers they do not.
const BEAT_MS = 4000;

setInterval(() => postMessage("beat"), BEAT_MS);
