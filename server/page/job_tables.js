// The tables of a job's view.

import { make } from "./dom.js";
import { judge } from "./findings.js";
import { bytes, clock, duration, rate, real, residual, whole } from "./format.js";
import { seconds } from "./store.js";
import { nodeRates, repeated } from "./trace.js";
import { short } from "./words.js";

const table = (caption, head, rows) =>
  make(
    "table",
    { class: "numbers" },
    make("caption", { class: "visually-hidden" }, caption),
    make("thead", {}, make("tr", {}, ...head.map((text) => make("th", { scope: "col" }, text)))),
    make("tbody", {}, ...rows),
  );

/** General information about the job. */
export function showFacts(place, job, trace) {
  const session = job.kind === "session";
  const facts = [
    ["Client", job.client],
    ["Request id", job.request_id],
    ["Trace id", job.trace_id],
    ["Kind", job.kind],
    ["Priority", job.priority],
    ["Accepted", clock(job.accepted_unix_s)],
    ["Finished", job.finished_unix_s > 0 ? clock(job.finished_unix_s) : ""],
    [session ? "Newest solve" : "Time so far", duration(seconds(job))],
    ["Variables n", whole(job.variables)],
    ["Equalities nₑ", whole(job.equalities)],
    ["Inequalities nᵢ", whole(job.inequalities)],
    ["Pairs n_c", whole(job.pairs)],
    ["Iterations", whole(job.iterations)],
    ["Factorizations", whole(job.factorizations)],
    ["Updates finished", session ? whole(job.updates) : ""],
    ["Objective", job.error || job.iterations === 0 ? "" : real(job.objective)],
    ["KKT residual", trace.rows.length > 0 ? residual(trace.rows.at(-1).kkt_residual) : ""],
    ...treeFacts(job, trace),
    ["Memory of the solver", job.memory_bytes > 0 ? bytes(job.memory_bytes) : ""],
    ["Stored result", job.result_bytes > 0 ? bytes(job.result_bytes) : ""],
  ];
  if (job.state === "finished") facts.find(([name]) => name === "Time so far")?.splice(0, 1, "Time");
  place.replaceChildren(
    ...facts.filter(([, value]) => value !== "").map(([name, value]) => make("div", {}, make("dt", {}, name), make("dd", { title: value }, value))),
  );
}

// The tree of option global_search.
function treeFacts({ nodes, open_nodes, incumbent, bound, gap }, trace) {
  if (nodes === 0) return [];
  const speed = nodeRates(trace.rows).at(-1);
  return [
    ["Incumbent", Number.isFinite(incumbent) ? real(incumbent) : "none yet"],
    ["Bound", Number.isNaN(bound) ? "none yet" : real(bound)],
    ["Gap", Number.isFinite(gap) ? residual(gap) : ""],
    ["Nodes", whole(nodes)],
    ["Open nodes", whole(open_nodes)],
    ["Nodes per second", Number.isFinite(speed) ? rate(speed) : ""],
  ];
}

/** Each violation with its tolerance. */
export function showViolations(place, job, options) {
  const rows = judge(job, options).map(({ name, value, tolerance, met, meaning }) => {
    const open = job.state === "running" && !met; // may still change
    const result = make("td", { class: met ? "met" : open ? "open" : "unmet" }, met ? "✓ met" : open ? "… not yet" : "✕ not met");
    return make("tr", {}, make("th", { scope: "row", title: meaning }, name), make("td", {}, residual(value)), make("td", {}, residual(tolerance)), result);
  });
  const known = (job.iterations > 0 || job.status !== "") && !job.error;
  const feasible = job.state !== "finished" && Number.isFinite(job.incumbent);
  place.replaceChildren(
    ...(feasible ? [make("p", { class: "met" }, `✓ A feasible point is known: objective ${real(job.incumbent)}.`), make("p", { class: "note" }, "Current iterate:")] : []),
    known ? table("Violations of the newest iterate", ["of", "largest", "tolerance", "result"], rows) : make("p", { class: "empty" }, "Not known."),
  );
}

/** The conflicting parts of an infeasible problem. */
export function showConflict(place, { parts, more, minimal, detail }) {
  const lines = parts.map(({ part, needs }) => make("tr", {}, make("th", { scope: "row" }, part), make("td", {}, needs)));
  place.replaceChildren(
    make("p", { class: "note" }, "No point meets all of these parts. Indices are from 0:"),
    table("Parts that conflict", ["part", "needs"], lines),
    more > 0 ? make("p", { class: "note" }, `and ${whole(more)} more; the solution has all of them.`) : make("span"),
    make("p", { class: "note" }, minimal ? "Minimal: without any one of them the others are feasible." : "Not minimal: fewer of them may conflict."),
    detail === "" ? make("span") : make("p", { class: "note" }, detail),
  );
}

/**
 * The rows with the largest multipliers in an infeasibility certificate; none if only pairs are in conflict. `explained`: the
 * job had option explain, so the hint is not shown.
 */
export function showCertificate(place, { rows, more }, explained) {
  const lines = rows.map(({ row, multiplier }) => make("tr", {}, make("th", { scope: "row" }, row), make("td", {}, real(Number(multiplier.toPrecision(4))))));
  const weighed = [
    make("p", { class: "note" }, "Conflicting rows, from 0, with their multipliers in the certificate:"),
    table("Conflicting rows", ["row", "multiplier"], lines),
    more > 0 ? make("p", { class: "note" }, `and ${whole(more)} more; the solution has all of them.`) : make("span"),
  ];
  place.replaceChildren(
    ...(rows.length > 0 ? weighed : []),
    explained ? make("span") : make("p", { class: "note" }, "With option explain=true, a smallest set of conflicting rows and pairs is shown here."),
  );
}

/** Options of the job; those that differ from the server's defaults come first. */
export function showOptions(place, options, schema) {
  const entries = schema.filter(({ name }) => options[name] !== undefined).map((option) => describe(option, options[option.name]));
  entries.sort((a, b) => Number(b.changed) - Number(a.changed));
  const rows = entries.map(({ name, doc, value, usual, changed }) =>
    make("tr", { class: changed ? "changed" : "" }, make("th", { scope: "row", title: doc }, name), make("td", {}, value, changed ? make("span", { class: "usual" }, `changed from ${usual}`) : null)),
  );
  place.replaceChildren(rows.length > 0 ? table("Solver options", ["option", "value"], rows) : make("p", { class: "empty" }, "Not known."));
}

function describe({ name, type, doc, unit, choices, default_value: usual }, value) {
  const suffix = unit ? ` ${unit}` : "";
  const text = {
    TYPE_BOOLEAN: (number) => (Number(number) === 1 ? "true" : "false"),
    TYPE_CHOICE: (number) => choices[Number(number)] ?? String(number),
  }[type] ?? ((number) => real(Number(number)) + suffix);
  const given = type === "TYPE_BOOLEAN" ? Number(value) : type === "TYPE_CHOICE" ? choices.indexOf(short(value, `${name.toUpperCase()}_`)) : Number(value);
  return { name, doc, value: text(given), usual: text(usual), changed: given !== Number(usual) };
}

/** The rows of progress, oldest first. */
export function showRows(place, rows) {
  const repeats = repeated(rows);
  const head = ["iteration", "time", "objective", "equality", "inequality", "complementarity", "KKT residual", "κ", "ρ", "step", "regularization", "factorizations", "repeated"];
  const tree = rows.some((row) => row.nodes > 0);
  if (tree) head.push("incumbent", "bound", "gap", "nodes", "open");
  const treeCells = (row) => (row.nodes > 0 ? [real(row.incumbent), real(row.bound), residual(row.gap), whole(row.nodes), whole(row.open_nodes)] : ["", "", "", "", ""]);
  const lines = rows.map((row, at) => {
    const cells = [duration(row.elapsed_s), real(row.objective), residual(row.equality), residual(row.inequality), residual(row.complementarity), residual(row.kkt_residual),
                   residual(row.kappa), residual(row.rho), real(row.step_length), residual(row.regularization), whole(row.factorizations), repeats[at] > 0 ? String(repeats[at]) : "", ...(tree ? treeCells(row) : [])];
    return make("tr", {}, make("th", { scope: "row" }, String(row.iteration)), ...cells.map((cell) => make("td", {}, cell)));
  });
  place.replaceChildren(table("Rows of progress", head, lines));
}
