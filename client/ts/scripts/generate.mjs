// Generates src/generated from the contract in proto/: one TypeScript module for each of its files.
//
// Packed numbers are generated as `bytes`: both are a length and the numbers' bytes on the wire, so that a vector needs
// one copy between a typed array and the message. A generated decoder would call a function for every number.
import { execFileSync } from "node:child_process";
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const packed = /\brepeated (?:double|float|int32) (\w+ = \d+) \[packed = true\];/g;

const client = join(dirname(fileURLToPath(import.meta.url)), "..");
const contract = join(client, "../../proto");
const output = join(client, "src/generated");
const plugin = join(client, "node_modules/.bin/protoc-gen-ts_proto");
const options = [
  "env=both", // Uint8Array, not Buffer
  "esModuleInterop=true",
  "forceLong=number", // counters and bytes stay below 2^53
  "importSuffix=.js",
  "oneof=unions-value",
  "outputJsonMethods=false",
  "outputPartialMethods=true",
  "outputServices=grpc-js",
  "unrecognizedEnum=false",
  "useExactTypes=false",
  "outputClientImpl=false",
  "useOptionals=none",
];

const work = mkdtempSync(join(tmpdir(), "marble-proto-"));
try {
  const files = ["marble/v1", "google/rpc", "grpc/health/v1"].flatMap((folder) =>
    readdirSync(join(contract, folder)).map((name) => `${folder}/${name}`),
  );
  for (const file of files) {
    const text = readFileSync(join(contract, file), "utf8");
    mkdirSync(dirname(join(work, file)), { recursive: true });
    writeFileSync(join(work, file), text.replace(packed, "bytes $1;"));
  }
  rmSync(output, { recursive: true, force: true });
  mkdirSync(output, { recursive: true });
  execFileSync(
    "protoc",
    [`-I${work}`, `--plugin=${plugin}`, `--ts_proto_out=${output}`, `--ts_proto_opt=${options.join(",")}`, ...files],
    { stdio: "inherit" },
  );
} finally {
  rmSync(work, { recursive: true, force: true });
}
