// SPDX-License-Identifier: BSD-3-Clause
// Lines over time with a cursor; a click seeks, a click on a name hides its line.

const COLORS = ["#0b6e99", "#d1495b", "#3a9d5d", "#e08e1b", "#7b4ea3", "#2f4858", "#c85a9e", "#6b8e23",
  "#16a3a3", "#8c564b", "#5677c7", "#b0a030", "#444f5a"];

const short = (x) => {
  if (!isFinite(x)) return "–";
  const size = Math.abs(x);
  if (size !== 0 && (size < 1e-3 || size >= 1e4)) return x.toExponential(1).replace("e", "e");
  return x.toFixed(size < 1 ? 3 : size < 100 ? 2 : 0);
};

class Plot {
  // `seek(time)`; `rescale()` where a line went or came.
  constructor(parent, run, plot, seek, rescale) {
    this.run = run;
    this.plot = plot;
    this.lines = [...run.channels.values()]
      .filter((c) => c.kind === "number" && plot.channels.some((p) => c.name.startsWith(p)))
      .map((channel, i) => ({
        channel, color: COLORS[i % COLORS.length], on: true,
        // A plot of one group needs no group in its names.
        name: plot.channels.length === 1 ? channel.name.slice(plot.channels[0].lastIndexOf("/") + 1)
          : channel.name,
      }));
    if (!this.lines.length) return;
    const unit = plot.unit || this.lines[0].channel.unit;
    parent.insertAdjacentHTML("beforeend",
      `<section class="card plot"><h3></h3><canvas></canvas><ul></ul></section>`);
    const card = parent.lastElementChild;
    card.querySelector("h3").textContent = plot.title + " ";
    if (unit) {
      const small = document.createElement("small");
      small.textContent = unit;
      card.querySelector("h3").append(small);
    }
    this.canvas = card.querySelector("canvas");
    for (const line of this.lines) {
      const item = document.createElement("li");
      item.innerHTML = "<i></i><span></span><b></b>";
      item.firstChild.style.background = line.color;
      item.children[1].textContent = item.title = line.name;
      line.value = item.lastChild;
      item.onclick = () => {
        line.on = !line.on;
        item.classList.toggle("off", !line.on);
        rescale();
      };
      card.querySelector("ul").append(item);
    }
    const seekTo = (event) => {
      const share = (event.offsetX - LEFT) / (this.canvas.clientWidth - LEFT - RIGHT);
      seek(this.begin + Math.max(0, Math.min(1, share)) * (this.end - this.begin));
    };
    this.canvas.onpointerdown = seekTo;
    this.canvas.onpointermove = (event) => event.buttons && seekTo(event);
  }
  setRange(begin, end) {
    [this.begin, this.end] = [begin, Math.max(end, begin + 1e-3)];
    this.drawn = null;
  }
  y(value) { return this.plot.log ? Math.log10(Math.max(value, 1e-12)) : value; }

  // The scale that its lines need.
  needs() {
    if (this.plot.range) return this.plot.range;
    let least = Infinity, most = -Infinity;
    for (const line of this.lines) {
      if (!line.on) continue;
      for (const v of line.channel.columns[0]) {
        if (!isFinite(v)) continue;
        least = Math.min(least, this.y(v));
        most = Math.max(most, this.y(v));
      }
    }
    if (!(least <= most)) return [0, 1];
    if (this.plot.log) least = Math.max(least, most - 8);
    // What is nearly constant is drawn as a straight line, not as its rounding.
    const smallest = Math.max(1e-6, 1e-5 * Math.max(Math.abs(least), Math.abs(most)));
    const edge = most - least > smallest ? (most - least) * 0.05 : smallest;
    return [least - edge, most + edge];
  }
  // The lines, which the cursor is drawn over.
  draw() {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    const drawn = document.createElement("canvas");
    drawn.width = this.canvas.width = Math.max(1, width * ratio);
    drawn.height = this.canvas.height = Math.max(1, height * ratio);
    const g = drawn.getContext("2d");
    g.scale(ratio, ratio);
    const [least, most] = this.scale;
    const bottom = height - 16, top = 5;
    const x = (t) => LEFT + ((t - this.begin) / (this.end - this.begin)) * (width - LEFT - RIGHT);
    const y = (v) => bottom - ((v - least) / (most - least)) * (bottom - top);
    g.font = "10.5px sans-serif";
    g.fillStyle = "#5d6b7a";
    g.strokeStyle = "#e3e9ee";
    g.lineWidth = 1;
    g.textAlign = "right";
    const rule = (v, text) => {
      g.beginPath();
      g.moveTo(LEFT, y(v));
      g.lineTo(width - RIGHT, y(v));
      g.stroke();
      g.fillText(text, LEFT - 4, y(v) + 3.5);
    };
    if (this.plot.log) {
      const step = Math.max(1, Math.ceil((most - least) / 5));
      for (let e = Math.ceil(least); e <= most; e += step) rule(e, e === 0 ? "1" : `1e${e}`);
    } else {
      const step = nice((most - least) / 4);
      for (let k = Math.ceil(least / step); k * step <= most; ++k) {
        rule(k * step, String(+(k * step).toPrecision(6)));
      }
    }
    g.textAlign = "center";
    const step = nice((this.end - this.begin) / 7);
    for (let k = Math.ceil(this.begin / step); k * step <= this.end; ++k) {
      g.fillText(String(+(k * step).toPrecision(6)), x(k * step), height - 3);
    }
    for (const t of this.run.texts) { // phases begin
      if (t.topic !== "phase") continue;
      g.strokeStyle = "#c3cdd6";
      g.setLineDash([3, 3]);
      g.beginPath();
      g.moveTo(x(t.time), top);
      g.lineTo(x(t.time), bottom);
      g.stroke();
    }
    g.setLineDash([]);
    g.save();
    g.beginPath();
    g.rect(LEFT, top - 2, width - LEFT - RIGHT, bottom - top + 4);
    g.clip();
    g.lineWidth = 1.5;
    for (const line of this.lines) {
      if (!line.on) continue;
      g.strokeStyle = line.color;
      g.beginPath();
      let down = false;
      const values = line.channel.columns[0];
      for (let i = 0; i < this.run.times.length; ++i) {
        if (!isFinite(values[i])) {
          down = false;
          continue;
        }
        const px = x(this.run.times[i]), py = y(this.y(values[i]));
        if (down) g.lineTo(px, py);
        else g.moveTo(px, py);
        down = true;
      }
      g.stroke();
    }
    g.restore();
    this.drawn = drawn;
    this.ratio = ratio;
    this.x = x;
  }
  update(time) {
    if (!this.canvas) return;
    this.time = time;
    if (!this.drawn || this.width !== this.canvas.clientWidth) {
      this.width = this.canvas.clientWidth;
      this.draw();
    }
    const g = this.canvas.getContext("2d");
    g.setTransform(1, 0, 0, 1, 0, 0);
    g.clearRect(0, 0, this.canvas.width, this.canvas.height);
    g.drawImage(this.drawn, 0, 0);
    g.scale(this.ratio, this.ratio);
    g.strokeStyle = "#1c2733";
    g.lineWidth = 1;
    g.beginPath();
    g.moveTo(this.x(time), 3);
    g.lineTo(this.x(time), this.canvas.clientHeight - 14);
    g.stroke();
    for (const line of this.lines) line.value.textContent = short(this.run.number(line.channel, time));
  }
}
const LEFT = 40, RIGHT = 6; // of the frame around the lines, pixels

// 1, 2 or 5 times a power of ten.
function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  const share = step / power;
  return power * (share < 1.5 ? 1 : share < 3.5 ? 2 : share < 7.5 ? 5 : 10);
}
