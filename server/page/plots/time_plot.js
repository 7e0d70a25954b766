// A small plot of one quantity over the last minutes: an area on a canvas, redrawn when there is something new.

import { make, fill, styleValue } from "../base/dom.js";
import { whole } from "../base/format.js";
import { SPAN_S } from "../data/history.js";

// The smallest of 1, 2, 5 times a power of ten that is not below the value.
function roundUp(value) {
  if (!(value > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value * 0.9999);
}

export class TimePlot {
  #points = []; // [seconds before now, value], oldest first
  #hover = null;

  /** `words` names the quantity, `text` a value of it, `most` the top of the axis if it is fixed. */
  constructor(parent, { words, text, colour, most = null }) {
    this.words = words;
    this.text = text;
    this.colour = colour;
    this.most = most;
    this.top = make("span", { class: "axis-top", "aria-hidden": "true" });
    this.readout = make("span", { class: "axis-now", "aria-hidden": "true" }, "last 5 min");
    this.canvas = make("canvas", { role: "img", "aria-label": words });
    parent.append(this.canvas, this.top, this.readout);
    this.canvas.addEventListener("pointermove", (event) => this.#point(event.offsetX));
    this.canvas.addEventListener("pointerleave", () => this.#point(null));
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    document.addEventListener("themechange", () => this.draw());
  }

  /** `value(index)` of `history`'s points. */
  show(history, value) {
    const last = history.length - 1;
    this.#points.length = 0;
    if (last >= 0) {
      const now = history.value("time", last);
      const width = Math.max(1, this.canvas.clientWidth);
      const step_s = SPAN_S / width; // one point a pixel is enough
      let drawn = Infinity;
      for (let index = 0; index <= last; ++index) {
        const before = now - history.value("time", index);
        if (before > SPAN_S || (drawn - before < step_s && index < last)) continue;
        const at = value(index);
        if (Number.isFinite(at)) this.#points.push([(drawn = before), at]);
      }
    }
    this.#describe();
    this.draw();
  }

  #describe() {
    const values = this.#points.map((point) => point[1]);
    const most = Math.max(0, ...values);
    this.scale = this.most?.() ?? roundUp(most);
    fill(this.top, Number.isInteger(this.scale) ? whole(this.scale) : this.text(this.scale));
    const now = values.length > 0 ? this.text(values.at(-1)) : "unknown";
    this.canvas.setAttribute("aria-label", `${this.words} over the last 5 minutes: now ${now}, at most ${this.text(most)}`);
    this.canvas.dataset.points = values.length;
  }

  #point(x) {
    const before = x === null ? null : SPAN_S * (1 - x / this.canvas.clientWidth);
    const distance = (point) => Math.abs(point[0] - before);
    this.#hover = before === null || this.#points.length === 0
      ? null
      : this.#points.reduce((best, point) => (distance(point) < distance(best) ? point : best));
    fill(this.readout, this.#hover === null ? "last 5 min" : `${this.text(this.#hover[1])}, ${Math.round(this.#hover[0])} s ago`);
    this.draw();
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0) return;
    const ratio = devicePixelRatio;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    const context = this.canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.strokeStyle = styleValue("--line");
    context.lineWidth = 1;
    for (const y of [0.5, Math.round(height / 2) + 0.5, height - 0.5]) {
      context.beginPath();
      context.moveTo(0, y);
      context.lineTo(width, y);
      context.stroke();
    }
    if (this.#points.length > 0) this.#area(context, width, height);
  }

  #area(context, width, height) {
    const place = ([before, value]) => [width * (1 - before / SPAN_S), 1 + (height - 2) * (1 - Math.min(1, value / this.scale))];
    const line = new Path2D();
    let previous = null;
    const areas = new Path2D();
    for (const point of this.#points) {
      const [x, y] = place(point);
      const gap = previous === null || previous.before - point[0] > 5; // nothing was heard for so long
      if (gap) {
        if (previous !== null) areas.lineTo(previous.x, height);
        line.moveTo(x, y);
        areas.moveTo(x, height);
      } else {
        line.lineTo(x, y);
      }
      areas.lineTo(x, y);
      previous = { x, before: point[0] };
    }
    areas.lineTo(previous.x, height);
    const colour = styleValue(this.colour);
    context.fillStyle = colour;
    context.globalAlpha = 0.16;
    context.fill(areas);
    context.globalAlpha = 1;
    context.strokeStyle = colour;
    context.lineWidth = 1.5;
    context.stroke(line);
    if (this.#hover !== null) {
      const [x, y] = place(this.#hover);
      context.fillStyle = colour;
      context.beginPath();
      context.arc(x, y, 3, 0, 2 * Math.PI);
      context.fill();
    }
  }
}
