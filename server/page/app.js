// Wiring: the stream fills store and history, the views show them once a frame, the address selects the view.

import { Api } from "./api.js";
import { Comparison } from "./comparison.js";
import { askForToken } from "./dialogs.js";
import { byId, make, onceAFrame } from "./dom.js";
import { ClientTable } from "./client_table.js";
import { Feed } from "./feed.js";
import { Header } from "./header.js";
import { History, toCounters } from "./history.js";
import { JobTable } from "./job_table.js";
import { JobView } from "./job_view.js";
import { Overview } from "./overview.js";
import { Servers } from "./servers.js";
import { MAX_JOBS, Store } from "./store.js";

const PAGE_OF_JOBS = 1000;
const SILENCE_S = 6; // the server sends events twice a second
const HIDDEN_PAUSE_MS = 60000; // a browser has few connections per server; a hidden page needs none

class App {
  #api = new Api();
  #store = new Store();
  #history = new History();
  #feed = null;
  #info = null;
  #counters = null;
  #uptime_s = 0;
  #view = null;
  #listing = 0; // number of the newest listing; older ones stop
  #hiddenTimer = 0;

  constructor() {
    this.header = new Header(() => this.#feed?.retryNow());
    this.overview = new Overview(this.#history);
    this.table = new JobTable(
      { place: byId("jobs-table"), filter: byId("filter"), chips: byId("chips"), count: byId("job-count") },
      this.#store,
      (id) => (location.hash = `#/jobs/${id}`),
    );
    this.clients = new ClientTable(byId("clients-table"), (client) => this.#showJobsOf(client));
    this.servers = new Servers();
    this.showNow = onceAFrame(() => this.#showNow());
    addEventListener("hashchange", () => this.#route());
    addEventListener("keydown", (event) => this.#key(event));
    document.addEventListener("visibilitychange", () => this.#visibility());
    // The browser may keep a page with its streams after the user leaves it, and has only six connections per server.
    addEventListener("pagehide", () => this.#leave());
    addEventListener("pageshow", (event) => event.persisted && location.reload());
    byId("sign-out").addEventListener("click", () => this.#forgetToken());
    this.header.showToken(this.#api.hasToken);
    this.#connect();
    this.#route();
  }

  #connect() {
    this.#feed = new Feed(this.#api, "/api/events", {
      event: (name, data) => this.#event(name, data),
      phase: (connection) => this.header.showConnection(connection),
      refused: (error) => this.#refused(error),
    }, SILENCE_S);
  }

  #event(name, data) {
    if (name === "hello") this.#hello(data);
    if (name === "server") this.#server(data);
    if (name === "jobs") for (const { job, rows } of data.events ?? []) this.#store.put(job, rows);
    if (name === "jobs") this.table.update();
    if (name === "clients") this.clients.show(data, Number(this.#info?.workers ?? 0), this.#uptime_s);
    if (name === "servers") this.servers.show(data);
    if (name === "reload") this.#list();
  }

  // Discards all data: the new connection may be to a restarted server.
  async #hello(info) {
    if (Number(info.uptime_s) < this.#uptime_s) this.#history.clear();
    this.#info = { ...info, options: this.#info?.options ?? [] };
    this.header.showInfo(info);
    this.#store.keep(Number(info.limits?.history_jobs ?? MAX_JOBS));
    this.#list();
    this.#view?.reload();
    try {
      const [all, history] = await Promise.all([this.#api.get("/api/info"), this.#api.get("/api/history")]);
      this.#info = all;
      this.#history.replace(history);
      this.#view?.update();
    } catch {
      // The stream reports the loss of the server; its next hello repeats this.
    }
  }

  #server(data) {
    this.#counters = toCounters(data);
    this.#uptime_s = Number(data.uptime_s);
    this.#history.put(this.#uptime_s, this.#counters);
    this.header.showServer(data.state, this.#uptime_s);
    if (this.#info !== null && data.workers) this.#info.workers = Number(data.workers);
    this.showNow();
  }

  // Lists all jobs of the server page by page, newest first.
  async #list() {
    const listing = ++this.#listing;
    this.#store.clear();
    this.table.update();
    try {
      let before = "";
      for (let more = true, taken = 0; more && taken < MAX_JOBS; taken += PAGE_OF_JOBS) {
        const page = await this.#api.get(`/api/jobs?limit=${PAGE_OF_JOBS}${before}`);
        if (listing !== this.#listing) return;
        const jobs = page.jobs ?? [];
        this.#store.putHistory(jobs);
        this.table.update();
        more = Boolean(page.more) && jobs.length > 0;
        before = `&before=${jobs.at(-1)?.job_id}`;
      }
      this.#view?.update(); // its list of jobs to compare
    } catch (error) {
      if (error.status === 404 && listing === this.#listing) this.#list(); // the job was removed between two pages
    }
  }

  #showNow() {
    if (this.#counters === null) return;
    this.overview.show(this.#counters, Number(this.#info?.workers ?? 0), this.#info?.limits);
    const { running, queued } = this.#counters;
    const title = `${running} running${queued > 0 ? `, ${queued} waiting` : ""} – Marble Server`;
    if (document.title !== title) document.title = title;
  }

  async #refused(error) {
    if (error.status !== 401) return true;
    const why = this.#api.hasToken ? "The server does not accept this token." : "";
    this.#api.setToken(await askForToken(why));
    this.header.showToken(true);
    return true;
  }
  #forgetToken() {
    this.#api.setToken("");
    location.reload();
  }

  #route() {
    const path = location.hash.replace(/^#/, "");
    const [id, other] = /^\/jobs\/([^/]+)(?:\/with\/([^/]+))?$/.exec(path)?.slice(1) ?? [];
    const lists = ["", "/", "/clients", "/servers"].includes(path);
    const had = this.#view !== null;
    this.#view?.close();
    this.#view = null;
    byId("overview").hidden = !lists;
    byId("job").hidden = id === undefined;
    byId("job").replaceChildren();
    byId("nowhere").hidden = lists || id !== undefined;
    if (lists) this.#showList(path.slice(1) || "jobs");
    if (lists && had) this.table.focus();
    if (!lists && id === undefined) this.#showNowhere(path);
    if (id === undefined) return;
    const context = { api: this.#api, info: () => this.#info, forget: (gone) => this.#store.remove(gone), jobs: () => this.#store.all() };
    this.#view = other === undefined
      ? new JobView(byId("job"), decodeURIComponent(id), context)
      : new Comparison(byId("job"), [id, other].map(decodeURIComponent), context);
    scrollTo(0, 0);
  }

  #showList(list) {
    const views = { jobs: "jobs-table", clients: "clients-table", servers: "servers-view" };
    for (const [name, view] of Object.entries(views)) {
      byId(view).hidden = name !== list;
      if (name === list) byId(`tab-${name}`).setAttribute("aria-current", "page");
      else byId(`tab-${name}`).removeAttribute("aria-current");
    }
    for (const part of ["filter-label", "chips", "job-count"]) byId(part).hidden = list !== "jobs";
    byId("now").hidden = list === "servers"; // it is about this server alone
  }
  #showJobsOf(client) {
    location.hash = "#/";
    this.table.search(client);
  }
  #showNowhere(path) {
    byId("nowhere").replaceChildren(
      make("h2", {}, "Page not found"),
      make("p", {}, `There is no view "${path}". The views are #/ (all jobs), #/clients, #/servers, and #/jobs/ID (one job).`),
      make("p", {}, make("a", { href: "#/" }, "All jobs")),
    );
  }

  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector("dialog[open]")) return;
    const typing = event.target.closest?.("input, select, textarea") !== null;
    if (event.key === "/" && !typing && !byId("overview").hidden && !byId("jobs-table").hidden) {
      event.preventDefault();
      byId("filter").focus();
    }
    if (event.key === "Escape" && this.#view !== null) location.hash = "#/";
  }

  #leave() {
    this.#feed?.stop();
    this.#view?.close();
  }

  #visibility() {
    clearTimeout(this.#hiddenTimer);
    if (document.hidden) {
      this.#hiddenTimer = setTimeout(() => {
        this.#feed?.stop();
        this.#feed = null;
        this.header.showConnection({ phase: "paused", lastFresh: null });
      }, HIDDEN_PAUSE_MS);
    } else if (this.#feed === null) {
      this.#connect();
    }
  }
}

new App();
