// SPDX-License-Identifier: BSD-3-Clause
// The page: a column for each run that is shown, one time for all of them.

const page = JSON.parse(document.getElementById("data").textContent);
const runs = page.runs.map((json) => new Run(json));
const $ = (id) => document.getElementById(id);
Object.assign(orbit, { azimuth: page.azimuth, elevation: page.elevation });
let columns = []; // of the runs shown
let time = 0, playing = false, follow = Boolean(page.live);
const shown = new Set(page.shown.length ? page.shown : runs.slice(0, 2).map((run) => run.name));

const begin = () => Math.min(...columns.map((c) => c.run.begin), Infinity);
const end = () => Math.max(...columns.map((c) => c.run.end), -Infinity);

class Column {
  constructor(run) {
    this.run = run;
    $("columns").insertAdjacentHTML("beforeend", `<article class="run">
      <div class="card view"><div class="caption"><h2></h2><div class="phase"></div></div></div>
      <div class="card words"></div><div class="plots"></div></article>`);
    this.element = $("columns").lastElementChild;
    this.element.querySelector("h2").textContent = run.title || (runs.length > 1 ? run.name : "");
    this.phase = this.element.querySelector(".phase");
    this.words = this.element.querySelector(".words");
    this.view = new View(this.element.querySelector(".view"), run, page.zDown, () => {
      for (const c of columns) c.view.render();
    });
    this.plots = run.plots.map((p) => new Plot(this.element.querySelector(".plots"), run, p, seek, resize));
  }
  update() {
    this.view.update(time);
    for (const plot of this.plots) plot.update(time);
    const phase = this.run.text("phase", time);
    this.phase.textContent = phase ? phase.words : "";
    this.phase.hidden = !phase;
    const why = this.run.text("explanation", time);
    const events = this.run.texts.filter((t) => t.topic === "event" && t.time <= time + 1e-9).slice(-3);
    const key = `${why ? why.time : ""}|${events.map((e) => e.time).join()}|${events.length}`;
    this.words.hidden = !this.run.texts.some((t) => t.topic !== "phase") && !page.live;
    if (key === this.key) return;
    this.key = key;
    this.words.textContent = "";
    const add = (text, name) => {
      const line = document.createElement("div"), stamp = document.createElement("time");
      line.className = name;
      stamp.textContent = `${text.time.toFixed(2)} s`;
      line.append(stamp, text.words);
      this.words.append(line);
    };
    if (why) add(why, "why");
    for (const event of events.reverse()) add(event, "event");
  }
}

function build() {
  $("columns").textContent = "";
  for (const c of columns) if (c.view.renderer) c.view.renderer.dispose();
  columns = [];
  for (const run of runs) if (shown.has(run.name)) columns.push(new Column(run));
  $("columns").classList.toggle("single", columns.length === 1);
  resize();
}
function resize() {
  if (!columns.length) return;
  $("slider").min = begin();
  $("slider").max = end();
  const plots = columns.flatMap((c) => c.plots.filter((plot) => plot.canvas));
  for (const plot of plots) plot.setRange(begin(), end());
  // What has one title has one scale.
  for (const plot of plots) {
    const same = plots.filter((other) => other.plot.title === plot.plot.title).map((p) => p.needs());
    plot.scale = [Math.min(...same.map((s) => s[0])), Math.max(...same.map((s) => s[1]))];
  }
  marks();
  seek(Math.max(begin(), Math.min(end(), time)));
}
// Phases of the first run, above the slider.
function marks() {
  $("marks").textContent = "";
  const phases = columns[0].run.texts.filter((t) => t.topic === "phase");
  const share = (t) => (100 * (t - begin())) / Math.max(end() - begin(), 1e-9);
  phases.forEach((t, i) => {
    const mark = document.createElement("span");
    mark.textContent = mark.title = t.words;
    mark.style.left = `${share(t.time)}%`;
    mark.style.width = `${share(i + 1 < phases.length ? phases[i + 1].time : end()) - share(t.time)}%`;
    $("marks").append(mark);
  });
}
function seek(to) {
  time = to;
  $("slider").value = time;
  $("clock").textContent = `${time.toFixed(2)} s`;
  for (const c of columns) c.update();
}
function play(on) {
  if (on && time >= end() - 1e-6 && !page.live) seek(begin());
  playing = on;
  follow = on && Boolean(page.live);
  $("play").textContent = on ? "Pause" : "Play";
  if (on) requestAnimationFrame(tick);
}
let last = null;
function tick(now) {
  if (!playing) return (last = null);
  const step = last === null ? 0 : Math.min(0.1, (now - last) / 1000);
  last = now;
  if (!page.live) {
    seek(Math.min(end(), time + step * Number($("speed").value)));
    if (time >= end()) play(false);
  }
  requestAnimationFrame(tick);
}

$("title").textContent = document.title = page.title;
for (const run of runs) {
  if (runs.length < 2) break;
  const label = document.createElement("label"), box = document.createElement("input");
  box.type = "checkbox";
  box.checked = shown.has(run.name);
  box.onchange = () => {
    if (box.checked) shown.add(run.name);
    else shown.delete(run.name);
    build();
  };
  label.append(box, run.name);
  $("runs").append(label);
}
$("slider").oninput = () => {
  follow = false;
  seek(Number($("slider").value));
};
$("play").onclick = () => play(!playing);
window.onresize = resize;
window.onkeydown = (event) => {
  if (event.target.tagName === "INPUT" && event.target.type === "checkbox") return;
  if (event.key === " ") {
    event.preventDefault();
    play(!playing);
  }
};
build();

// From adapters/live.hpp.
function connect() {
  const socket = new WebSocket(`ws://${location.host}/`);
  socket.binaryType = "arraybuffer";
  const run = runs[0];
  let fresh = false, pause = 0;
  socket.onmessage = ({ data }) => {
    // How many frames, the frames, texts as JSON.
    const width = run.columns.length + 1, count = new Float64Array(data, 0, 1)[0];
    for (let i = 0; i < count; ++i) {
      const frame = new Float64Array(data, 8 * (1 + i * width), width);
      if (frame[0] < run.end) run.clear(); // the loop was started again
      run.append(frame, 20000);
    }
    const texts = new TextDecoder().decode(new Uint8Array(data, 8 * (1 + count * width)));
    for (const [at, topic, words] of JSON.parse(texts)) run.say(at, topic, words);
    if (fresh) return;
    fresh = true;
    // As often as this machine can draw: a third of its time, at most 20 times a second.
    setTimeout(() => {
      const start = performance.now();
      fresh = false;
      if (!orbit.set && columns[0].view.renderer) columns[0].view.frameAll(page.zDown);
      if (follow) time = run.end;
      resize();
      pause = Math.max(50, 2 * (performance.now() - start));
    }, pause);
  };
  socket.onclose = () => setTimeout(connect, 1000);
}
if (page.live) {
  play(true);
  connect();
}

// For tests and curious people.
window.replay = { runs, get time() { return time; }, get columns() { return columns; }, seek, orbit };
