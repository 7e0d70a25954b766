// Solves a problem file with the client for Node, and prints z, multipliers and objective with every bit.
// Usage: node solve.mjs CLIENT_INDEX_JS ADDRESS FILE
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [index, address, file] = process.argv.slice(2);
const { connect } = await import(pathToFileURL(index));
const client = connect(address);
const solution = await client.solve(JSON.parse(readFileSync(file, "utf8")));
client.close();
const { z, equalityMultipliers, inequalityMultipliers, objective } = solution;
const { complementarityMultipliersL, complementarityMultipliersR } = solution;
const pairs = [complementarityMultipliersL, complementarityMultipliersR];
const parts = [z, equalityMultipliers, inequalityMultipliers, ...pairs, [objective]];
// JSON.stringify(-0) is "0".
const text = (x) => (Object.is(x, -0) ? "-0.0" : String(x));
console.log(JSON.stringify(parts.map((part) => Array.from(part, text))).replaceAll('"', ""));
