import { invalid } from "../base/errors.js";
import { type Words, valueOf, word, words } from "../base/words.js";
import { SolveOptions as Message, Path } from "../generated/marble/v1/options.js";

/**
 * Solver options; what is left out has the server's default. `client.info()` tells each one's default, range, unit and
 * meaning, as does `marble options`.
 */
export interface SolveOptions extends Partial<Omit<Message, "path">> {
  /** How the relaxation is followed to 0. */
  path?: Words<typeof Path, "PATH_">;
}

const names = Object.keys(Message.fromPartial({}));

/** Names and kinds are checked here; ranges are the server's to know. */
export function optionsMessage(options: SolveOptions | undefined): Message | undefined {
  if (options === undefined) return undefined;
  const path = valueOf(Path, "PATH_", options.path);
  if (path === undefined) {
    throw invalid("options.path", `must be one of ${words(Path, "PATH_").join(", ")}`, { value: options.path });
  }
  const message = Message.fromPartial({ ...options, path: path === 0 ? undefined : path });
  for (const name of Object.keys(options)) {
    if (!names.includes(name)) throw invalid("options", `must be one of ${names.join(", ")}`, { value: name });
    checkKind(name as keyof Message, message);
  }
  return message;
}

export function optionsOf(message: Message | undefined): SolveOptions {
  const { path, ...rest } = Message.fromPartial(message ?? {});
  return { ...rest, path: path === undefined ? undefined : word(Path, "PATH_", path) };
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
