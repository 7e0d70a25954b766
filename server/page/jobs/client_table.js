// Who takes the workers: a line a client, the one that took most first.

import { make } from "../base/dom.js";
import { duration, percent, whole } from "../base/format.js";

const HEAD = [
  ["Client", "Its name; a click shows its jobs"],
  ["Running", "Jobs, and updates of sessions, that run now"],
  ["Waiting", "Those that wait now"],
  ["Answered", "Those that were answered in these minutes"],
  ["Worker time", "What workers have spent on them in these minutes"],
  ["Share of the workers", "Of all the time that the workers had"],
];

export class ClientTable {
  /** `open(client)` shows its jobs. */
  constructor(place, open) {
    this.open = open;
    this.body = make("tbody");
    this.note = make("p", { class: "note" });
    const head = make("tr", {}, ...HEAD.map(([title, hint]) => make("th", { scope: "col", title: hint }, title)));
    place.append(this.note, make("table", { class: "numbers clients" }, make("caption", { class: "visually-hidden" }, "Clients by what they took of the workers"), make("thead", {}, head), this.body));
    this.note.textContent = "Nothing is known yet.";
    this.body.addEventListener("click", (event) => this.#click(event));
  }

  /** Of the server's event, and of a server with so many workers that runs for so long. */
  show({ seconds, clients = [], others }, workers, uptime_s) {
    const span_s = Math.max(1, Math.min(Number(seconds), uptime_s));
    const span = uptime_s < Number(seconds) ? "since the server started" : "in the last five minutes";
    const all = [...clients, ...(others && (others.done > 0 || others.queued > 0 || others.running > 0) ? [others] : [])];
    this.note.textContent = all.length === 0
      ? `Nobody has had a job ${span}.`
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
