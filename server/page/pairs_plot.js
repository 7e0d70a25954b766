// Plots the complementarity pairs, s against t. They approach the axes as κ falls.

import { fill, make, onceAFrame, styleValue } from "./dom.js";
import { real, residual, whole } from "./format.js";

const LEAST = 1e-12; // the smallest value on the log axes

/** Counts the pairs of a frame by their active side. */
export function countPairs({ s, t }, tolerance) {
  const counts = { left: 0, right: 0, both: 0, open: 0, violated: 0, worst: 0 };
  for (let pair = 0; pair < s.length; ++pair) {
    const least = Math.min(s[pair], t[pair]);
    counts.worst = Math.max(counts.worst, Math.abs(least));
    ++counts[sideOf(s[pair], t[pair], tolerance)];
  }
  return counts;
}

function sideOf(s, t, tolerance) {
  if (Math.min(s, t) < -tolerance) return "violated";
  const left = s <= tolerance;
  const right = t <= tolerance;
  return left && right ? "both" : left ? "left" : right ? "right" : "open";
}

const LOOKS = {
  left: { colour: "--blue", shape: "circle", words: "s = 0" },
  right: { colour: "--orange", shape: "square", words: "t = 0" },
  both: { colour: "--purple", shape: "diamond", words: "both 0" },
  open: { colour: "--quiet", shape: "ring", words: "neither yet" },
  violated: { colour: "--red", shape: "triangle", words: "below 0" },
};

const SHAPES = {
  circle: (path, x, y, r) => path.arc(x, y, r, 0, 2 * Math.PI),
  ring: (path, x, y, r) => path.arc(x, y, r, 0, 2 * Math.PI),
  square: (path, x, y, r) => path.rect(x - r, y - r, 2 * r, 2 * r),
  diamond: (path, x, y, r) => polygon(path, [[x, y - 1.4 * r], [x + 1.4 * r, y], [x, y + 1.4 * r], [x - 1.4 * r, y]]),
  triangle: (path, x, y, r) => polygon(path, [[x - 1.3 * r, y + r], [x + 1.3 * r, y + r], [x, y - 1.3 * r]]),
};

function polygon(path, corners) {
  corners.forEach(([x, y], at) => (at === 0 ? path.moveTo(x, y) : path.lineTo(x, y)));
  path.closePath();
}

export class PairsPlot {
  #note = "";
  #pairs = 0; // of the problem; a frame has all or an even sample
  #frames = [];
  #chosen = null; // iteration; null for the newest
  #tolerance = 1e-6;
  #logarithmic = true;
  #hover = null;

  constructor(parent) {
    this.canvas = make("canvas", { role: "img", id: "pairs-plot" });
    this.slider = make("input", { type: "range", min: "0", max: "0", value: "0", id: "pairs-slider", "aria-label": "Iteration of the plot" });
    this.scale = make("button", { type: "button", class: "chip", "aria-pressed": "true" }, "log scale");
    this.live = make("button", { type: "button", class: "chip", "aria-pressed": "true" }, "newest");
    this.caption = make("p", { class: "note", id: "pairs-caption" });
    this.key = make("ul", { class: "key" }, ...Object.entries(LOOKS).map(([side, { words }]) => make("li", { "data-side": side }, this.#sample(side), make("span", {}, words))));
    parent.append(make("div", { class: "chart square" }, this.canvas), make("div", { class: "row slider" }, this.slider, this.live, this.scale), this.caption, this.key);
    this.redraw = onceAFrame(() => this.#draw());
    this.recolour = () => this.redraw();
    document.addEventListener("themechange", this.recolour);
    this.observer = new ResizeObserver(() => this.redraw());
    this.observer.observe(this.canvas);
    this.slider.addEventListener("input", () => this.#choose(Number(this.slider.value)));
    this.live.addEventListener("click", () => this.#choose(this.#frames.length - 1));
    this.scale.addEventListener("click", () => {
      this.#logarithmic = !this.#logarithmic;
      this.scale.setAttribute("aria-pressed", String(this.#logarithmic));
      this.redraw();
    });
    this.canvas.addEventListener("pointermove", (event) => this.#point({ x: event.offsetX, y: event.offsetY }));
    this.canvas.addEventListener("pointerleave", () => this.#point(null));
  }

  #sample(side) {
    return make("canvas", { width: "28", height: "28", "data-sample": side, "aria-hidden": "true" });
  }

  /** `pairs` is the number of pairs of the problem; `note` is appended to the caption of the newest frame. */
  show(frames, pairs, tolerance, note = "") {
    this.#frames = frames;
    this.#pairs = pairs;
    this.#note = note;
    this.#tolerance = tolerance;
    this.redraw();
  }
  destroy() {
    document.removeEventListener("themechange", this.recolour);
    this.observer.disconnect();
    this.redraw.cancel();
  }

  #choose(at) {
    this.#chosen = at >= this.#frames.length - 1 ? null : this.#frames[at].iteration;
    this.redraw();
  }
  #point(where) {
    this.#hover = where;
    this.redraw();
  }

  // The chosen frame, or the first one after it.
  #at() {
    const last = this.#frames.length - 1;
    if (this.#chosen === null) return last;
    const later = this.#frames.findIndex((frame) => frame.iteration >= this.#chosen);
    return later < 0 ? last : later;
  }

  #draw() {
    const at = this.#at();
    const frame = this.#frames[at];
    this.slider.max = Math.max(0, this.#frames.length - 1);
    this.slider.value = at;
    this.slider.disabled = this.#frames.length < 2;
    this.live.setAttribute("aria-pressed", String(this.#chosen === null));
    if (!frame || this.canvas.clientWidth === 0) return;
    this.slider.setAttribute("aria-valuetext", `iteration ${frame.iteration}`);
    this.#describe(frame);
    const context = this.#prepare();
    this.#axes(context);
    this.#hyperbola(context, frame.kappa);
    const near = this.#points(context, frame);
    if (near !== null) this.#label(context, near, frame);
  }

  #describe(frame) {
    const counts = countPairs(frame, this.#tolerance);
    const parts = Object.entries(LOOKS).filter(([side]) => counts[side] > 0).map(([side, { words }]) => `${whole(counts[side])} ${words}`);
    const kappa = frame.kappa > 0 ? `κ = ${residual(frame.kappa)}` : "local search";
    const shown = frame.s.length;
    const sample = shown < this.#pairs ? ` ${whole(shown)} of ${whole(this.#pairs)} pairs are shown, evenly sampled.` : "";
    const text = `Iteration ${frame.iteration}, ${kappa}: ${parts.join(", ")}; largest |min(s, t)| ${residual(counts.worst)}.${sample}`;
    fill(this.caption, frame === this.#frames.at(-1) ? `${text} ${this.#note}` : text);
    this.canvas.setAttribute("aria-label", `${frame.s.length} complementarity pairs, s against t. ${text}`);
    this.canvas.dataset.points = frame.s.length;
    this.canvas.dataset.iteration = frame.iteration;
    for (const item of this.key.children) item.classList.toggle("absent", counts[item.dataset.side] === 0);
    this.#drawKey();
  }

  #drawKey() {
    for (const sample of this.key.querySelectorAll("canvas")) {
      const context = sample.getContext("2d");
      context.clearRect(0, 0, 28, 28);
      this.#mark(context, sample.dataset.sample, 14, 14, 8);
    }
  }

  #prepare() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.unit = size;
    context.font = `${0.8 * size}px ${getComputedStyle(document.body).fontFamily}`;
    this.box = { left: 3.6 * size, top: 0.8 * size, right: width - 0.8 * size, bottom: height - 2.8 * size };
    this.range = this.#range();
    return context;
  }

  // The same axes for all frames, so that the slider moves only the points.
  #range() {
    let most = 1e-3;
    let least = 1;
    for (const { s, t, kappa } of this.#frames) {
      for (const side of [s, t]) {
        for (const value of side) {
          if (value > most) most = value;
          if (value > 0 && value < least) least = value;
        }
      }
      if (kappa > 0) least = Math.min(least, kappa);
    }
    if (!this.#logarithmic) return { low: -0.06 * most, high: 1.05 * most };
    const low = Math.max(Math.log10(LEAST), Math.floor(Math.log10(least)));
    return { low: Math.min(low, -3), high: Math.ceil(Math.log10(most) + 0.1) };
  }

  #scaled(value) {
    if (!this.#logarithmic) return value;
    return value > 0 ? Math.max(this.range.low, Math.log10(value)) : this.range.low;
  }
  #x(value) {
    const { low, high } = this.range;
    return this.box.left + ((this.#scaled(value) - low) / (high - low)) * (this.box.right - this.box.left);
  }
  #y(value) {
    const { low, high } = this.range;
    return this.box.bottom - ((this.#scaled(value) - low) / (high - low)) * (this.box.bottom - this.box.top);
  }

  // Values at which the axes are labelled.
  #ticks() {
    const { low, high } = this.range;
    if (this.#logarithmic) {
      const every = Math.max(1, Math.ceil((high - low) / 6));
      const ticks = [];
      for (let power = low; power <= high; power += every) ticks.push([10 ** power, power === low ? "≈ 0" : `1e${power}`]);
      return ticks;
    }
    const power = 10 ** Math.floor(Math.log10(high / 4));
    const step = [1, 2, 5, 10].map((factor) => factor * power).find((size) => high / size <= 5);
    return Array.from({ length: Math.floor(high / step) + 1 }, (_, at) => [at * step, real(at * step)]);
  }

  #axes(context) {
    const { left, top, right, bottom } = this.box;
    context.strokeStyle = styleValue("--line");
    context.fillStyle = styleValue("--quiet");
    context.lineWidth = 1;
    for (const [value, text] of this.#ticks()) {
      const x = this.#x(value);
      const y = this.#y(value);
      context.beginPath();
      context.moveTo(x, top);
      context.lineTo(x, bottom);
      context.moveTo(left, y);
      context.lineTo(right, y);
      context.stroke();
      context.textAlign = "center";
      context.fillText(text, x, bottom + 1.1 * this.unit);
      context.textAlign = "right";
      context.fillText(text, left - 0.4 * this.unit, y + 0.28 * this.unit);
    }
    context.textAlign = "right";
    context.fillText("s = L z + l", right, bottom + 2.3 * this.unit);
    context.save();
    context.translate(0.9 * this.unit, top);
    context.rotate(-Math.PI / 2);
    context.fillText("t = R z + r", 0, 0);
    context.restore();
  }

  #hyperbola(context, kappa) {
    if (!(kappa > 0)) return;
    const { left, top, right, bottom } = this.box;
    const { low, high } = this.range;
    context.save();
    context.beginPath();
    context.rect(left, top, right - left, bottom - top);
    context.clip();
    context.strokeStyle = styleValue("--quiet");
    context.setLineDash([5, 4]);
    context.beginPath();
    for (let step = 1; step <= 200; ++step) {
      const s = this.#logarithmic ? 10 ** (low + ((high - low) * step) / 200) : (high * step) / 200;
      const t = kappa / s;
      if (this.#logarithmic && Math.log10(t) < low) break;
      context.lineTo(this.#x(s), this.#y(t));
    }
    context.stroke();
    context.restore();
  }

  #mark(context, side, x, y, radius) {
    const { colour, shape } = LOOKS[side];
    context.beginPath();
    SHAPES[shape](context, x, y, radius);
    context.strokeStyle = context.fillStyle = styleValue(colour);
    context.lineWidth = radius / 3;
    context.globalAlpha = 0.55;
    if (shape !== "ring") context.fill();
    context.globalAlpha = 1;
    context.stroke();
  }

  // Draws the pairs; returns the one nearest to the pointer, or null.
  #points(context, { s, t }) {
    let near = null;
    let nearest = (1.2 * this.unit) ** 2;
    for (let pair = 0; pair < s.length; ++pair) {
      const x = this.#x(s[pair]);
      const y = this.#y(t[pair]);
      this.#mark(context, sideOf(s[pair], t[pair], this.#tolerance), x, y, 0.25 * this.unit);
      const distance = this.#hover === null ? Infinity : (x - this.#hover.x) ** 2 + (y - this.#hover.y) ** 2;
      if (distance < nearest) {
        nearest = distance;
        near = { pair, x, y };
      }
    }
    return near;
  }

  #label(context, { pair, x, y }, { s, t }) {
    const number = s.length < this.#pairs ? Math.floor((pair * this.#pairs) / s.length) : pair;
    const text = `pair ${number}: s = ${residual(s[pair])}, t = ${residual(t[pair])}`;
    const width = context.measureText(text).width + this.unit;
    const left = Math.min(Math.max(this.box.left, x - width / 2), this.box.right - width);
    const top = y > this.box.top + 3 * this.unit ? y - 2.4 * this.unit : y + this.unit;
    context.fillStyle = styleValue("--ink");
    context.fillRect(left, top, width, 1.6 * this.unit);
    context.fillStyle = styleValue("--surface");
    context.textAlign = "left";
    context.fillText(text, left + this.unit / 2, top + 1.08 * this.unit);
  }
}
