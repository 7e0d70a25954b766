// Enumerations of the contract as strings without prefix: STATUS_ITERATION_LIMIT is "iteration_limit".

/** The strings of an enumeration whose names start with `Prefix`. */
export type Words<Enumeration, Prefix extends string> = keyof Enumeration extends infer Name
  ? Name extends `${Prefix}${infer Word}`
    ? Word extends "UNSPECIFIED"
      ? never
      : Lowercase<Word>
    : never
  : never;

interface Numbers {
  [number: number]: string;
}

/** The string of a value; undefined for the unspecified value and for values of a newer server. */
export function word<Enumeration extends Numbers, Prefix extends string>(
  enumeration: Enumeration,
  prefix: Prefix,
  value: number,
): Words<Enumeration, Prefix> | undefined {
  const name = enumeration[value];
  if (value <= 0 || name === undefined) return undefined;
  return name.slice(prefix.length).toLowerCase() as Words<Enumeration, Prefix>;
}

/** All strings, in the order of their numbers. */
export function words(enumeration: object, prefix: string): string[] {
  return Object.keys(enumeration)
    .filter((name) => name.startsWith(prefix) && name !== `${prefix}UNSPECIFIED`)
    .map((name) => name.slice(prefix.length).toLowerCase());
}

/** The value of a string, 0 if none is given; undefined if the enumeration does not contain it. */
export function valueOf(enumeration: object, prefix: string, chosen: string | undefined): number | undefined {
  if (chosen === undefined) return 0;
  if (!words(enumeration, prefix).includes(chosen)) return undefined;
  return (enumeration as Record<string, number>)[prefix + chosen.toUpperCase()];
}
