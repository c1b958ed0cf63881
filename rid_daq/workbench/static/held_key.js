// A key that the user holds on this page. While the key is held, the page answers each challenge of the service at
// once. From the answered challenge, the service knows how old an answer is. After a gap in the challenges the press no
// longer counts, and the user must press the key again.
const LIMIT_MS = 300; // CHALLENGE_LIMIT_S of acquisition/hold_to_run/held_key.py
const WATCH_MS = 50;

export class HeldKey {
  // `send(message)` adds the operator's lease to a message and sends it; it returns false without a connection or a
  // lease. `tell(job, text)` shows the reason why a held key does not count.
  /** @param {(message: KeyMessage) => boolean} send @param {(job: string, text: string) => void} tell */
  constructor(send, tell) {
    this.send = send;
    this.tell = tell;
    this.sequence = 0;
    /** @type {Map<string, { value: string, at: number }>} */
    this.newest = new Map(); // for each job: the newest challenge and the time at which it arrived
    /** @type {{ job: string, key: string, counts: boolean, from: number } | null} */
    this.press = null; // { job, key, counts, from }: `counts` becomes false after a gap in the challenges
    this.timer = undefined;
  }

  /** @type {(job: string, key: string) => void} */
  hold(job, key) {
    this.letGo();
    this.press = { job, key, counts: true, from: performance.now() };
    this.timer = setInterval(() => this.watch(), WATCH_MS);
    const released = this.say(job, { held: "" }); // a press counts only after a message that the key was released
    if (!released) this.end("the service does not answer");
    else if (this.age(job) < LIMIT_MS) this.answer();
  }

  letGo() {
    clearInterval(this.timer);
    if (this.press) this.say(this.press.job, { held: "" });
    this.press = null;
  }

  /** @type {(job: string, key: string) => void} */
  tap(job, key) {
    this.say(job, { tapped: key });
  }

  /** @type {(challenge: { job: string, value: string }) => void} */
  challenge({ job, value }) {
    this.watch(); // detects a gap between the previous challenge and this one
    this.newest.set(job, { value, at: performance.now() });
    if (this.press?.job === job) this.answer();
  }

  // The connection has ended: challenges from it are not valid on the next connection.
  cut() {
    this.newest.clear();
    this.end("the connection has ended");
  }

  /** @type {(job: string) => number} */
  age(job) {
    const newest = this.newest.get(job);
    return newest ? performance.now() - newest.at : Infinity;
  }

  watch() {
    if (!this.press) return;
    const silent = Math.min(this.age(this.press.job), performance.now() - this.press.from);
    if (silent >= LIMIT_MS) this.end(`link too slow: no message for ${Math.round(silent)} ms`);
  }

  /** @type {(why: string) => void} */
  end(why) {
    if (!this.press?.counts) return;
    this.press.counts = false;
    this.tell(this.press.job, `${why}: the key does not count; release it and press it again`);
  }

  answer() {
    if (this.press?.counts) this.say(this.press.job, { held: this.press.key });
  }

  /** @type {(job: string, message: { held?: string, tapped?: string }) => boolean} */
  say(job, message) {
    this.sequence += 1;
    return this.send({ job, ...message, sequence: this.sequence, challenge: this.newest.get(job)?.value });
  }
}
