// A small plot of one or a few quantities over the last minutes, on a canvas. A single one is an area.

import { make, fill, styleValue } from "./dom.js";
import { whole } from "./format.js";
import { SPAN_S } from "./history.js";

const MINUTES = SPAN_S / 60;
const NARROW = 190; // pixels: below it only the ends of the axis are labelled

// The smallest of 1, 2, 5 times a power of ten that is not below the value.
function roundUp(value) {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.9999);
}

export class TimePlot {
  #points = []; // of each curve: [seconds before now, value], oldest first
  #hover = null; // seconds before now

  /**
   * `words` is the name of the quantity, `text` formats a value, `most` is the upper limit of a fixed axis. `curves`:
   * colour, value(index) for the points of the history, and words if there are several.
   */
  constructor(parent, { words, text, curves, most = null, logarithmic = false }) {
    this.words = words;
    this.text = text;
    this.curves = curves;
    this.most = most;
    this.logarithmic = logarithmic;
    this.top = make("span", { class: "axis-top", "aria-hidden": "true" });
    this.bottom = make("span", { class: "axis-bottom", "aria-hidden": "true" });
    this.readout = make("span", { class: "axis-now", "aria-hidden": "true" });
    this.canvas = make("canvas", { role: "img", "aria-label": words });
    parent.append(this.canvas, this.top, this.bottom, this.readout);
    this.canvas.addEventListener("pointermove", (event) => this.#point(event.offsetX));
    this.canvas.addEventListener("pointerleave", () => this.#point(null));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    document.addEventListener("themechange", () => this.draw());
  }

  show(history) {
    this.#points = this.curves.map(({ value }) => this.#read(history, value));
    this.#describe();
    this.#showHover();
    this.draw();
  }

  // One point per pixel.
  #read(history, value) {
    const points = [];
    const last = history.length - 1;
    if (last < 0) return points;
    const now = history.value("time", last);
    const step_s = SPAN_S / Math.max(1, this.canvas.clientWidth);
    let drawn = Infinity;
    for (let index = 0; index <= last; ++index) {
      const before = now - history.value("time", index);
      if (before > SPAN_S || (drawn - before < step_s && index < last)) continue;
      const at = value(index);
      if (Number.isFinite(at)) points.push([(drawn = before), at]);
    }
    return points;
  }

  #describe() {
    const values = this.#points.flat().map((point) => point[1]);
    const most = Math.max(0, ...values);
    if (this.logarithmic) {
      const least = Math.min(...values.filter((value) => value > 0), most > 0 ? most : 1e-3);
      this.low = Math.floor(Math.log10(least) + 0.01);
      this.high = Math.max(this.low + 1, Math.ceil(Math.log10(most > 0 ? most : 1e-3) - 0.01));
    } else {
      this.low = 0;
      this.high = this.most?.() ?? roundUp(most);
    }
    const limit = (value) => (Number.isInteger(value) ? whole(value) : this.text(value));
    const power = (exponent) => (most > 0 ? this.text(10 ** exponent).replace(/\.0+(?= )/, "") : "");
    fill(this.top, this.logarithmic ? power(this.high) : limit(this.high));
    fill(this.bottom, this.logarithmic ? power(this.low) : "");
    const now = this.#points.map((points, at) => `${this.curves[at].words ?? ""} ${points.at(-1)?.[0] < 5 ? this.text(points.at(-1)[1]) : "unknown"}`.trim());
    this.canvas.setAttribute("aria-label", `${this.words} over the last 5 minutes: now ${now.join(", ")}, at most ${this.text(most)}`);
    this.canvas.dataset.points = this.#points[0].length;
    this.canvas.dataset.since = Math.floor(this.#points[0][0]?.[0] ?? 0);
  }

  #point(x) {
    this.#hover = x === null ? null : SPAN_S * (1 - x / this.canvas.clientWidth);
    this.#showHover();
    this.draw();
  }

  // The point of a curve nearest to the pointer; null without points.
  #near(points) {
    if (this.#hover === null || points.length === 0) return null;
    const distance = (point) => Math.abs(point[0] - this.#hover);
    return points.reduce((best, point) => (distance(point) < distance(best) ? point : best));
  }

  #showHover() {
    const near = this.#points.map((points) => this.#near(points));
    const seconds = near.find((point) => point !== null)?.[0];
    const values = near.map((point, at) => (point === null ? null : `${this.curves[at].words ?? ""} ${this.text(point[1])}`.trim())).filter((text) => text !== null);
    if (seconds === undefined) fill(this.readout, "");
    else fill(this.readout, `${values.join(", ")}, ${Math.round(seconds)} s ago`);
  }

  draw() {
    const { clientWidth: width, clientHeight } = this.canvas;
    if (width === 0) return;
    const ratio = devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(clientHeight * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    const size = parseFloat(getComputedStyle(document.documentElement).fontSize);
    const height = clientHeight - 1.1 * size; // below it is the axis
    this.bottom.style.bottom = `${1.1 * size + 3}px`;
    this.#axis(context, width, height, size);
    this.#points.forEach((points, at) => points.length > 0 && this.#curve(context, points, this.curves[at].colour, width, height));
  }

  #axis(context, width, height, size) {
    context.strokeStyle = styleValue("--line");
    context.fillStyle = styleValue("--quiet");
    context.lineWidth = 1;
    context.font = `${0.72 * size}px ${getComputedStyle(document.body).fontFamily}`;
    context.beginPath();
    for (const y of [0.5, Math.round(height / 2) + 0.5, Math.round(height) - 0.5]) {
      context.moveTo(0, y);
      context.lineTo(width, y);
    }
    for (let minute = 0; minute <= MINUTES; ++minute) {
      const x = Math.min(width - 0.5, Math.max(0.5, width * (1 - minute / MINUTES)));
      context.moveTo(x, height - 4);
      context.lineTo(x, height);
      if (minute > 0 && minute < MINUTES && width < NARROW) continue;
      context.textAlign = minute === 0 ? "right" : minute === MINUTES ? "left" : "center";
      context.fillText(minute === 0 ? "now" : minute < MINUTES ? `${minute}` : `${minute} min${width < NARROW ? " ago" : ""}`, x, height + 0.9 * size);
    }
    context.stroke();
  }

  #curve(context, points, colour, width, height) {
    const scaled = (value) => ((this.logarithmic ? Math.log10(Math.max(value, 1e-9)) : value) - this.low) / (this.high - this.low);
    const place = ([before, value]) => [width * (1 - before / SPAN_S), 1 + (height - 2) * (1 - Math.min(1, Math.max(0, scaled(value))))];
    const line = new Path2D();
    const areas = new Path2D();
    let previous = null;
    for (const point of points) {
      const [x, y] = place(point);
      const gap = previous === null || previous.before - point[0] > 5; // no data for so long
      if (gap) {
        if (previous !== null) areas.lineTo(previous.x, height);
        line.moveTo(x, y);
        line.lineTo(x + 0.5, y); // makes a single point visible
        areas.moveTo(x, height);
      } else {
        line.lineTo(x, y);
      }
      areas.lineTo(x, y);
      previous = { x, before: point[0] };
    }
    areas.lineTo(previous.x, height);
    context.fillStyle = context.strokeStyle = styleValue(colour);
    context.globalAlpha = 0.16;
    if (this.curves.length === 1) context.fill(areas);
    context.globalAlpha = 1;
    context.lineWidth = 1.5;
    context.lineCap = "round";
    context.stroke(line);
    const near = this.#near(points);
    if (near === null) return;
    context.beginPath();
    context.arc(...place(near), 3, 0, 2 * Math.PI);
    context.fill();
  }
}
