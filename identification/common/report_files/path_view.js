// The path in space, the value along it and the line of the program: three views of one place, moved together.
"use strict";

const MISSING = -2147483648;
// From little to much, and from one sign to the other, on light and on dark ground.
const RAMPS = {
  size: { light: ["#1d3f8f", "#6a2fa0", "#b5307f", "#dd5a4a", "#f08f1c"], dark: ["#4f7be0", "#a06af0", "#e468b4", "#ff9076", "#ffd55e"] },
  signed: { light: ["#1b5fa8", "#5e8fc0", "#9aa3ab", "#cf7a68", "#b0281c"], dark: ["#5fb0ff", "#7fa8cc", "#79838c", "#d89a84", "#ff7f66"] },
};
const SHARES = [["good", "under 80 %"], ["warn", "80 to 100 %"], ["bad", "over the tolerance"]];

function rampColour(quantity, value, dark) {
  if (quantity.kind === "share") return colour(SHARES[value > 100 ? 2 : value > 80 ? 1 : 0][0]);
  const stops = RAMPS[quantity.kind][dark ? "dark" : "light"];
  const share = quantity.kind === "signed" ? 0.5 + 0.5 * value / quantity.limit : value / quantity.limit;
  const at = Math.min(Math.max(share, 0), 1) * (stops.length - 1), low = Math.min(Math.floor(at), stops.length - 2);
  return [stops[low], stops[low + 1], at - low];
}

class PathView {
  constructor(figure, data) {
    Object.assign(this, { figure, data, live: figure.querySelector(".live"), chosen: 0, at: data.start });
  }

  async start() {
    const stage = stageOf(this.figure, HINT), { data } = this;
    const [position, length, line, target, ...values] = await Promise.all([
      integers(data.position, 3), integers(data.length, 1), integers(data.line, 1), integers(data.target, 1),
      ...data.quantities.map(quantity => integers(quantity.values, 1))]);
    this.texts = JSON.parse(new TextDecoder().decode(await inflated(data.texts)));
    const count = this.count = line.length;
    this.line = line; this.target = target;
    this.place = Array.from({ length: count }, (_, i) => [0, 1, 2].map(
      c => position[c * count + i] === MISSING ? NaN : position[c * count + i] * data.step_mm));
    this.length = Array.from(length, value => value * data.step_mm);
    this.values = values.map((raw, q) => Array.from(raw, value => value === MISSING ? null : value * data.quantities[q].step));
    const all = Float32Array.from(this.place.flat());
    // What is cut fills the stage; the way there from home is seen by zooming out.
    const cut = this.place.filter((place, i) => this.values[0][i] !== null && Number.isFinite(place[0]));
    this.space = new SpaceView(stage, all, data.title, cut.length > 1 ? Float32Array.from(cut.flat()) : all);
    this.marks();
    this.controls();
    this.plot();
    this.choose(0);
    this.go(this.at);
    themeChanged.add(() => { this.plot(); this.choose(this.chosen); this.go(this.at); });
  }

  element(name) { return this.live.querySelector(`.${name}`); }

  marks() {
    const { space, data } = this;
    const known = data.marks.filter(mark => Number.isFinite(this.place[mark.index][0])), named = new Set();
    for (const [level, name] of [["note", "soft"], ["warning", "caution"], ["error", "bad"]]) {
      const some = known.filter(mark => mark.level === level);
      if (some.length) space.points(Float32Array.from(some.flatMap(mark => this.place[mark.index])), 9, name);
    }
    // The worst first: they stand nearest to their places.
    for (const level of ["error", "warning", "note"]) {
      let room = 12;
      for (const mark of known.filter(one => one.level === level)) {
        if (named.has(mark.line) || room === 0) continue;
        named.add(mark.line);
        room -= 1;
        space.tag(`${level === "note" ? "" : "! "}line ${mark.line}`, "mark").at.set(...this.place[mark.index]);
      }
    }
    this.halo = space.points(new Float32Array(3), 17, "ink");
    this.cursor = space.points(new Float32Array(3), 11, "page");
    this.halo.renderOrder = 3; this.cursor.renderOrder = 4;
  }

  controls() {
    const { data } = this, choices = this.element("choices");
    data.quantities.forEach((quantity, q) => {
      const label = document.createElement("label"), input = document.createElement("input");
      Object.assign(input, { type: "radio", name: `shown-${data.title}`, value: quantity.key, checked: q === 0 });
      input.addEventListener("change", () => this.choose(q));
      label.append(input, quantity.name);
      choices.append(label);
    });
    this.slider = this.element("place").querySelector("input[type=range]");
    this.slider.max = this.count - 1;
    this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
    this.number = this.element("place").querySelector("input[type=number]");
    Object.assign(this.number, { min: this.line.reduce((a, b) => Math.min(a, b)), max: this.line.reduce((a, b) => Math.max(a, b)) });
    this.number.addEventListener("change", () => {
      const wanted = Number(this.number.value);
      let best = 0;
      this.line.forEach((line, i) => { if (Math.abs(line - wanted) < Math.abs(this.line[best] - wanted)) best = i; });
      this.go(best);
    });
    this.element("largest").addEventListener("click", () => this.go(data.quantities[this.chosen].largest.index));
    // A short press on the picture goes to the nearest place of the path.
    let pressed = null;
    this.space.canvas.addEventListener("pointerdown", event => { pressed = [event.offsetX, event.offsetY]; });
    this.space.canvas.addEventListener("pointerup", event => {
      if (!pressed || Math.hypot(event.offsetX - pressed[0], event.offsetY - pressed[1]) > 4) return;
      let best = -1, least = 18;
      this.place.forEach((place, i) => {
        if (!Number.isFinite(place[0])) return;
        const [x, y] = this.space.onStage(...place), away = Math.hypot(x - event.offsetX, y - event.offsetY);
        if (away < least) [best, least] = [i, away];
      });
      if (best >= 0) this.go(best);
    });
    for (const button of document.querySelectorAll("button.show-place")) {
      const mark = data.marks.find(one => one.finding === Number(button.dataset.finding));
      if (!mark) { button.remove(); continue; }
      button.addEventListener("click", () => {
        this.go(mark.index);
        this.figure.scrollIntoView({ block: "start" });
        this.slider.focus({ preventScroll: true });
      });
    }
  }

  plot() {
    this.chart?.destroy();
    const holder = this.element("along"), axis = () => ({
      stroke: colour("soft"), grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("grid") }, size: 62,
      values: (_, all) => all.map(value => value === null ? "" : shown(value, Math.abs(value) < 10 && value % 1 ? 2 : value % 1 ? 1 : 0)) });
    this.chart = new uPlot({
      width: holder.clientWidth || 600, height: 210, legend: { show: false }, cursor: { y: false, drag: { x: true, y: false } },
      scales: { x: { time: false } },
      axes: [{ ...axis(), size: 46, label: "path length [mm]", labelSize: 20, space: 90 }, axis()],
      series: [{}, { stroke: colour("after"), width: 1.5, spanGaps: false,
        // A value alone between gaps makes no line.
        points: { show: true, size: 4, width: 0, fill: colour("after"), filter: () => this.lone } },
        { stroke: colour("bad"), width: 1, dash: [6, 4], points: { show: false } }],
      hooks: {
        draw: [chart => {
          const x = Math.round(chart.valToPos(this.length[this.at], "x", true)), { top, height } = chart.bbox;
          chart.ctx.fillStyle = colour("ink");
          chart.ctx.fillRect(x - 1, top, 2, height);
        }],
      },
    }, [[], [], []], holder);
    this.chart.over.addEventListener("click", () => { if (this.chart.cursor.idx !== null) this.go(this.chart.cursor.idx); });
    this.watch ??= new ResizeObserver(() => this.chart.setSize({ width: holder.clientWidth, height: 210 }));
    this.watch.observe(holder);
  }

  choose(q) {
    this.chosen = q;
    const quantity = this.data.quantities[q], values = this.values[q], { place, space } = this, dark = isDark(), known = new Map();
    const of = value => {
      const found = rampColour(quantity, value, dark);
      if (!Array.isArray(found)) {
        if (!known.has(found)) known.set(found, new THREE.Color(found));
        return known.get(found);
      }
      const [from, to, share] = found;
      for (const stop of [from, to]) if (!known.has(stop)) known.set(stop, new THREE.Color(stop));
      return new THREE.Color().lerpColors(known.get(from), known.get(to), share);
    };
    const ends = [], colours = [], air = [];
    for (let i = 1; i < this.count; i++) {
      const [a, b] = [place[i - 1], place[i]];
      if (!Number.isFinite(a[0]) || !Number.isFinite(b[0])) continue;
      if (values[i] === null) air.push(...a, ...b);
      else {
        const first = of(values[i - 1] ?? values[i]), second = of(values[i]);
        ends.push(...a, ...b); colours.push(first.r, first.g, first.b, second.r, second.g, second.b);
      }
    }
    for (const old of [this.cut, this.air]) if (old) {
      space.scene.remove(old); old.geometry.dispose(); old.material.dispose();
      space.materials = space.materials.filter(material => material !== old.material);
    }
    this.air = air.length ? space.lines(new Float32Array(air), null, 1, "muted") : null;
    this.cut = ends.length ? space.lines(new Float32Array(ends), new Float32Array(colours), 3.5) : null;
    // What is over the tolerance may be a single target on a long path: each stretch has a mark at its largest.
    const over = [];
    if (quantity.kind === "share") for (let i = 0, best = -1; i <= this.count; i++) {
      if (values[i] > 100) best = best < 0 || values[i] > values[best] ? i : best;
      else if (best >= 0) { if (Number.isFinite(place[best][0])) over.push(place[best]); best = -1; }
    }
    if (this.over) { space.scene.remove(this.over); this.over.geometry.dispose(); this.over.material.dispose(); }
    this.over = over.length ? space.points(Float32Array.from(over.flat()), 9, "bad") : null;
    space.resize();
    space.recolour();
    this.lone = values.flatMap((value, i) => value !== null && (values[i - 1] ?? null) === null && (values[i + 1] ?? null) === null ? [i] : []);
    this.chart.setData([this.length, values, values.map(() => quantity.tolerance ?? null)]);
    this.ramp(quantity, dark);
    this.live.querySelector(".along-words").textContent = `${quantity.name} [${quantity.unit}] along the path`;
    this.go(this.at);
  }

  ramp(quantity, dark) {
    const holder = this.element("ramp"), button = this.element("largest");
    holder.querySelectorAll("span, i").forEach(one => one.remove());
    const add = (words, style) => {
      const one = document.createElement(style ? "i" : "span");
      if (style) { one.className = "bar"; Object.assign(one.style, style); } else one.textContent = words;
      holder.insertBefore(one, button);
    };
    if (quantity.kind === "share") for (const [name, words] of SHARES) { add("", { background: colour(name), width: "22px" }); add(words); }
    else {
      const digits = quantity.digits, end = shown(quantity.limit, digits);
      add(quantity.kind === "signed" ? shown(-quantity.limit, digits) : "0");
      add("", { background: `linear-gradient(to right, ${RAMPS[quantity.kind][dark ? "dark" : "light"].join(", ")})` });
      add(`${end} ${quantity.unit}`);
    }
    add("grey: no force");
    const { largest } = quantity;
    button.hidden = !largest;
    if (largest) button.textContent = `Largest: ${shown(largest.value, quantity.digits)} ${quantity.unit}, line ${this.line[largest.index]}`;
    this.element("quantity-words").textContent = quantity.words;
  }

  go(i) {
    this.at = i;
    const { data } = this, place = this.place[i];
    this.slider.value = i;
    if (document.activeElement !== this.number) this.number.value = this.line[i];
    const quantities = data.quantities.map((quantity, q) => [quantity, this.values[q][i]]);
    const [quantity, value] = quantities[this.chosen];
    const said = value === null ? "no force" : `${shown(value, quantity.digits)} ${quantity.unit}`;
    this.slider.setAttribute("aria-valuetext", `line ${this.line[i]}, target ${this.target[i]}, ${quantity.name} ${said}`);
    const readout = this.element("readout");
    readout.querySelector("p").textContent = `Line ${this.line[i]}, target ${this.target[i]}, ${shown(this.length[i], 1)} mm along the path`;
    readout.querySelector("code").textContent = this.texts[i];
    readout.querySelector("dl").replaceChildren(...[
      ...quantities.map(([one, own]) => [one.name, own === null ? "\u2013" : `${shown(own, one.digits)} ${one.unit}`]),
      ["x y z", Number.isFinite(place[0]) ? `${place.map(one => shown(one, 2)).join("  ")} mm` : "not known"],
    ].map(([name, words]) => {
      const pair = document.createElement("div"), term = document.createElement("dt"), detail = document.createElement("dd");
      term.textContent = name; detail.textContent = words;
      pair.append(term, " ", detail);
      return pair;
    }));
    if (Number.isFinite(place[0])) {
      for (const mark of [this.halo, this.cursor])
        mark.geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(place), 3));
      this.space.draw();
    }
    this.chart.redraw(false);
  }
}

window.startPath = async (figure, data) => {
  const view = new PathView(figure, data);
  await view.start();
  figure.view = view;
};
