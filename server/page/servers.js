// The servers that share a store: sums over all of them, and a table with a row for each.

import { byId, fill, make } from "./dom.js";
import { age, clock, duration, percent, rate, whole } from "./format.js";

const HEAD = [
  ["Server", "Name of the server; a click opens its own page"],
  ["State", "What the server reported last, or since when it has been silent"],
  ["Version", ""],
  ["Workers", "Busy workers, and their number"],
  ["Waiting", "Jobs and updates of sessions that wait on this server"],
  ["Sessions", "Open sessions"],
  ["Solves", "Jobs and updates that finished in the last minute"],
  ["p99", "99 % of the results of the last minute took at most this time, from acceptance to result"],
  ["Uptime", ""],
];
const STATES = {
  serving: { tone: "good", sign: "✓" },
  draining: { tone: "soft", sign: "◐" },
  lost: { tone: "bad", sign: "✕" },
};
const STALE_S = 8; // reports come every two seconds

const isLoopback = (host) => host === "localhost" || host === "[::1]" || host.startsWith("127.");

/** The address of a server's page, if the browser can reach it; else "". */
function pageOf(text) {
  try {
    const { protocol, hostname, origin } = new URL(text);
    const web = protocol === "http:" || protocol === "https:";
    return web && (!isLoopback(hostname) || isLoopback(location.hostname)) ? `${origin}/` : "";
  } catch {
    return "";
  }
}

/** The time of day, with the date if it is long ago. */
const moment = (unixSeconds) => (Date.now() / 1000 - unixSeconds < 43200 ? new Date(1000 * unixSeconds).toLocaleTimeString() : clock(unixSeconds));

const sum = (servers, name) => servers.reduce((total, server) => total + Number(server[name] ?? 0), 0);
const count = (number, one) => `${whole(number)} ${one}${number === 1 ? "" : "s"}`;

/** Sums over the servers that are not lost. */
export function totals(servers) {
  const there = servers.filter(({ state }) => state !== "lost");
  const slowest = there.reduce((worst, server) => (Number(server.p99_last_minute_s ?? -1) > Number(worst?.p99_last_minute_s ?? -1) ? server : worst), null);
  return {
    count: there.length,
    draining: there.filter(({ state }) => state === "draining").length,
    lost: servers.length - there.length,
    versions: [...new Set(there.map(({ version }) => version))].sort(),
    slowest,
    ...Object.fromEntries(["workers", "running", "queued", "sessions", "answered_last_minute", "solved_last_minute"].map((name) => [name, sum(there, name)])),
  };
}

export class Servers {
  constructor() {
    this.body = make("tbody");
    this.note = make("p", { class: "note", role: "status" }, "Servers are listed here if they share a store (setting state), for the roles observe and admin.");
    const head = make("tr", {}, ...HEAD.map(([title, hint]) => make("th", { scope: "col", title: hint || null }, title)));
    byId("servers-table").append(this.note, make("table", { class: "numbers servers" }, make("caption", { class: "visually-hidden" }, "Servers that share the store"), make("thead", {}, head), this.body));
  }

  /** Shows an event of the server: {servers, waiting, age_s, error}. */
  show({ servers = [], waiting, age_s: old, error }) {
    byId("tab-servers").hidden = false;
    this.#showTotals(totals(servers), Number(waiting));
    const stale = error !== "" && (servers.length === 0 || Number(old) > STALE_S);
    fill(this.note, stale ? `The store cannot be read: ${error}. ${servers.length === 0 ? "" : `The list is ${age(Number(old))} old.`}` : "Each server reports itself to the store that they share.");
    this.note.classList.toggle("alarm", stale);
    byId("servers-view").classList.toggle("stale", stale);
    const row = document.activeElement?.closest?.(".servers tr");
    const focused = row instanceof HTMLElement ? row.dataset.name : undefined;
    this.body.replaceChildren(...servers.map((server) => this.#row(server)));
    if (focused !== undefined) [...this.body.rows].find((one) => one.dataset.name === focused)?.querySelector("a")?.focus();
  }

  #showTotals(all, waiting) {
    fill(byId("all-servers"), whole(all.count));
    fill(byId("all-serving"), all.draining > 0 ? `in service, ${whole(all.draining)} draining` : "in service");
    fill(byId("all-states"), all.lost > 0 ? `${whole(all.lost)} lost` : "none lost");
    byId("all-states").classList.toggle("alarm", all.lost > 0);
    fill(byId("all-versions"), `${all.versions.length > 1 ? "versions" : "version"} ${all.versions.join(", ")}`);
    fill(byId("all-busy"), whole(all.running));
    fill(byId("all-workers"), whole(all.workers));
    byId("all-load").style.width = `${100 * Math.min(1, all.running / Math.max(1, all.workers))}%`;
    fill(byId("all-queued"), whole(all.queued + waiting));
    fill(byId("all-waiting"), `${count(waiting, "submitted job")} not taken by a server yet`);
    fill(byId("all-rate"), rate(all.answered_last_minute / 60));
    fill(byId("all-success"), all.answered_last_minute > 0 ? `${percent(all.solved_last_minute / all.answered_last_minute)} solved, last minute` : "none finished in the last minute");
    fill(byId("all-p99"), duration(Number(all.slowest?.p99_last_minute_s ?? NaN)));
    fill(byId("all-slowest"), all.slowest === null ? "no results in the last minute" : `slowest: ${all.slowest.name}`);
    fill(byId("all-sessions"), whole(all.sessions));
  }

  #row(server) {
    const { name, address, version, state, seen_s: seen, uptime_s: uptime } = server;
    const { tone, sign } = STATES[state] ?? { tone: "quiet", sign: "–" };
    const lost = state === "lost";
    const page = server.this ? "#/" : pageOf(server.page);
    const title = page === "" ? "Its page cannot be reached from here" : server.this ? "This server" : `Its page: ${page}`;
    const shown = page === "" || lost ? make("span", { title }, name) : make("a", { href: page, title }, name);
    const since = lost ? ` since ${moment(Date.now() / 1000 - Number(seen))}` : "";
    const cell = (text, kind = null) => make("td", { class: kind }, lost ? "–" : text);
    return make(
      "tr",
      { "data-name": name, class: lost ? "lost" : null },
      make("th", { scope: "row" }, shown, server.this ? make("span", { class: "note" }, " this server") : null, address === name ? null : make("span", { class: "note address" }, address)),
      make("td", { class: "server-state", "data-tone": tone, title: `Last report ${age(Number(seen))} ago` }, make("span", { class: "sign", "aria-hidden": "true" }, sign), `${state}${since}`),
      make("td", {}, version),
      make("td", { class: "load-cell" }, lost ? "–" : this.#load(server)),
      cell(whole(Number(server.queued))),
      cell(whole(Number(server.sessions))),
      cell(whole(Number(server.answered_last_minute))),
      cell(duration(Number(server.p99_last_minute_s ?? NaN))),
      cell(Number(uptime) < 60 ? age(Number(uptime)) : duration(Number(uptime))),
    );
  }

  #load({ running, workers }) {
    const bar = make("span", { class: "share-bar" });
    bar.style.width = `${100 * Math.min(1, Number(running) / Math.max(1, Number(workers)))}%`;
    return make("span", { class: "load" }, make("span", { class: "share", "aria-hidden": "true" }, bar), make("span", { class: "load-text" }, `${whole(Number(running))} of ${whole(Number(workers))}`));
  }
}
