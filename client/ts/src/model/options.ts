import { invalid } from "../base/errors.js";
import { type Words, valueOf, word, words } from "../base/words.js";
import { SolveOptions as Message, Method, Path, Retraction } from "../generated/marble/v1/options.js";

/**
 * Solver options; what is left out has the server's default. `client.info()` tells each one's default, range, unit and
 * meaning, as does `marble options`.
 */
export interface SolveOptions extends Partial<Omit<Message, "path" | "method" | "retraction">> {
  /** How the relaxation is followed to 0. */
  path?: Words<typeof Path, "PATH_">;
  /** By what: this solver, or a method of others to compare with. */
  method?: Words<typeof Method, "METHOD_">;
  /** How the sides of a pair are written by one variable. */
  retraction?: Words<typeof Retraction, "RETRACTION_">;
}

const names = Object.keys(Message.fromPartial({}));

/** Names and kinds are checked here; ranges are the server's to know. */
export function optionsMessage(options: SolveOptions | undefined): Message | undefined {
  if (options === undefined) return undefined;
  if (typeof options !== "object" || options === null) throw invalid("options", "must be an object", { value: options });
  const message = Message.fromPartial({
    ...options,
    path: choice("path", Path, "PATH_", options.path),
    method: choice("method", Method, "METHOD_", options.method),
    retraction: choice("retraction", Retraction, "RETRACTION_", options.retraction),
  });
  for (const name of Object.keys(options)) {
    if (!names.includes(name)) throw invalid("options", `must be one of ${names.join(", ")}`, { value: name });
    checkKind(name as keyof Message, message);
  }
  return message;
}

export function optionsOf(message: Message | undefined): SolveOptions {
  const { path, method, retraction, ...rest } = Message.fromPartial(message ?? {});
  return {
    ...rest,
    path: path === undefined ? undefined : word(Path, "PATH_", path),
    method: method === undefined ? undefined : word(Method, "METHOD_", method),
    retraction: retraction === undefined ? undefined : word(Retraction, "RETRACTION_", retraction),
  };
}

function choice(name: string, enumeration: object, prefix: string, chosen: string | undefined): number | undefined {
  const value = valueOf(enumeration, prefix, chosen);
  if (value === undefined) {
    throw invalid(`options.${name}`, `must be one of ${words(enumeration, prefix).join(", ")}`, { value: chosen });
  }
  return value === 0 ? undefined : value;
}

// A value of the wrong kind does not survive the way to the server.
function checkKind(name: keyof Message, message: Message): void {
  const value = message[name];
  const fault = (): Error => invalid(`options.${name}`, "is not a value of this option's kind", { value });
  let arrived: unknown;
  try {
    arrived = Message.decode(Message.encode(Message.fromPartial({ [name]: value })).finish())[name];
  } catch {
    throw fault();
  }
  if (!Object.is(arrived, value)) throw fault();
}
