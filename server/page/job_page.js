// The elements of a job's view.

import { make } from "./dom.js";

const panel = (title, name, ...children) =>
  make("section", { class: `card ${name}`, "aria-labelledby": `${name}-title` }, make("h3", { id: `${name}-title` }, title), ...children);

/** Adds the elements to `place`; returns those with content, by name. */
export function buildJobPage(place, id) {
  const parts = {
    title: make("h2", { tabindex: "-1" }, "Job"),
    status: make("span", { class: "badge", id: "job-status" }),
    message: make("p", { class: "note", role: "status", id: "job-message" }),
    download: make("button", { type: "button", id: "download", title: "The rows of progress as a table" }, "Trace as CSV"),
    answer: make("button", { type: "button", id: "answer", hidden: true, title: "The solution with all multipliers" }, "Result as JSON"),
    compare: make("select", { id: "compare", "aria-label": "Compare with another job", hidden: true }),
    bundle: make("button", { type: "button", id: "bundle", hidden: true, title: "Problem, options, convergence and result as one file, for marble replay" }, "For a bug report"),
    cancel: make("button", { type: "button", class: "danger", id: "cancel", hidden: true }, "End job"),
    why: make("div", { class: "why", id: "why", role: "status" }),
    limit: make("div", { class: "limit", hidden: true }),
    conflict: make("div", { id: "conflict", hidden: true }),
    axis: make("select", { id: "axis", "aria-label": "Horizontal axis" }, make("option", { value: "iteration" }, "by iteration"), make("option", { value: "time" }, "by time")),
    convergence: make("div", { class: "charts" }),
    noRows: make("p", { class: "empty" }),
    pairs: make("div", { class: "charts", hidden: true }),
    noPairs: make("p", { class: "empty", id: "no-pairs" }),
    timings: make("div", { id: "timings", hidden: true }),
    noTimings: make("p", { class: "empty" }, "Available when the job has finished."),
    stages: make("div", { id: "stages", class: "scroll", hidden: true }),
    violations: make("div", { id: "violations" }),
    facts: make("dl", { class: "facts wide", id: "facts" }),
    options: make("div", { id: "options" }),
    rows: make("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "Rows of progress" }),
  };
  parts.table = make("details", { id: "rows" }, make("summary", {}, "Rows as a table"), parts.rows);
  const top = make(
    "div",
    { class: "job-top" },
    make("a", { href: "#/", class: "back" }, make("span", { "aria-hidden": "true" }, "← "), "Jobs"),
    parts.title,
    parts.status,
    make("code", { class: "id", id: "job-id" }, id),
    parts.message,
    make("span", { class: "grow" }),
    parts.compare,
    parts.download,
    parts.answer,
    parts.bundle,
    parts.cancel,
  );
  const convergence = panel("Convergence", "convergence-panel", parts.axis, parts.stages, parts.convergence, parts.noRows, parts.table);
  parts.page = make(
    "article",
    { class: "job-page" },
    top,
    parts.why,
    convergence,
    panel("Pairs: s against t", "pairs-panel", parts.pairs, parts.noPairs),
    panel("Times", "timings-panel", parts.timings, parts.noTimings),
    panel("Violations", "violations-panel", parts.limit, parts.violations, parts.conflict),
    panel("The job", "facts-panel", parts.facts),
    panel("Options", "options-panel", parts.options),
  );
  place.replaceChildren(parts.page);
  return parts;
}
