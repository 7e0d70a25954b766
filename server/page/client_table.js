// The use of the workers by client, largest first.

import { make } from "./dom.js";
import { duration, percent, whole } from "./format.js";

const HEAD = [
  ["Client", "Name of the client; a click shows its jobs"],
  ["Running", "Running jobs and updates of sessions"],
  ["Waiting", "Waiting jobs and updates"],
  ["Finished", "Jobs and updates that finished in these minutes"],
  ["Worker time", "Time that workers have spent on them in these minutes"],
  ["Share of the workers", "Fraction of the total time of all workers"],
];

export class ClientTable {
  /** `open(client)` shows its jobs. */
  constructor(place, open) {
    this.open = open;
    this.body = make("tbody");
    this.note = make("p", { class: "note" });
    const head = make("tr", {}, ...HEAD.map(([title, hint]) => make("th", { scope: "col", title: hint }, title)));
    place.append(this.note, make("table", { class: "numbers clients" }, make("caption", { class: "visually-hidden" }, "Clients by their use of the workers"), make("thead", {}, head), this.body));
    this.note.textContent = "No data yet.";
    this.body.addEventListener("click", (event) => this.#click(event));
  }

  /** Shows an event of the server, with the server's number of workers and uptime. */
  show({ seconds, clients = [], others }, workers, uptime_s) {
    const span_s = Math.max(1, Math.min(Number(seconds), uptime_s));
    const span = uptime_s < Number(seconds) ? "since the server started" : "in the last five minutes";
    const all = [...clients, ...(others && (others.done > 0 || others.queued > 0 || others.running > 0) ? [others] : [])];
    this.note.textContent = all.length === 0
      ? `No client has had a job ${span}.`
      : `Now, and ${span}.`;
    const focused = [...this.body.querySelectorAll("a")].find((link) => link === document.activeElement)?.dataset.client;
    this.body.replaceChildren(...all.map((share) => this.#row(share, span_s * Math.max(1, workers))));
    if (focused !== undefined) [...this.body.querySelectorAll("a")].find((link) => link.dataset.client === focused)?.focus();
  }

  #row({ client, running, queued, done, busy_s: busy }, whole_s) {
    const share = Math.min(1, busy / whole_s);
    const bar = make("span", { class: "share-bar" });
    bar.style.width = `${100 * share}%`;
    const name = client === undefined ? make("span", {}, "all others") : make("a", { href: "#/", "data-client": client, title: "Shows its jobs" }, client);
    return make(
      "tr",
      {},
      make("th", { scope: "row" }, name),
      ...[whole(running), whole(queued), whole(done), duration(busy)].map((text) => make("td", {}, text)),
      make("td", { class: "share-cell" }, make("span", { class: "share" }, bar), make("span", { class: "share-text" }, percent(share))),
    );
  }

  #click(event) {
    const link = event.target.closest("a");
    if (!link || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    this.open(link.dataset.client);
  }
}
