// Messages of the contract as bytes, for substitutes of a server.

/** A field that is a message, a text or bytes; shorter than 128 bytes. */
export function field(number: number, content: Buffer | string): Buffer {
  const bytes = Buffer.from(content);
  return Buffer.concat([Buffer.from([(number << 3) | 2, bytes.length]), bytes]);
}

/** A field that is a number in [0, 127]. */
export function small(number: number, value: number): Buffer {
  return Buffer.from([number << 3, value]);
}

/** The google.rpc.Status of a full server, which requests a retry at once. */
export function refusal(): Buffer {
  const anyOf = [field(1, "type.googleapis.com/google.rpc.RetryInfo"), field(2, field(1, ""))];
  return Buffer.concat([small(1, 8), field(2, "full"), field(3, Buffer.concat(anyOf))]);
}

/** A SolveResponse without numbers. */
export function solved(): Buffer {
  return field(2, "");
}
