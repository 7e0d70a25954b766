// Levels of a problem with scenarios: the cost of the plan in its sample, and the interval of its out-of-sample cost.

import { make } from "../base/dom.js";
import { duration, real, whole } from "../base/format.js";

/** The position of each finite value in per cent, with room at the ends. */
export function scaleOf(levels) {
  const ends = levels.flatMap(({ objective, fresh }) => [objective, ...(fresh ? [fresh.mean - fresh.half_width, fresh.mean + fresh.half_width] : [])]);
  const known = ends.filter(Number.isFinite);
  const low = Math.min(...known);
  const span = Math.max(...known) - low || Math.max(1, Math.abs(low));
  return (value) => 4 + (92 * (value - low)) / span;
}

function interval({ objective, fresh, status }, place) {
  const line = make("div", { class: "interval", "aria-hidden": "true" });
  if (fresh && Number.isFinite(fresh.half_width)) {
    const bar = make("span", { class: "interval-bar" });
    bar.style.left = `${place(fresh.mean - fresh.half_width)}%`;
    bar.style.width = `${place(fresh.mean + fresh.half_width) - place(fresh.mean - fresh.half_width)}%`;
    line.append(bar);
  }
  if (status === "solved" || status === "almost_solved") {
    const dot = make("span", { class: "interval-value" });
    dot.style.left = `${place(objective)}%`;
    line.append(dot);
  }
  return line;
}

function freshCells(fresh) {
  if (!fresh) return ["", ""];
  const half = Number.isFinite(fresh.half_width) ? ` ± ${real(fresh.half_width)}` : "";
  return [`${real(fresh.mean)}${half}`, fresh.without_recourse > 0 ? `${whole(fresh.without_recourse)} of ${whole(fresh.scenarios)}` : "none"];
}

/** One row per level, with its interval as a bar and its cost as a mark. */
export function showLevels(place, levels) {
  const at = scaleOf(levels);
  const head = ["scenarios", "", "cost", "out of sample, 95 %", "without recourse", "factorizations", "time"];
  const rows = levels.map((level) => {
    const solved = level.status.startsWith("solved");
    const cells = [solved ? real(level.objective) : level.status.replaceAll("_", " "), ...freshCells(level.fresh), whole(level.factorizations), duration(level.seconds)];
    return make("tr", {}, make("th", { scope: "row" }, whole(level.scenarios)), make("td", { class: "interval-cell" }, interval(level, at)), ...cells.map((cell) => make("td", {}, cell)));
  });
  place.replaceChildren(
    make(
      "table",
      { class: "numbers" },
      make("caption", { class: "visually-hidden" }, "Levels of the problem with scenarios"),
      make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col" }, text)))),
      make("tbody", {}, ...rows),
    ),
  );
}
