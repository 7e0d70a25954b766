import { type BatchAnswer, type BatchControls, type BatchProblem, batch } from "./calls/batch.js";
import { type CallControls, unary } from "./calls/calls.js";
import {
  type CoupledAnswer,
  type CoupledControls,
  type CoupledProblem,
  type Pieces,
  type PiecesAnswer,
  type PiecesControls,
  coupled,
  pieces,
} from "./calls/coupled.js";
import { type ServerInfo, infoOf } from "./calls/info.js";
import { Jobs } from "./calls/jobs.js";
import { type ScenarioAnswer, type ScenarioControls, scenarios } from "./calls/scenarios.js";
import { Session, type SessionControls } from "./calls/session.js";
import { type SolveControls, type SolveEvent, type StreamControls, solve, solveStream } from "./calls/solve.js";
import { type ConnectOptions, defaultAddress } from "./connection/connect-options.js";
import { Connection } from "./connection/connection.js";
import { ServerService } from "./generated/marble/v1/service.js";
import type { Problem } from "./model/problem.js";
import type { Solution } from "./model/solution.js";

/**
 * A connection to a Marble server. Any number of calls at once; what fails rejects with a MarbleError. The connection is
 * made by the first call, and again by a later one if it broke.
 */
export class Client implements Disposable {
  /** Jobs by their ids. */
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

  /** One problem, one answer. A solve that ends without being solved is an answer: see `solution.status`. */
  async solve(problem: Problem, controls: SolveControls = {}): Promise<Solution> {
    return solve(this.connection, problem, controls);
  }

  /** The same as events. The call begins with the loop, and leaving the loop gives it up. */
  solveStream(problem: Problem, controls: StreamControls = {}): AsyncGenerator<SolveEvent, void, undefined> {
    return solveStream(this.connection, problem, controls);
  }

  /** One plan for many worlds: min Σ π q(x, y_s) over one x and a recourse y_s in every sampled world. */
  async scenarios(problem: Problem, controls: ScenarioControls): Promise<ScenarioAnswer> {
    return scenarios(this.connection, problem, controls);
  }

  /** Problems that rows tie together: solved block by block at prices on the rows, last as one on the branch found. */
  async coupled(problem: CoupledProblem, controls: CoupledControls = {}): Promise<CoupledAnswer> {
    return coupled(this.connection, problem, controls);
  }

  /** One long problem cut into pieces, solved as `coupled` does. */
  async pieces(problem: Problem, cut: Pieces, controls: PiecesControls = {}): Promise<PiecesAnswer> {
    return pieces(this.connection, problem, cut, controls);
  }

  /** Sets a session up, and waits until it is ready. */
  async session(problem: Problem, controls: SessionControls = {}): Promise<Session> {
    return Session.open(this.connection, problem, controls);
  }

  /**
   * Many problems on one stream, answered in the order of finishing. A source faster than the server is slowed down; a
   * problem that breaks a rule is answered with its error, told with the next answer, and the others go on.
   */
  batch<Tag>(
    problems: AsyncIterable<BatchProblem<Tag>> | Iterable<BatchProblem<Tag>>,
    controls: BatchControls = {},
  ): AsyncGenerator<BatchAnswer<Tag>, void, undefined> {
    return batch(this.connection, problems, controls);
  }

  /** Version, limits, workers, option schema and counters. */
  async info(controls: CallControls = {}): Promise<ServerInfo> {
    return infoOf(await unary(this.connection, ServerService.getInfo, {}, controls));
  }

  /**
   * Ends the connection once its calls have ended; later calls fail. Until then one to several servers keeps the process
   * alive.
   */
  close(): void {
    this.connection.close();
  }

  /** As `close`, at the end of a `using` block. */
  [Symbol.dispose](): void {
    this.close();
  }
}

/**
 * Checks address and options, and reads the PEM files; nothing is sent yet.
 *
 * @param address host:port or unix:PATH; or several host:port with commas between, or dns:///host:port for every address
 *   that the name has: calls then take turns between those that say they are healthy, and of TLS the first name counts.
 *   Default: the environment's `MARBLE_SERVER`, else 127.0.0.1:50051.
 * @throws InvalidProblemError with the field "address" or that of the option.
 */
export function connect(address: string = defaultAddress(), options: ConnectOptions = {}): Client {
  return new Client(address, options);
}
