// Stages of a problem with scenarios: the cost of the plan in its sample, and the interval of its out-of-sample cost.

import { make } from "./dom.js";
import { duration, real, whole } from "./format.js";

/** The position of each finite value in per cent, with room at the ends. */
export function scaleOf(stages) {
  const ends = stages.flatMap(({ objective, out_of_sample: sample }) => [objective, ...(sample ? [sample.mean - sample.half_width, sample.mean + sample.half_width] : [])]);
  const known = ends.filter(Number.isFinite);
  const low = Math.min(...known);
  const span = Math.max(...known) - low || Math.max(1, Math.abs(low));
  return (value) => 4 + (92 * (value - low)) / span;
}

function interval({ objective, out_of_sample: sample, status }, place) {
  const line = make("div", { class: "interval", "aria-hidden": "true" });
  if (sample && Number.isFinite(sample.half_width)) {
    const bar = make("span", { class: "interval-bar" });
    bar.style.left = `${place(sample.mean - sample.half_width)}%`;
    bar.style.width = `${place(sample.mean + sample.half_width) - place(sample.mean - sample.half_width)}%`;
    line.append(bar);
  }
  if (status === "solved" || status === "almost_solved") {
    const dot = make("span", { class: "interval-value" });
    dot.style.left = `${place(objective)}%`;
    line.append(dot);
  }
  return line;
}

function sampleCells(sample) {
  if (!sample) return ["", ""];
  const half = Number.isFinite(sample.half_width) ? ` ± ${real(sample.half_width)}` : "";
  return [`${real(sample.mean)}${half}`, sample.infeasible > 0 ? `${whole(sample.infeasible)} of ${whole(sample.scenarios)}` : "none"];
}

/** One row per stage, with its interval as a bar and its cost as a mark. */
export function showStages(place, stages) {
  const at = scaleOf(stages);
  const head = ["scenarios", "", "cost", "out of sample, 95 %", "without recourse", "factorizations", "time"];
  const rows = stages.map((stage) => {
    const solved = stage.status.startsWith("solved");
    const cells = [solved ? real(stage.objective) : stage.status.replaceAll("_", " "), ...sampleCells(stage.out_of_sample), whole(stage.factorizations), duration(stage.seconds)];
    return make("tr", {}, make("th", { scope: "row" }, whole(stage.scenarios)), make("td", { class: "interval-cell" }, interval(stage, at)), ...cells.map((cell) => make("td", {}, cell)));
  });
  place.replaceChildren(
    make(
      "table",
      { class: "numbers" },
      make("caption", { class: "visually-hidden" }, "Stages of the problem with scenarios"),
      make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col" }, text)))),
      make("tbody", {}, ...rows),
    ),
  );
}
