// A client of loadtest/batches/run: prints a line of JSON for each answer as it arrives.
// Usage: node client.mjs CLIENT_INDEX_JS batch|array ADDRESSES PROBLEMS
import { writeSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [module, way, addresses, count] = process.argv.slice(2);
const { connect } = await import(pathToFileURL(module));

const emit = (line) => writeSync(1, `${JSON.stringify(line)}\n`);

// As change() of problems.py.
const base = { Q: [[1, 0], [0, 1]], g: [0, 0], L: [[1, 0]], R: [[0, 1]] };
function change(index) {
  const [first, second] = [1 + (index % 7), -Math.sqrt(2 + 2 * index)];
  return { g: [-first, -second], c0: 0.5 * first ** 2 + 1 + index };
}

function* each(made) {
  for (let index = 0; index < Number(count); ++index) yield made(index);
  if (way === "array") emit({ event: "uploading" }); // all are encoded
}

async function* answersOf(client) {
  if (way === "batch") {
    for await (const { tag, ...rest } of client.batch(each((tag) => ({ tag, problem: { ...base, ...change(tag) } }))))
      yield { index: tag, ...rest };
    return;
  }
  const { jobId } = await client.jobs.submitArray(each((index) => ({ update: change(index) })), { base });
  emit({ event: "accepted", job: jobId });
  yield* client.jobs.array(jobId);
}

const client = connect(addresses);
await client.info();
for await (const { index, solution, error } of answersOf(client)) {
  if (error === undefined) emit({ index, objective: solution.objective, z: Array.from(solution.z) });
  else emit({ index, error: String(error) });
}
client.close();
