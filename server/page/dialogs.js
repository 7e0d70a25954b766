// The two questions the page asks.

import { byId, fill } from "./base/dom.js";

function ask(dialog) {
  return new Promise((resolve) => {
    dialog.returnValue = "";
    dialog.addEventListener("close", () => resolve(dialog.returnValue), { once: true });
    dialog.showModal();
  });
}

let asking = null;

/** The token that was typed; asks again after Esc, since without one there is nothing to show. Asks once at a time. */
export function askForToken(why) {
  asking ??= (async () => {
    const field = /** @type {HTMLInputElement} */ (byId("token"));
    field.value = "";
    if (why) fill(byId("token-why"), why);
    while ((await ask(byId("token-dialog"))) !== "ok" || field.value.trim() === "");
    const token = field.value.trim();
    field.value = "";
    return token;
  })().finally(() => {
    asking = null;
  });
  return asking;
}

/** True if it was confirmed. */
export async function confirm(title, text, yes) {
  fill(byId("confirm-title"), title);
  fill(byId("confirm-text"), text);
  fill(byId("confirm-yes"), yes);
  return (await ask(byId("confirm-dialog"))) === "yes";
}
