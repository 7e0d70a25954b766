// The table of all jobs. Only the visible rows are in the document.

import { fill, make, onceAFrame } from "./dom.js";
import { jobs, whole } from "./format.js";
import { CHIPS, select } from "./job_filter.js";
import { COLUMNS, JobRow } from "./job_row.js";

const EXTRA_ROWS = 4;
const SELECT_EVERY_MS = 200; // filtering and sorting of all jobs; visible rows change every frame
const TICK_MS = 1000;

export class JobTable {
  #rows = [];
  #chosen = null; // id of the row with the keyboard's focus
  #shown = []; // filtered jobs, in order
  #sort = { column: "", down: false };
  #chips = new Set();
  #selectedAt = -Infinity;
  #selectedVersion = -1;
  #timer = 0;

  /** The elements for the table, the filter's input, the chips and the count. `open(id)` opens a job. */
  constructor({ place, filter, chips, count }, store, open) {
    this.store = store;
    this.open = open;
    this.filter = filter;
    this.count = count;
    this.update = onceAFrame(() => this.#update());
    this.#build(place);
    this.#buildChips(chips);
    filter.addEventListener("input", () => this.#changed());
    filter.addEventListener("keydown", (event) => this.#keyInFilter(event));
    this.scroller.addEventListener("scroll", () => this.#draw(), { passive: true });
    this.scroller.addEventListener("keydown", (event) => this.#key(event));
    this.scroller.addEventListener("click", (event) => this.#click(event));
    new ResizeObserver(() => this.#resize()).observe(this.scroller);
    setInterval(() => this.#tick(), TICK_MS);
  }

  #build(place) {
    this.head = make("div", { role: "row", class: "job-head", "aria-rowindex": "1" }, ...COLUMNS.map((column, at) => this.#headCell(column, at)));
    this.body = make("div", { role: "rowgroup", class: "job-body" });
    this.empty = make("p", { class: "empty", hidden: true });
    this.scroller = make(
      "div",
      { role: "grid", class: "job-grid", tabindex: "0", "aria-label": "Jobs", "aria-colcount": COLUMNS.length },
      make("div", { role: "rowgroup", class: "job-head-group" }, this.head),
      this.body,
    );
    place.append(this.scroller, this.empty);
  }

  /** Filters by this text. */
  search(text) {
    this.filter.value = text;
    this.#changed();
  }

  /** Focuses the table again after a job was closed. */
  focus() {
    this.scroller.focus({ preventScroll: true });
  }

  #headCell({ key, title, hint, numeric = undefined }, at) {
    const button = make("button", { type: "button", tabindex: "-1", title: hint }, ...this.#title(title), make("span", { class: "arrow", "aria-hidden": "true" }));
    button.addEventListener("click", () => this.#sortBy(key));
    return make("div", { role: "columnheader", class: `${key}${numeric ? " numeric" : ""}`, "aria-sort": "none", "aria-colindex": at + 1, "data-key": key }, button);
  }

  #title(title) {
    const [before, after] = title.split("n_c");
    return after === undefined ? [title] : [before, "n", make("sub", {}, "c")];
  }

  #buildChips(place) {
    this.chipCounts = new Map();
    for (const { group, name } of CHIPS) {
      const count = make("span", { class: "chip-count" });
      const chip = make("button", { type: "button", class: `chip ${group}`, "aria-pressed": "false" }, name, count);
      chip.addEventListener("click", () => {
        const on = !this.#chips.has(name);
        if (on) this.#chips.add(name);
        else this.#chips.delete(name);
        chip.setAttribute("aria-pressed", String(on));
        this.#changed();
      });
      this.chipCounts.set(name, count);
      place.append(chip);
    }
  }

  #sortBy(column) {
    const { column: before, down } = this.#sort;
    const numeric = COLUMNS.find(({ key }) => key === column).numeric ?? false;
    if (before !== column) this.#sort = { column, down: numeric };
    else this.#sort = down === numeric ? { column, down: !numeric } : { column: "", down: false };
    for (const cell of this.head.children) {
      const mine = cell.dataset.key === this.#sort.column;
      // The age increases with an earlier time of acceptance.
      const falling = (cell.dataset.key === "age") !== this.#sort.down;
      cell.setAttribute("aria-sort", !mine ? "none" : falling ? "descending" : "ascending");
    }
    this.#changed();
  }

  #changed() {
    this.#selectedVersion = -1;
    this.#selectedAt = -Infinity;
    this.update();
  }

  // Filters and sorts again after changes, at most every SELECT_EVERY_MS.
  #update() {
    const now = performance.now();
    const due = this.#selectedAt + SELECT_EVERY_MS;
    if (this.#selectedVersion !== this.store.version) {
      if (now >= due) {
        this.#select();
        this.#selectedAt = now;
        this.#selectedVersion = this.store.version;
      } else if (this.#timer === 0) {
        this.#timer = setTimeout(() => {
          this.#timer = 0;
          this.update();
        }, due - now);
      }
    }
    this.#draw();
  }

  #select() {
    const anchor = this.scroller.scrollTop > 0 ? this.#shown[this.#firstInSight()]?.job_id : undefined;
    const offset = this.scroller.scrollTop % this.rowHeight;
    this.#shown = select(this.store.all(), this.filter.value, this.#chips, this.#sort);
    this.#countChips();
    this.body.style.height = `${this.#shown.length * this.rowHeight}px`;
    this.scroller.setAttribute("aria-rowcount", this.#shown.length + 1);
    if (anchor !== undefined) {
      const at = this.#shown.findIndex((job) => job.job_id === anchor); // keeps the visible jobs in place
      if (at >= 0) this.scroller.scrollTop = at * this.rowHeight + offset;
    }
  }

  #countChips() {
    const counts = new Map(CHIPS.map(({ name }) => [name, 0]));
    for (const job of this.store.all()) {
      for (const { name, holds } of CHIPS) if (holds(job)) counts.set(name, counts.get(name) + 1);
    }
    for (const [name, element] of this.chipCounts) fill(element, whole(counts.get(name)));
    const all = this.store.size;
    const shown = this.#shown.length;
    fill(this.count, shown === all ? jobs(all) : `${whole(shown)} of ${jobs(all)}`);
    this.empty.hidden = shown > 0;
    fill(this.empty, all > 0 ? "No job matches this filter." : "No jobs yet. Try marble solve or marble submit.");
  }

  #firstInSight() {
    return Math.floor(this.scroller.scrollTop / this.rowHeight);
  }

  #resize() {
    this.rowHeight = this.head.getBoundingClientRect().height;
    if (this.rowHeight > 0) this.#changed();
  }

  // Shows the visible jobs in the rows.
  #draw() {
    if (!(this.rowHeight > 0)) return;
    const first = Math.max(0, this.#firstInSight() - EXTRA_ROWS);
    const most = Math.ceil(this.scroller.clientHeight / this.rowHeight) + 2 * EXTRA_ROWS;
    const end = Math.min(this.#shown.length, first + most);
    while (this.#rows.length < end - first) this.#addRow();
    // A row keeps its job while the table scrolls: job i is in row i modulo the number of rows.
    const used = new Set();
    for (let index = first; index < end; ++index) {
      const row = this.#rows[index % this.#rows.length];
      const job = this.store.get(this.#shown[index].job_id) ?? this.#shown[index];
      row.show(job, index, index * this.rowHeight, job.job_id === this.#chosen);
      used.add(row);
    }
    for (const row of this.#rows) if (!used.has(row)) row.hide();
    this.#pointToChosen();
  }

  #addRow() {
    const row = new JobRow(this.#rows.length);
    this.#rows.push(row);
    this.body.append(row.element);
  }

  #pointToChosen() {
    const row = this.#rows.find((candidate) => candidate.job !== null && candidate.job.job_id === this.#chosen);
    if (row) this.scroller.setAttribute("aria-activedescendant", row.element.id);
    else this.scroller.removeAttribute("aria-activedescendant");
  }

  #tick() {
    if (document.hidden || this.scroller.clientHeight === 0) return;
    for (const row of this.#rows) if (row.job !== null) row.tick();
  }

  #click(event) {
    const row = event.target.closest(".job-row");
    if (row?.dataset.job === undefined || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    this.#chosen = row.dataset.job;
    this.open(this.#chosen);
  }

  #key(event) {
    const last = this.#shown.length - 1;
    const at = this.#shown.findIndex((job) => job.job_id === this.#chosen);
    const page = Math.max(1, Math.floor(this.scroller.clientHeight / this.rowHeight) - 2);
    const moves = { ArrowDown: at + 1, ArrowUp: at < 0 ? 0 : at - 1, PageDown: at + page, PageUp: at - page, Home: 0, End: last };
    if (event.key === "Enter" && at >= 0) {
      this.open(this.#chosen);
    } else if (event.key in moves && last >= 0) {
      event.preventDefault();
      this.#moveTo(Math.max(0, Math.min(last, moves[event.key])));
    }
  }

  #moveTo(index) {
    this.#chosen = this.#shown[index].job_id;
    const top = index * this.rowHeight;
    const sight = this.scroller.clientHeight - this.rowHeight; // the head covers one row
    if (top < this.scroller.scrollTop) this.scroller.scrollTop = top;
    if (top + this.rowHeight > this.scroller.scrollTop + sight) this.scroller.scrollTop = top + this.rowHeight - sight;
    this.#draw();
  }

  #keyInFilter(event) {
    if (event.key === "ArrowDown") {
      event.preventDefault();
      this.scroller.focus();
      if (this.#shown.length > 0) this.#moveTo(0);
    }
    if (event.key === "Escape") {
      if (this.filter.value === "") this.filter.blur();
      this.filter.value = "";
      this.#changed();
    }
  }
}
