// Packed numbers of messages, which are generated as bytes; scripts/generate.mjs has the reason.
import { endianness } from "node:os";

const foreign = endianness() === "BE";

/** Copies `values`, so that the caller may change them afterwards. */
export function packDoubles(values: ArrayLike<number>): Uint8Array {
  const bytes = new Uint8Array(Float64Array.from(values).buffer);
  return foreign ? swap(bytes, 8) : bytes;
}

export function unpackDoubles(bytes: Uint8Array): Float64Array {
  return new Float64Array(aligned(bytes, 8));
}

export function unpackFloats(bytes: Uint8Array): Float32Array {
  return new Float32Array(aligned(bytes, 4));
}

/** Packs numbers >= 0 as varints of seven bits per byte. */
export function packIntegers(values: Int32Array): Uint8Array {
  const longest = 5;
  const bytes = new Uint8Array(longest * values.length);
  let end = 0;
  for (let k = 0; k < values.length; ++k) {
    let rest = values[k];
    while (rest > 0x7f) {
      bytes[end++] = (rest & 0x7f) | 0x80;
      rest >>>= 7;
    }
    bytes[end++] = rest;
  }
  return bytes.subarray(0, end);
}

/** The inverse of packIntegers. */
export function unpackIntegers(bytes: Uint8Array): Int32Array {
  const values: number[] = [];
  for (let k = 0, value = 0, shift = 0; k < bytes.length; ++k) {
    value |= (bytes[k] & 0x7f) << shift;
    shift += 7;
    if (bytes[k] > 0x7f) continue;
    values.push(value);
    value = shift = 0;
  }
  return Int32Array.from(values);
}

// The bytes of a message may have any offset; a typed array needs an aligned one.
function aligned(bytes: Uint8Array, size: number): ArrayBuffer {
  const copy = new Uint8Array(bytes); // slice() of a Buffer would be a view
  return (foreign ? swap(copy, size) : copy).buffer as ArrayBuffer;
}

function swap(bytes: Uint8Array, size: number): Uint8Array {
  for (let first = 0; first < bytes.length; first += size) bytes.subarray(first, first + size).reverse();
  return bytes;
}

/** A message whose packed numbers are typed arrays. */
export type Unpacked<Message, Numbers> = {
  readonly [Name in keyof Message]: Message[Name] extends Uint8Array ? Numbers : Message[Name];
};

/** Unpacks all packed numbers of a message, which are of one type. */
export function unpacked<Message extends object, Numbers>(
  message: Message,
  unpack: (bytes: Uint8Array) => Numbers,
): Unpacked<Message, Numbers> {
  const fields = Object.entries(message).map(([name, value]) => [name, value instanceof Uint8Array ? unpack(value) : value]);
  return Object.fromEntries(fields) as Unpacked<Message, Numbers>;
}
