// The server's HTTP API: JSON, errors as ApiError, events as an async iterator.

const TOKEN_KEY = "marble-token";

/** An error of the server. `error` has code, field, index, value, bound, message. */
export class ApiError extends Error {
  constructor(status, error) {
    super(error.message || `the server answered ${status}`);
    this.status = status;
    this.error = error;
  }
}

/** Events of a text/event-stream, as {name, data}; comments come as {name: "", data: null}. */
async function* parseEvents(body) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) return;
      const blocks = (rest + value).replaceAll("\r\n", "\n").split("\n\n");
      rest = blocks.pop();
      for (const block of blocks) yield parseBlock(block);
    }
  } finally {
    reader.cancel().catch(() => {});
  }
}

function parseBlock(block) {
  let name = "";
  const data = [];
  for (const line of block.split("\n")) {
    if (line.startsWith("event:")) name = line.slice(6).trim();
    if (line.startsWith("data:")) data.push(line.slice(5).trimStart());
  }
  return { name, data: data.length > 0 ? JSON.parse(data.join("\n")) : null };
}

export class Api {
  #token = sessionStorage.getItem(TOKEN_KEY) ?? "";

  get hasToken() {
    return this.#token !== "";
  }
  setToken(token) {
    this.#token = token;
    if (token === "") sessionStorage.removeItem(TOKEN_KEY);
    else sessionStorage.setItem(TOKEN_KEY, token);
  }

  async #fetch(path, options = {}) {
    const headers = { ...options.headers };
    if (this.#token !== "") headers.Authorization = `Bearer ${this.#token}`;
    const response = await fetch(path, { cache: "no-store", ...options, headers });
    if (response.ok) return response;
    const body = await response.json().catch(() => ({}));
    throw new ApiError(response.status, body.error ?? { message: `the server answered ${response.status}` });
  }

  async get(path, signal) {
    return (await this.#fetch(path, { signal })).json();
  }
  async post(path) {
    return (await this.#fetch(path, { method: "POST", headers: { "Marble-Request": "1" } })).json();
  }
  async blob(path) {
    return (await this.#fetch(path)).blob();
  }
  /** Ends when the server closes the stream; throws when the connection breaks or `signal` aborts. */
  async *events(path, signal) {
    const response = await this.#fetch(path, { signal, headers: { Accept: "text/event-stream" } });
    yield* parseEvents(response.body);
  }
}
