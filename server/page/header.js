// The bar at the top: server, its state, age of the data, and the caller.

import { byId, fill, make } from "./dom.js";
import { duration } from "./format.js";

const WORDS = { connecting: "connecting", serving: "serving", draining: "draining", retrying: "disconnected", paused: "paused while hidden", stopped: "stopped" };

export class Header {
  #connection = { phase: "connecting", lastFresh: null };
  #server = "serving";

  /** `retry` connects at once. */
  constructor(retry) {
    fill(byId("host"), location.host);
    this.reason = make("span");
    this.countdown = make("span", { "aria-hidden": "true" });
    const now = make("button", { type: "button" }, "Try now");
    now.addEventListener("click", retry);
    byId("banner").append(this.reason, this.countdown, now);
    setInterval(() => this.#count(), 250);
  }

  showInfo(info) {
    fill(byId("version"), `version ${info.version}`);
    const roles = info.roles ?? [];
    fill(byId("caller"), `${info.client} · ${roles.length > 0 ? roles.join(", ") : "no role"}`);
  }
  showServer(state, uptime_s) {
    this.#server = state;
    fill(byId("uptime"), `up ${uptime_s < 120 ? `${Math.floor(uptime_s)} s` : duration(uptime_s)}`);
    this.#show();
  }
  showConnection(connection) {
    this.#connection = connection;
    this.#show();
  }
  showToken(known) {
    byId("sign-out").hidden = !known;
  }

  #show() {
    const { phase, reason, lastFresh } = this.#connection;
    const state = phase === "live" ? this.#server : phase;
    byId("state").dataset.phase = state;
    fill(byId("state-text"), WORDS[state] ?? state);
    const down = phase === "retrying" || (phase === "connecting" && !byId("banner").hidden);
    byId("banner").hidden = !down;
    document.body.classList.toggle("stale", phase !== "live");
    if (phase === "retrying") {
      const since = lastFresh === null ? "No data yet." : `The data are from ${new Date(lastFresh).toLocaleTimeString()}.`;
      fill(this.reason, `Disconnected: ${reason}. ${since}`);
    }
    this.#count();
  }

  #count() {
    const { phase, retryAt } = this.#connection;
    if (phase === "retrying") fill(this.countdown, `Retrying in ${Math.max(0, Math.ceil((retryAt - Date.now()) / 1000))} s`);
    else if (phase === "connecting") fill(this.countdown, "Retrying now");
  }
}
