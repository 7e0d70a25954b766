// Accessibility where furo's pages lack it: names of landmarks, levels of captions, the keyboard in what
// scrolls, and empty header cells.
"use strict";

function scrollable() {
  for (const part of document.querySelectorAll("pre, .table-wrapper, .sig-wrapper, div.math")) {
    if (part.scrollWidth > part.clientWidth) part.tabIndex = 0;
    else part.removeAttribute("tabindex");
  }
}

addEventListener("DOMContentLoaded", () => {
  document.querySelector(".sidebar-drawer")?.setAttribute("aria-label", "Site");
  document.querySelector(".toc-drawer")?.setAttribute("aria-label", "On this page");
  for (const caption of document.querySelectorAll('.caption[role="heading"]')) caption.setAttribute("aria-level", "2");
  for (const head of document.querySelectorAll("th")) {
    if (head.textContent.trim() || head.children.length > 1) continue;
    const cell = document.createElement("td");
    cell.className = head.className;
    head.replaceWith(cell);
  }
  scrollable();
  new ResizeObserver(scrollable).observe(document.body);
  addEventListener("click", () => setTimeout(scrollable));  // a tab that opens shows other code
});
