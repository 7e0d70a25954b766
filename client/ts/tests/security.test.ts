import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before } from "node:test";

import { AccessError, type ConnectOptions, UnavailableError, connect } from "@marble/client";

import { corner } from "./support/problems.js";
import { Server, newToken } from "./support/server.js";
import { test } from "./support/test.js";

let directory: string;
const file = (name: string): string => join(directory, name);
const openssl = (...words: string[]): void => {
  execFileSync("openssl", words, { stdio: "ignore" });
};

// A certificate authority, a server's certificate for localhost, and a client's certificate.
before(() => {
  directory = mkdtempSync(join(tmpdir(), "marble-ts-tls-"));
  const key = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
  const sign = ["-CA", file("ca.pem"), "-CAkey", file("ca.key"), "-days", "2", "-copy_extensions", "copy"];
  openssl(
    "req",
    "-x509",
    ...key,
    "-days",
    "2",
    "-subj",
    "/CN=authority",
    "-keyout",
    file("ca.key"),
    "-out",
    file("ca.pem"),
  );
  for (const [name, names] of [
    ["server", "DNS:localhost"],
    ["client", "DNS:planner"],
  ]) {
    const request = ["-subj", `/CN=${name}`, "-addext", `subjectAltName=${names}`, "-out", file(`${name}.csr`)];
    openssl("req", ...key, "-keyout", file(`${name}.key`), ...request);
    openssl("x509", "-req", "-in", file(`${name}.csr`), ...sign, "-out", file(`${name}.pem`));
  }
});

after(() => rmSync(directory, { recursive: true, force: true }));

const serve = (...flags: string[]): Promise<Server> =>
  Server.start(["--tls-certificate", file("server.pem"), "--tls-key", file("server.key"), ...flags]);

const unavailable = (text: RegExp) => (error: unknown): boolean =>
  error instanceof UnavailableError && text.test(error.message);

async function clientName(address: string, options: ConnectOptions): Promise<string> {
  using client = connect(address, options);
  assert.ok((await client.solve(corner)).solved);
  return (await client.info()).client;
}

test("TLS: a client that trusts the authority is served, one that does not is not", async () => {
  await using server = await serve();
  const ca = file("ca.pem");
  assert.equal(await clientName(server.address, { name: "tester", tls: { ca, serverName: "localhost" } }), "tester");
  using untrusting = connect(server.address, { tls: { serverName: "localhost" } });
  await assert.rejects(untrusting.solve(corner), unavailable(/MARBLE_TLS_CA must name the authority that signed the server's certificate$/));
  using misled = connect(server.address, { tls: { ca, serverName: "another.example" } });
  await assert.rejects(misled.solve(corner), UnavailableError);
  using plain = connect(server.address);
  await assert.rejects(plain.solve(corner), unavailable(/; does the server want TLS \(tls, MARBLE_TLS_CA\)/));
});

test("a client with TLS reports that the server has none", async () => {
  await using server = await Server.start();
  using client = connect(server.address, { tls: true });
  await assert.rejects(client.solve(corner), unavailable(/; does the server speak without TLS\?/));
  using unreachable = connect("127.0.0.1:1");
  await assert.rejects(unreachable.solve(corner), (error) => error instanceof UnavailableError && !error.message.includes("TLS"));
});

test("TLS: the certificates of all servers must have the first name", async () => {
  await using one = await serve();
  await using other = await serve();
  const [first, second] = [one, other].map((server) => server.address.split(":")[1]);
  const tls = { ca: file("ca.pem") };
  assert.equal(await clientName(`localhost:${first},127.0.0.1:${second}`, { name: "tester", tls }), "tester");
  using misled = connect(`127.0.0.1:${first},localhost:${second}`, { tls });
  await assert.rejects(misled.solve(corner), UnavailableError);
  using both = connect(`127.0.0.1:${first},127.0.0.1:${second}`, { tls: { ...tls, serverName: "localhost" } });
  assert.ok((await both.solve(corner)).solved);
});

test("the client's certificate determines its name", async () => {
  await using server = await serve("--tls-client-ca", file("ca.pem"));
  const tls = { ca: file("ca.pem"), certificate: file("client.pem"), key: file("client.key"), serverName: "localhost" };
  assert.equal(await clientName(server.address, { name: "somebody", tls }), "cert:planner");
});

test("TLS and token come from the environment", async () => {
  const token = newToken("robot:solve");
  await using server = await Server.start(
    ["--tls-certificate", file("server.pem"), "--tls-key", file("server.key"), "--tokens", "{directory}/tokens"],
    { tokens: token.line },
  );
  const settings = { MARBLE_TLS_CA: file("ca.pem"), MARBLE_TOKEN: token.secret };
  Object.assign(process.env, settings);
  try {
    const port = server.address.split(":").at(-1);
    assert.equal(await clientName(`localhost:${port}`, {}), "robot");
  } finally {
    for (const name of Object.keys(settings)) delete process.env[name];
  }
});

test("a token is required, checked, and limited to its roles", async () => {
  const [solver, observer] = [newToken("planner:solve"), newToken("page:observe")];
  await using server = await Server.start(["--tokens", "{directory}/tokens"], { tokens: solver.line + observer.line });
  assert.equal(await clientName(server.address, { token: solver.secret }), "planner");
  const refused = async (token: string | undefined, code: string): Promise<void> => {
    using client = connect(server.address, { token });
    await assert.rejects(client.solve(corner), (error) => error instanceof AccessError && error.code === code);
  };
  await refused(undefined, "unauthenticated");
  await refused("wrong", "unauthenticated");
  await refused(observer.secret, "permission_denied");
});

test("connect refuses invalid credentials and never quotes a token", () => {
  writeFileSync(file("text"), "no certificate");
  const wrong: [ConnectOptions, string][] = [
    [{ tls: { ca: file("nowhere") } }, "tls.ca"],
    [{ tls: { ca: file("text") } }, "tls.ca"],
    [{ tls: { certificate: file("client.pem") } }, "tls.key"],
    [{ tls: { key: file("client.key") } }, "tls.certificate"],
    [{ tls: { certificate: file("client.pem"), key: file("client.pem") } }, "tls"],
    [{ name: "" }, "name"],
    [{ name: "x".repeat(65) }, "name"],
    [{ deadlineMs: -1 }, "deadlineMs"],
  ];
  for (const [options, field] of wrong) {
    assert.throws(() => connect("localhost:1", options), { name: "InvalidProblemError", field });
  }
  assert.throws(
    () => connect("localhost:1", { token: "se cret" }),
    (error: Error & { field?: string }) => error.field === "token" && !error.message.includes("cret"),
  );
});
