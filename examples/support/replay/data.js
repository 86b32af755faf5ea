// SPDX-License-Identifier: BSD-3-Clause
// A run: its channels by name, their values at any time.

const WIDTH = { number: 1, point: 3, pose: 7 };
const NOT_SET = 65535; // of the 16 bits

// What the writer made of a column: null, one number for all samples, 32-bit floats, or
// [least, most, 16 bits].
function decode(column, count) {
  const values = new Float32Array(count);
  if (column === null) return values.fill(NaN);
  if (typeof column === "number") return values.fill(column);
  if (typeof column === "string") {
    const view = new DataView(Uint8Array.from(atob(column), (c) => c.charCodeAt(0)).buffer);
    for (let i = 0; i < count; ++i) values[i] = view.getFloat32(4 * i, true);
    return values;
  }
  const [least, most, text] = column;
  const bytes = atob(text);
  for (let i = 0; i < count; ++i) {
    const step = bytes.charCodeAt(2 * i) | (bytes.charCodeAt(2 * i + 1) << 8);
    values[i] = step === NOT_SET ? NaN : least + ((most - least) * step) / (NOT_SET - 1);
  }
  return values;
}

class Run {
  constructor(json) {
    this.name = json.name;
    this.title = json.title;
    this.shapes = json.shapes;
    this.plots = json.plots;
    this.times = json.times;
    this.texts = json.texts.map(([time, topic, words]) => ({ time, topic, words }));
    this.channels = new Map();
    this.columns = []; // of all channels, in the order of a live frame
    for (const { name, unit, kind } of json.channels) {
      const columns = [];
      for (let k = 0; k < WIDTH[kind]; ++k) {
        const packed = json.columns ? json.columns[this.columns.length] : null;
        columns.push(json.columns ? decode(packed, this.times.length) : []);
        this.columns.push(columns[k]);
      }
      this.channels.set(name, { name, unit, kind, columns });
    }
  }
  get begin() { return this.times.length ? this.times[0] : 0; }
  get end() { return this.times.length ? this.times[this.times.length - 1] : 0; }

  // The last sample at `time` or before, and how far it is to the next one.
  place(time) {
    let low = 0, high = this.times.length - 1;
    if (high < 0) return { index: -1, share: 0 };
    if (time <= this.times[0]) return { index: 0, share: 0 };
    if (time >= this.times[high]) return { index: high, share: 0 };
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) low = middle;
      else high = middle;
    }
    return { index: low, share: (time - this.times[low]) / (this.times[high] - this.times[low]) };
  }
  number(channel, time) {
    const { index } = this.place(time);
    return index < 0 ? NaN : channel.columns[0][index];
  }
  // {p: [x, y, z], q: [x, y, z, w]} of a point or pose; null where it was not set.
  pose(name, time) {
    const channel = this.channels.get(name);
    if (!channel || channel.kind === "number") return null;
    const { index, share } = this.place(time);
    if (index < 0) return null;
    const c = channel.columns;
    const next = share > 0 && !isNaN(c[0][index + 1]) ? index + 1 : index;
    if (isNaN(c[0][index])) return null;
    const mix = (k) => c[k][index] + share * (c[k][next] - c[k][index]);
    const p = [mix(0), mix(1), mix(2)];
    if (channel.kind === "point") return { p, q: [0, 0, 0, 1] };
    let dot = 0;
    for (let k = 3; k < 7; ++k) dot += c[k][index] * c[k][next];
    const sign = dot < 0 ? -1 : 1; // q and −q are one rotation
    const q = [3, 4, 5, 6].map((k) => (1 - share) * c[k][index] + share * sign * c[k][next]);
    const length = Math.hypot(...q) || 1;
    return { p, q: q.map((x) => x / length) };
  }
  // The last text of `topic` at `time` or before; null: none.
  text(topic, time) {
    let found = null;
    for (const t of this.texts) {
      if (t.topic === topic && t.time <= time + 1e-9 && (!found || t.time >= found.time)) found = t;
    }
    return found;
  }
  clear() {
    this.times.length = this.texts.length = 0;
    for (const column of this.columns) column.length = 0;
  }
  say(time, topic, words) {
    const last = this.text(topic, Infinity);
    if (topic !== "event" && last && last.words === words) return;
    this.texts.push({ time, topic, words });
    if (this.texts.length > 2000) this.texts.splice(0, 500);
  }
  // A live frame: the time, then every column.
  append(frame, most) {
    this.times.push(frame[0]);
    this.columns.forEach((column, k) => column.push(frame[k + 1]));
    if (this.times.length <= most) return;
    this.times.splice(0, most >> 2);
    for (const column of this.columns) column.splice(0, most >> 2);
  }
}
