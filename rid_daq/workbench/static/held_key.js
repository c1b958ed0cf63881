// Key that the user holds on this page. While it is held, the page answers each challenge of the service at once.
// The service therefore knows the age of an answer. After a gap the press no longer counts; a new press is needed.
const LIMIT_MS = 300; // CHALLENGE_LIMIT_S of acquisition/hold_to_run/held_key.py
const WATCH_MS = 50;

export class HeldKey {
  // `send(message)` adds the operator's lease to a message and sends it; false means: no connection or no lease.
  // `tell(job, text)` shows why a key does not count.
  constructor(send, tell) {
    this.send = send;
    this.tell = tell;
    this.sequence = 0;
    this.newest = new Map(); // by job: the newest challenge and its arrival time
    this.press = null; // { job, key, counts, from }: `counts` is true until there is a gap
    this.timer = null;
  }

  hold(job, key) {
    this.letGo();
    this.press = { job, key, counts: true, from: performance.now() };
    this.timer = setInterval(() => this.watch(), WATCH_MS);
    const released = this.say(job, { held: "" }); // a press begins with a release message
    if (!released) this.end("the service does not answer");
    else if (this.age(job) < LIMIT_MS) this.answer();
  }

  letGo() {
    clearInterval(this.timer);
    if (this.press) this.say(this.press.job, { held: "" });
    this.press = null;
  }

  tap(job, key) {
    this.say(job, { tapped: key });
  }

  challenge({ job, value }) {
    this.watch(); // detects a gap before this challenge
    this.newest.set(job, { value, at: performance.now() });
    if (this.press?.job === job) this.answer();
  }

  // The connection has ended: its challenges are not valid on the next one.
  cut() {
    this.newest.clear();
    this.end("the connection has ended");
  }

  age(job) {
    const newest = this.newest.get(job);
    return newest ? performance.now() - newest.at : Infinity;
  }

  watch() {
    if (!this.press) return;
    const silent = Math.min(this.age(this.press.job), performance.now() - this.press.from);
    if (silent >= LIMIT_MS) this.end(`link too slow: no message for ${Math.round(silent)} ms`);
  }

  end(why) {
    if (!this.press?.counts) return;
    this.press.counts = false;
    this.tell(this.press.job, `${why}: the key does not count; release it and press it again`);
  }

  answer() {
    if (this.press.counts) this.say(this.press.job, { held: this.press.key });
  }

  say(job, message) {
    this.sequence += 1;
    return this.send({ job, ...message, sequence: this.sequence, challenge: this.newest.get(job)?.value });
  }
}
