// The times of a job's parts, which add up to its total time.

import { make } from "./dom.js";
import { duration, percent } from "./format.js";

/** [name, seconds, colour] in the order of time; the rests belong to no other part. */
export function partsOf(times) {
  const inside = times.factorization_s + times.line_search_s + times.polish_s + times.tree_s;
  return [
    ["queue", times.queue_s, "--grey"],
    ["set-up", times.setup_s, "--purple"],
    ["factorization", times.factorization_s, "--blue"],
    ["line search", times.line_search_s, "--orange"],
    ["polish and local search", times.polish_s, "--green"],
    ...(times.tree_s > 0 ? [["tree of branch and bound", times.tree_s, "--ink"]] : []),
    ["rest of the solve", Math.max(0, times.solve_s - inside), "--teal"],
    ["preempted, and the rest", Math.max(0, times.total_s - times.queue_s - times.setup_s - times.solve_s), "--red"],
  ];
}

/** Shows the parts as a bar and a table. */
export function showTimings(place, times) {
  const parts = partsOf(times);
  const whole = parts.reduce((sum, part) => sum + part[1], 0);
  const bar = make("div", { class: "stack", "aria-hidden": "true" });
  const lines = parts.map(([name, seconds, colour]) => {
    const share = whole > 0 ? seconds / whole : 0;
    const piece = make("span", { title: `${name}: ${duration(seconds)}` });
    piece.style.width = `${100 * share}%`;
    piece.style.background = `var(${colour})`;
    if (share > 0) bar.append(piece);
    const swatch = make("span", { class: "swatch", "aria-hidden": "true" });
    swatch.style.background = `var(${colour})`;
    return make("tr", {}, make("th", { scope: "row" }, swatch, name), make("td", {}, duration(seconds)), make("td", {}, percent(share)));
  });
  const total = make("tr", { class: "sum" }, make("th", { scope: "row" }, "total"), make("td", {}, duration(whole)), make("td", {}, ""));
  const caption = make("caption", { class: "visually-hidden" }, "Parts of the job's time");
  place.replaceChildren(bar, make("table", { class: "numbers" }, caption, make("tbody", {}, ...lines, total)));
}
