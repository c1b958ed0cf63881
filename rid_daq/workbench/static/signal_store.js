// The live signals that this page has received: minima and maxima of short intervals ("bins"), in memory of constant size.
/** @typedef {{ places: number[], isAfterGap: boolean }[]} Columns */
export const MOST_BINS = 12000; // ten minutes of motion, as many as the service keeps

export class SignalStore {
  key = "";
  newest = -1; // number of the newest bin; numbers count from the beginning of the data
  /** @type {string[]} */
  joints = [];
  /** @type {Map<string, number>} */
  rows = new Map();
  numbers = new Float64Array(MOST_BINS); // number of the bin that is stored in each place
  times = new Float64Array(MOST_BINS);
  /** @type {Float32Array[]} */
  values = [];

  constructor() {
    this.begin({ key: "", joints: [], lanes: [], cell_lanes: [] });
  }

  /** @type {(head: Pick<SignalsHead, "key" | "joints" | "lanes" | "cell_lanes">) => void} */
  begin({ key, joints, lanes, cell_lanes: cellLanes }) {
    this.key = key;
    this.joints = joints;
    this.rows = new Map(["after_gap", ...cellLanes].map((name, i) => [name, i]));
    lanes.forEach((name, i) => this.rows.set(name, 1 + cellLanes.length + i * joints.length));
    const count = 1 + cellLanes.length + lanes.length * joints.length;
    this.newest = -1;
    this.numbers.fill(-1);
    this.values = Array.from({ length: count }, () => new Float32Array(MOST_BINS));
  }

  // Add a message of the service (rid_daq/service/signals/signal_view.py); return its head.
  // `isNew` is true if it contains bins that are newer than all others.
  /** @type {(buffer: ArrayBuffer) => SignalsHead & { isNew: boolean }} */
  add(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    /** @type {SignalsHead} */
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    if (head.key !== this.key) this.begin(head);
    const { first, count } = head;
    const times = new Float64Array(buffer, 4 + length, count);
    const rows = new Float32Array(buffer, 4 + length + times.byteLength);
    const isNew = first + count - 1 > this.newest;
    this.newest = Math.max(this.newest, first + count - 1);
    for (let i = 0; i < count; i += 1) {
      if (first + i <= this.newest - MOST_BINS) continue;
      const place = (first + i) % MOST_BINS;
      this.numbers[place] = first + i;
      this.times[place] = times[i];
      for (let row = 0; row < this.values.length; row += 1) this.values[row][place] = rows[row * count + i];
    }
    return { ...head, isNew };
  }

  // Return the position in the data from which the service continues after a lost connection.
  known() {
    return this.newest < 0 ? {} : { key: this.key, known: this.newest + 1 };
  }

  /** @type {(number: number) => boolean} */
  has(number) {
    return number >= 0 && this.numbers[number % MOST_BINS] === number;
  }

  // Time of the newest bin [s]; null if there is no bin.
  get newestTime() {
    return this.newest < 0 ? null : this.times[this.newest % MOST_BINS];
  }

  // Time of the oldest stored bin [s]; null if there is no bin.
  get oldestTime() {
    for (let number = Math.max(0, this.newest - MOST_BINS + 1); number <= this.newest; number += 1)
      if (this.has(number)) return this.times[number % MOST_BINS];
    return null;
  }

  // Group the bins of a time range into about `most` columns: at most `most` + 1, and more if there are gaps. A column is { places,
  // isAfterGap }; no column spans a gap.
  /** @type {(from: number, to: number, most: number) => Columns} */
  columns(from, to, most) {
    const shown = [];
    for (let number = Math.max(0, this.newest - MOST_BINS + 1); number <= this.newest; number += 1) {
      const place = number % MOST_BINS;
      if (this.has(number) && this.times[place] >= from && this.times[place] <= to) shown.push(number);
    }
    const group = Math.max(1, Math.ceil(shown.length / most));
    /** @type {Columns} */
    const found = [];
    let before = NaN;
    for (const number of shown) {
      const place = number % MOST_BINS;
      const isAfterGap = number !== before + 1 || this.values[0][place] !== 0;
      if (isAfterGap || Math.floor(number / group) !== Math.floor(before / group)) found.push({ places: [], isAfterGap });
      found[found.length - 1].places.push(place);
      before = number;
    }
    return found;
  }

  // Return the index of the bin that is nearest to `time` [s]; null if no bin is at most `within` [s] away.
  /** @type {(time: number, within: number) => number | null} */
  placeAt(time, within) {
    let found = null;
    let distance = within;
    for (let place = 0; place < MOST_BINS; place += 1) {
      const away = Math.abs(this.times[place] - time);
      if (this.numbers[place] >= 0 && away <= distance) [found, distance] = [place, away];
    }
    return found;
  }

  // Return one value of a bin: a value of the cell, or of the joint with the given index.
  /** @type {(lane: string, place: number, joint?: number) => number} */
  value(lane, place, joint = 0) {
    return this.values[(this.rows.get(lane) ?? NaN) + joint]?.[place] ?? NaN;
  }
}

// Return the times at which a chart has points: two for each column, and one more for each gap.
/** @type {(store: SignalStore, columns: Columns) => number[]} */
export function timesOf(store, columns) {
  /** @type {number[]} */
  const times = [];
  for (const { places, isAfterGap } of columns) {
    const time = store.times[places[places.length >> 1]];
    if (isAfterGap && times.length > 0) times.push((times[times.length - 1] + time) / 2);
    times.push(time, time);
  }
  return times;
}

// Return the values at the times of `timesOf`: minimum and maximum of each column; null in gaps and for missing values.
/** @type {(columns: Columns, low: Float32Array, high: Float32Array, factor: number) => (number | null)[]} */
export function valuesOf(columns, low, high, factor) {
  /** @type {(number | null)[]} */
  const found = [];
  let before = NaN;
  for (const { places, isAfterGap } of columns) {
    if (isAfterGap && found.length > 0) found.push(null);
    let [least, most] = [Infinity, -Infinity];
    for (const place of places) {
      if (low[place] < least) least = low[place];
      if (high[place] > most) most = high[place];
    }
    if (least === Infinity) {
      found.push(null, null);
      continue;
    }
    const isFalling = least + most < before; // draw the maximum of this column before its minimum
    before = least + most;
    if (isFalling) found.push(factor * most, factor * least);
    else found.push(factor * least, factor * most);
  }
  return found;
}
