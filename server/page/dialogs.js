// The dialogs of the page.

import { byId, fill } from "./dom.js";

function ask(dialog) {
  return new Promise((resolve) => {
    dialog.returnValue = "";
    dialog.addEventListener("close", () => resolve(dialog.returnValue), { once: true });
    dialog.showModal();
  });
}

let asking = null;

/** Asks for a token until the user enters one; concurrent calls share one dialog. */
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

/** Whether the user confirms. */
export async function confirm(title, text, yes) {
  fill(byId("confirm-title"), title);
  fill(byId("confirm-text"), text);
  fill(byId("confirm-yes"), yes);
  return (await ask(byId("confirm-dialog"))) === "yes";
}
