import { type BatchAnswer, type BatchControls, type BatchProblem, batch } from "./calls/batch.js";
import { type CallControls, unary } from "./calls/calls.js";
import {
  type CoupledSolution,
  type CoupledControls,
  type CoupledProblem,
  type Segments,
  type SegmentsAnswer,
  type SegmentsControls,
  coupled,
  segments,
} from "./calls/coupled.js";
import { type ServerInfo, infoOf } from "./calls/info.js";
import { Jobs } from "./calls/jobs.js";
import { type ScenarioSolution, type ScenarioControls, scenarios } from "./calls/scenarios.js";
import { Session, type SessionControls } from "./calls/session.js";
import { type SolveControls, type SolveEvent, type StreamControls, solve, solveStream } from "./calls/solve.js";
import { type ConnectOptions, defaultAddress } from "./connection/connect-options.js";
import { Connection } from "./connection/connection.js";
import { ServerService } from "./generated/marble/v1/service.js";
import type { Problem } from "./model/problem.js";
import type { Solution } from "./model/solution.js";

/**
 * A client of a Marble server, for any number of concurrent calls. Errors are MarbleErrors. The first call opens the
 * connection, and later calls open it again if it was lost.
 */
export class Client implements Disposable {
  /** Calls for jobs. */
  readonly jobs: Jobs;
  private readonly connection: Connection;

  /** @internal */
  constructor(address: string, options: ConnectOptions) {
    this.connection = new Connection(address, options);
    this.jobs = new Jobs(this.connection);
  }

  get address(): string {
    return this.connection.address;
  }

  /** Solves a problem. A solve that ends unsolved returns a solution, too: see `solution.status`. */
  async solve(problem: Problem, controls: SolveControls = {}): Promise<Solution> {
    return solve(this.connection, problem, controls);
  }

  /** Solves a problem and yields events. The call begins with the loop; leaving the loop cancels it. */
  solveStream(problem: Problem, controls: StreamControls = {}): AsyncGenerator<SolveEvent, void, undefined> {
    return solveStream(this.connection, problem, controls);
  }

  /** Solves a problem with scenarios: min Σ π q(x, y_s) over one x and a recourse y_s for every sampled scenario. */
  async scenarios(problem: Problem, controls: ScenarioControls): Promise<ScenarioSolution> {
    return scenarios(this.connection, problem, controls);
  }

  /**
   * Solves problems coupled by rows: block by block with multipliers of the rows, finally as one on the branch found.
   */
  async coupled(problem: CoupledProblem, controls: CoupledControls = {}): Promise<CoupledSolution> {
    return coupled(this.connection, problem, controls);
  }

  /** Solves one long problem, cut into segments, by the method of `coupled`. */
  async segments(problem: Problem, cut: Segments, controls: SegmentsControls = {}): Promise<SegmentsAnswer> {
    return segments(this.connection, problem, cut, controls);
  }

  /** Opens a session and waits until it is ready. */
  async session(problem: Problem, controls: SessionControls = {}): Promise<Session> {
    return Session.open(this.connection, problem, controls);
  }

  /**
   * Solves many problems over one stream and yields results in the order of finishing. A source that is faster than the
   * server is slowed down. The result of an invalid problem is its error, yielded with the next result; the others
   * continue.
   */
  batch<Tag>(
    problems: AsyncIterable<BatchProblem<Tag>> | Iterable<BatchProblem<Tag>>,
    controls: BatchControls = {},
  ): AsyncGenerator<BatchAnswer<Tag>, void, undefined> {
    return batch(this.connection, problems, controls);
  }

  /** Returns version, limits, workers, option schema and counters of the server. */
  async info(controls: CallControls = {}): Promise<ServerInfo> {
    return infoOf(await unary(this.connection, ServerService.getInfo, {}, controls));
  }

  /**
   * Closes the connection when its calls have ended; later calls fail. An open connection to several servers keeps the
   * process alive.
   */
  close(): void {
    this.connection.close();
  }

  /** Calls `close` at the end of a `using` block. */
  [Symbol.dispose](): void {
    this.close();
  }
}

/**
 * Creates a client. Checks address and options and reads the PEM files, but does not connect yet.
 *
 * @param address host:port or unix:PATH; or several servers as host:port separated by commas, or dns:///host:port for
 *   every address of the name: calls go in turn to the servers that report SERVING, and TLS checks certificates against
 *   the first name. Default: `MARBLE_SERVER`, else 127.0.0.1:50051.
 * @throws InvalidProblemError with the field "address" or the name of the option.
 */
export function connect(address: string = defaultAddress(), options: ConnectOptions = {}): Client {
  return new Client(address, options);
}
