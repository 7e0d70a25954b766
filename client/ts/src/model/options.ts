import { invalid } from "../errors.js";
import { type Words, valueOf, word, words } from "../words.js";
import { SolveOptions as Message, Method, Path, Retraction } from "../generated/marble/v1/options.js";

/**
 * Solver options; the default of each is the server's. `client.info()` and `marble options` list their defaults,
 * ranges, units and meanings.
 */
export interface SolveOptions extends Partial<Omit<Message, "path" | "method" | "retraction">> {
  /** How the relaxation is driven to 0. */
  path?: Words<typeof Path, "PATH_">;
  /** The algorithm: Marble's, or a reference method for comparison. */
  method?: Words<typeof Method, "METHOD_">;
  /** How one variable parametrizes both sides of a pair. */
  retraction?: Words<typeof Retraction, "RETRACTION_">;
}

const names = Object.keys(Message.fromPartial({}));

/** Checks names and types. The server checks the ranges. */
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
    if (!names.includes(name)) throw invalid("options", `must be one of ${alternatives(name)}`, { value: name });
    checkKind(name as keyof Message, message);
  }
  return message;
}

// Options with the same beginning, else all.
function alternatives(name: string): string {
  const alike = names.filter((one) => one.slice(0, 3) === name.slice(0, 3).toLowerCase());
  return (alike.length > 0 ? alike : names).join(", ");
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

// A value of the wrong type changes when it is encoded.
function checkKind(name: keyof Message, message: Message): void {
  const value = message[name];
  const fault = (): Error => invalid(`options.${name}`, "must be a value of this option's type", { value });
  let arrived: unknown;
  try {
    arrived = Message.decode(Message.encode(Message.fromPartial({ [name]: value })).finish())[name];
  } catch {
    throw fault();
  }
  if (!Object.is(arrived, value)) throw fault();
}
