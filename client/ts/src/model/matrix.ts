import { invalid } from "../errors.js";
import { mostRows, symmetry } from "../shared/tables.js";

/** A dense matrix: one array per row, all of the same length. Zeros are not part of the pattern. */
export type DenseRows = readonly ArrayLike<number>[];

/** Entries at (i, j) from 0, in any order; duplicates are added. The form of problem files. */
export interface Triplets {
  rows: number;
  cols: number;
  i: ArrayLike<number>;
  j: ArrayLike<number>;
  v: ArrayLike<number>;
}

/** Compressed columns (CSC), with strictly ascending rows in each column. The form of messages. */
export interface CompressedColumns {
  rows: number;
  columns: number;
  /** columns + 1 offsets into the other two arrays, from 0 to the number of entries. */
  columnPointers: ArrayLike<number>;
  rowIndices: ArrayLike<number>;
  values: ArrayLike<number>;
}

/** A matrix in any of these forms. */
export type Matrix = DenseRows | Triplets | CompressedColumns;

/** A checked matrix with its own arrays. */
export interface Csc extends CompressedColumns {
  columnPointers: Int32Array;
  rowIndices: Int32Array;
  values: Float64Array;
}

/** Checks that `values` are `size` finite numbers, and copies them. */
export function takeVector(field: string, values: ArrayLike<number>, size: number, rule: string): Float64Array {
  if (!isArray(values)) throw invalid(field, "must be an array of numbers", { value: values });
  if (values.length !== size) {
    throw invalid(field, `must have ${size} entries (${rule})`, { value: `${values.length} entries` });
  }
  return takeNumbers(field, values);
}

/** Checks every entry and converts to compressed columns. `columns` is the number of variables. */
export function takeMatrix(field: string, matrix: Matrix, columns: number): Csc {
  if (typeof matrix !== "object" || matrix === null) throw invalid(field, "must be a matrix", { value: matrix });
  if (isDense(matrix)) return fromDense(field, matrix, columns);
  const given = "columnPointers" in matrix ? matrix.columns : matrix.cols;
  const name = "columnPointers" in matrix ? "columns" : "cols";
  takeCount(`${field}.rows`, matrix.rows);
  if (given !== columns) throw invalid(`${field}.${name}`, `must be ${columns} (variables)`, { value: given });
  return "columnPointers" in matrix ? fromColumns(field, matrix) : fromTriplets(field, matrix);
}

/**
 * New values for the pattern of `of`, called `origin` in errors: values in its order, or a matrix within the pattern.
 */
export function takeValues(
  field: string,
  given: ArrayLike<number> | Matrix,
  of: Csc,
  origin = "the set-up",
): Float64Array {
  if (isArray(given) && !isDense(given)) {
    return takeVector(`${field}.values`, given as ArrayLike<number>, of.values.length, `${origin}'s entries`);
  }
  const next = takeMatrix(field, given as Matrix, of.columns);
  if (next.rows !== of.rows) throw invalid(`${field}.rows`, `must be ${of.rows} (${origin})`, { value: next.rows });
  const values = new Float64Array(of.values.length);
  for (let column = 0; column < of.columns; ++column) {
    let to = of.columnPointers[column];
    for (let k = next.columnPointers[column]; k < next.columnPointers[column + 1]; ++k) {
      const row = next.rowIndices[k];
      while (to < of.columnPointers[column + 1] && of.rowIndices[to] < row) ++to;
      if (to === of.columnPointers[column + 1] || of.rowIndices[to] !== row) {
        throw invalid(field, `must keep the pattern of ${origin}`, { value: `an entry at (${row}, ${column})` });
      }
      values[to] = next.values[k];
    }
  }
  return values;
}

/** Throws unless Q equals its transpose up to rounding; the solver uses the upper triangle. */
export function checkSymmetric(field: string, q: Csc): void {
  const mirror = transpose(q);
  let sizes: Float64Array | undefined;
  for (let column = 0; column < q.columns; ++column) {
    const differ = (row: number, value: number, mirrored: number): void => {
      if (value === mirrored) return;
      sizes ??= largestEntries(q);
      if (Math.abs(value - mirrored) <= symmetry * Math.sqrt(sizes[row]) * Math.sqrt(sizes[column])) return;
      const [low, high] = [Math.min(row, column), Math.max(row, column)];
      throw invalid(field, `must be symmetric: entry (${low}, ${high}) differs from its mirror image`, {
        value: `${value} and ${mirrored}`,
      });
    };
    merge(q, mirror, column, differ);
  }
}

// The largest entry of row and column i, for each i.
function largestEntries(q: Csc): Float64Array {
  const sizes = new Float64Array(q.columns);
  for (let column = 0; column < q.columns; ++column) {
    for (let k = q.columnPointers[column]; k < q.columnPointers[column + 1]; ++k) {
      for (const i of [q.rowIndices[k], column]) sizes[i] = Math.max(sizes[i], Math.abs(q.values[k]));
    }
  }
  return sizes;
}

function merge(a: Csc, b: Csc, column: number, visit: (row: number, value: number, mirrored: number) => void): void {
  let [i, j] = [a.columnPointers[column], b.columnPointers[column]];
  const [iEnd, jEnd] = [a.columnPointers[column + 1], b.columnPointers[column + 1]];
  while (i < iEnd || j < jEnd) {
    const rowA = i < iEnd ? a.rowIndices[i] : Infinity;
    const rowB = j < jEnd ? b.rowIndices[j] : Infinity;
    const row = Math.min(rowA, rowB);
    visit(row, rowA === row ? a.values[i++] : 0, rowB === row ? b.values[j++] : 0);
  }
}

function transpose(m: Csc): Csc {
  const columnOf = new Int32Array(m.values.length);
  for (let column = 0; column < m.columns; ++column) {
    columnOf.fill(column, m.columnPointers[column], m.columnPointers[column + 1]);
  }
  return compress(m.columns, m.rows, columnOf, m.rowIndices, m.values);
}

function fromDense(field: string, rows: DenseRows, columns: number): Csc {
  const i: number[] = [];
  const j: number[] = [];
  const v: number[] = [];
  for (let row = 0; row < rows.length; ++row) {
    const entries = takeVector(`${field}[${row}]`, rows[row], columns, "variables");
    for (let column = 0; column < columns; ++column) {
      if (entries[column] === 0) continue;
      i.push(row);
      j.push(column);
      v.push(entries[column]);
    }
  }
  return compress(rows.length, columns, Int32Array.from(i), Int32Array.from(j), Float64Array.from(v));
}

function fromTriplets(field: string, m: Triplets): Csc {
  const values = takeNumbers(`${field}.v`, m.v);
  const rows = takeIndices(`${field}.i`, m.i, values.length, m.rows);
  const columns = takeIndices(`${field}.j`, m.j, values.length, m.cols);
  return compress(m.rows, m.cols, rows, columns, values);
}

function fromColumns(field: string, m: CompressedColumns): Csc {
  const values = takeNumbers(`${field}.values`, m.values);
  const rowIndices = takeIndices(`${field}.rowIndices`, m.rowIndices, values.length, m.rows);
  const pointers = takeIndices(`${field}.columnPointers`, m.columnPointers, m.columns + 1, values.length + 1);
  const pointer = (index: number, bound: string): Error =>
    invalid(`${field}.columnPointers`, bound, { index, value: pointers[index] });
  if (pointers[0] !== 0) throw pointer(0, "must be 0");
  if (pointers[m.columns] !== values.length) throw pointer(m.columns, `must be ${values.length} (entries)`);
  for (let column = 0; column < m.columns; ++column) {
    if (pointers[column + 1] < pointers[column]) throw pointer(column + 1, `must be at least ${pointers[column]}`);
    for (let k = pointers[column] + 1; k < pointers[column + 1]; ++k) {
      if (rowIndices[k] > rowIndices[k - 1]) continue;
      const bound = `must be greater than the entry before it in column ${column}`;
      throw invalid(`${field}.rowIndices`, bound, { index: k, value: rowIndices[k] });
    }
  }
  return { rows: m.rows, columns: m.columns, columnPointers: pointers, rowIndices, values };
}

// Two counting sorts, by row and then by column, keep the order of duplicates, which are added in the given order.
function compress(rows: number, columns: number, i: Int32Array, j: Int32Array, v: Float64Array): Csc {
  const order = sortedBy(j, columns, sortedBy(i, rows));
  const columnPointers = new Int32Array(columns + 1);
  const rowIndices = new Int32Array(v.length);
  const values = new Float64Array(v.length);
  let end = 0;
  let last = -1;
  for (const k of order) {
    if (last >= 0 && i[last] === i[k] && j[last] === j[k]) {
      values[end - 1] += v[k];
    } else {
      rowIndices[end] = i[k];
      values[end++] = v[k];
      columnPointers[j[k] + 1] = end;
    }
    last = k;
  }
  for (let column = 0; column < columns; ++column) {
    columnPointers[column + 1] = Math.max(columnPointers[column + 1], columnPointers[column]);
  }
  return { rows, columns, columnPointers, rowIndices: rowIndices.slice(0, end), values: values.slice(0, end) };
}

function sortedBy(keys: Int32Array, count: number, order?: Int32Array): Int32Array {
  const next = new Int32Array(count + 1);
  for (const key of keys) ++next[key + 1];
  for (let key = 0; key < count; ++key) next[key + 1] += next[key];
  const result = new Int32Array(keys.length);
  for (let position = 0; position < keys.length; ++position) {
    const k = order === undefined ? position : order[position];
    result[next[keys[k]]++] = k;
  }
  return result;
}

function takeNumbers(field: string, values: ArrayLike<number>): Float64Array {
  if (!isArray(values)) throw invalid(field, "must be an array of numbers", { value: values });
  // Reads each number once, because another thread may write to shared memory.
  const numbers = new Float64Array(values.length);
  for (let index = 0; index < numbers.length; ++index) {
    const value = values[index];
    if (!Number.isFinite(value)) throw invalid(field, "must be finite", { index, value });
    numbers[index] = value;
  }
  return numbers;
}

function takeIndices(field: string, values: ArrayLike<number>, size: number, below: number): Int32Array {
  if (!isArray(values)) throw invalid(field, "must be an array of indices", { value: values });
  if (values.length !== size) {
    throw invalid(field, `must have ${size} entries`, { value: `${values.length} entries` });
  }
  const indices = new Int32Array(size);
  for (let index = 0; index < size; ++index) {
    const value = values[index];
    if (!Number.isInteger(value) || value < 0 || value >= below) {
      throw invalid(field, `must be in [0, ${below})`, { index, value });
    }
    indices[index] = value;
  }
  return indices;
}

function takeCount(field: string, value: number): void {
  if (!Number.isInteger(value) || value < 0 || value > mostRows) {
    throw invalid(field, "must be a whole number in [0, 2^28)", { value });
  }
}

function isArray(given: unknown): given is ArrayLike<unknown> {
  return Array.isArray(given) || (ArrayBuffer.isView(given) && !(given instanceof DataView));
}

function isDense(matrix: Matrix | ArrayLike<number>): matrix is DenseRows {
  return Array.isArray(matrix) && (matrix.length === 0 || typeof matrix[0] !== "number");
}
