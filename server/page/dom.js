// Small helpers to build and fill elements.

/** Replaces control characters in untrusted text, such as those that change the direction of writing. */
export const plain = (text) => String(text).replace(/(?!\n)[\p{Cc}\p{Cf}\p{Zl}\p{Zp}]/gu, "?");

/** A new element. Attributes that are null or false are omitted. Children: elements or text. */
export function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    element.setAttribute(name, value === true ? "" : plain(value));
  }
  for (const child of children) {
    if (child !== null && child !== undefined) element.append(typeof child === "string" ? plain(child) : child);
  }
  return element;
}

/** Sets the text if it has changed, because unchanged nodes need no layout. */
export function fill(element, text) {
  const shown = plain(text);
  if (element.textContent !== shown) element.textContent = shown;
}

export const byId = (id) => document.getElementById(id);

/** A colour or length of the style sheet in the current theme. */
export const styleValue = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** A function that calls `draw` at most once a frame. */
export function onceAFrame(draw) {
  let frame = 0;
  const request = () => {
    if (frame === 0) {
      frame = requestAnimationFrame(() => {
        frame = 0;
        draw();
      });
    }
  };
  request.cancel = () => {
    cancelAnimationFrame(frame);
    frame = 0;
  };
  return request;
}
