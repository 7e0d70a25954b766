// After Diehl, Bock and Schlöder, "A real-time iteration scheme for nonlinear optimization in optimal feedback control",
// SIAM J. Control Optim. 43 (2005), with an LCQP in place of the QP.
import { checkDeadline } from "../base/checks.js";
import { DeadlineError, RefusedError, UnavailableError, errorOf, invalid } from "../base/errors.js";
import { Session, type SessionControls } from "../calls/session.js";
import type { Shift, ShiftBlock, UpdateControls } from "../calls/session-update.js";
import type { Connection } from "../connection/connection.js";
import { takeVector } from "../model/matrix.js";
import type { SolveOptions } from "../model/options.js";
import type { ProblemUpdate } from "../model/problem.js";
import type { Solution } from "../model/solution.js";
import { Curvature, type CurvatureKind } from "./curvature.js";
import { Functions, type Multipliers, type NonlinearProblem, type Point } from "./functions.js";
import { Lcqp, type Weights } from "./lcqp.js";

/** All of it optional. */
export interface RealTimeSettings
  extends Pick<SessionControls, "priority" | "signal" | "reopen" | "reopenMs" | "onReopen"> {
  /** Variables that are measured: each is fixed at its entry of the measurement, whatever its bounds are. */
  variables?: readonly number[];
  /** Rows of c_E, each of which must be its entry of the measurement, after those of the variables, in place of 0. */
  equalities?: readonly number[];
  /** Default: the Hessian where there is one, else Gauss and Newton's of the residuals. */
  curvature?: CurvatureKind;
  /** Over scale², added to B's diagonal, ≥ 0: keeps steps short. Default 0. */
  diagonal?: number;
  /** Of steps, in units of scale, > 0. Default 1e6. */
  radius?: number;
  /**
   * What a tick without an answer returns: the plan that the last tick returned, the last plan moved on, or the answer of
   * an LCQP whose rows may each lack something, at a price, with what is left of the deadline; where that has no answer
   * either, and where the deadline has passed, the last plan moved on. Default "shifted".
   */
  fallback?: "keep" | "shifted" | "elastic";
  /** How the plan moves on from tick to tick: stretches of x, of c_E, of c_I and of the pairs. Default: it stays. */
  shift?: Shift;
  /** What the shift leaves to do, such as a better last stage; after it. Changes x. */
  moved?: (x: Float64Array) => void;
  /** Of each LCQP; tolerances are 1e-9, of stationarity 1e-8, if they are left out. */
  options?: SolveOptions;
}

/** The plan after one tick, and where it is from. */
export interface RealTimeTick {
  outcome: "answered" | "kept" | "shifted" | "elastic";
  /** The plan, n entries. */
  x: Float64Array;
  /** Of the LCQP; of the last one where this had no answer. */
  multipliers: Multipliers;
  /** Why the LCQP has no answer; else empty. */
  why: string;
  /** Whether the deadline had not passed at the end. */
  deadlineMet: boolean;
  /** max |d_j| / scale_j: how far the plan was off. 0 without an answer. */
  step: number;
  /** Largest that the plan leaves in the linearised rows, with the measurement; without an answer, of the moved plan. */
  violation: number;
  /** Of the LCQP, the elastic one if it was asked: `z` is the step. Absent where the server gave none. */
  solution?: Solution;
}

const tighter = { equalityTolerance: 1e-9, inequalityTolerance: 1e-9, complementarityTolerance: 1e-9 };
const defaults: SolveOptions = { ...tighter, stationarityTolerance: 1e-8 };

/**
 * Real-time iteration: a nonlinear plan in closed loop, by one LCQP a tick. What does not need the measurement is done
 * before it comes. From `client.realTime()`. One call at a time; it ends with an error of its session. With `reopen` that
 * goes on where its server is lost: a tick whose deadline passes before there is one returns the fallback.
 */
export class RealTime implements AsyncDisposable {
  private point: Point;
  private readonly multipliers: Multipliers;
  private readonly curvature: Curvature;
  private readonly lcqp: Lcqp;
  private readonly elastic?: Lcqp;
  private readonly weights: Weights;
  private readonly shiftOfAnswers: Shift;
  private readonly rows: number[];
  private readonly x: Float64Array;
  private session!: Session;
  private elasticSession!: Session;
  private returned: Float64Array;
  private unmeasured: number[] = [];
  private due = false;
  private shiftDue = false;
  private prepared = false;
  private busy = false;

  private constructor(
    private readonly functions: Functions,
    private readonly settings: RealTimeSettings,
    private readonly connection: Connection,
  ) {
    const { variables = [], equalities = [], diagonal = 0, radius = 1e6, fallback = "shifted" } = settings;
    const n = functions.start.length;
    if (!(diagonal >= 0 && diagonal < Infinity)) throw invalid("diagonal", "must be finite and >= 0", { value: diagonal });
    if (!(radius > 0 && radius < Infinity)) throw invalid("radius", "must be finite and > 0", { value: radius });
    if (!["keep", "shifted", "elastic"].includes(fallback))
      throw invalid("fallback", "must be keep, shifted or elastic", { value: fallback });
    checkPlaces("variables", variables, n);
    this.x = functions.start.slice();
    this.returned = this.x.slice();
    this.point = functions.at(this.x);
    const sizes = Object.values(this.point.rows).map((part) => part.length);
    const [mE, mI, pairs] = sizes;
    checkPlaces("equalities", equalities, mE);
    this.rows = [...variables.map((_, k) => mE + k), ...equalities];
    const { shift = {} } = settings;
    checkShift(shift, { variables: n, equalities: mE, inequalities: mI, pairs });
    const moved = (by: number): ShiftBlock[] => (shift.variables ?? []).map((one) => ({ ...one, first: one.first + by }));
    this.shiftOfAnswers = { ...shift, inequalities: [...(shift.inequalities ?? []), ...moved(mI), ...moved(mI + n)] };
    delete this.shiftOfAnswers.variables; // the LCQP begins at d = 0
    const zeros = (size: number): Float64Array => new Float64Array(size);
    this.multipliers = { equalities: zeros(mE), inequalities: zeros(mI), G: zeros(pairs), H: zeros(pairs), bounds: zeros(n) };
    this.weights = { equalities: zeros(mE + variables.length), inequalities: zeros(mI), pairs: zeros(pairs) };
    for (const weights of Object.values(this.weights) as Float64Array[]) weights.fill(1);
    this.curvature = new Curvature(functions, settings.curvature, diagonal, this.x, this.point, this.multipliers);
    const made = (elastic: boolean): Lcqp =>
      new Lcqp(functions, variables, radius, this.point, this.curvature.upper, elastic);
    this.lcqp = made(false);
    if (fallback === "elastic") this.elastic = made(true);
  }

  /** @internal */
  static async open(connection: Connection, problem: NonlinearProblem, settings: RealTimeSettings): Promise<RealTime> {
    const made = new RealTime(new Functions(problem), settings, connection);
    made.session = await made.openSession(made.lcqp);
    try {
      if (made.elastic !== undefined) made.elasticSession = await made.openSession(made.elastic);
    } catch (error) {
      made.session.abandon();
      throw error;
    }
    return made;
  }

  /** How often its session was reopened. */
  get reopened(): number {
    return this.session.reopened;
  }

  /**
   * Moves the plan on, unless there was no tick since the last time, calls the functions there and sends all that does not
   * depend on the measurement.
   * @throws InvalidProblemError of what a function gives, such as "derivatives.G"; whatever has ended the session.
   */
  prepare(): void {
    this.alone();
    this.prepared = false;
    if (this.due) this.move();
    this.due = false;
    this.point = this.functions.at(this.x);
    this.curvature.move(this.x, this.point, this.multipliers);
    this.lcqp.set(this.x, this.point, this.curvature.upper);
    this.unmeasured = this.rows.map((row) => this.lcqp.b[row]);
    for (const row of this.rows) this.lcqp.b[row] = 0; // as if it came as planned
    this.session.prepare(this.lcqp.update(), {
      initialPoint: new Float64Array(this.x.length),
      shift: this.shiftDue ? this.shiftOfAnswers : undefined,
    });
    this.shiftDue = false;
    this.prepared = true;
  }

  /**
   * One LCQP: the plan's answer to a measurement, of as many entries as the settings name. Within `deadlineMs`
   * milliseconds > 0 from now, or what the fallback says. Prepares first if that was not done. Rejects with what
   * `prepare` throws, an InvalidProblemError of field "measurement", and whatever ends the session.
   */
  async feedback(measurement: ArrayLike<number>, deadlineMs?: number): Promise<RealTimeTick> {
    this.alone();
    const begun = performance.now();
    checkDeadline("deadlineMs", deadlineMs);
    const measured = takeVector("measurement", measurement, this.rows.length, "what is measured");
    if (!this.prepared) this.prepare();
    this.prepared = false;
    const late = (): boolean => deadlineMs !== undefined && performance.now() - begun > deadlineMs;
    // What is left, of which the server wants some.
    const left = (): number | undefined => deadlineMs && Math.max(deadlineMs - (performance.now() - begun), 1e-3);
    this.rows.forEach((row, k) => (this.lcqp.b[row] = this.unmeasured[k] - measured[k]));
    this.busy = true;
    try {
      const b = this.lcqp.b;
      const plain = await ask(this.session, b.length > 0 ? { b } : {}, { deadlineMs: left() });
      let [answer, outcome] = [plain, "answered" as RealTimeTick["outcome"]];
      if (plain.why !== "" && !plain.late && this.elastic !== undefined) {
        // It has nothing to do most of the time, and may have been ended for that.
        if (!this.elasticSession.isOpen) this.elasticSession = await this.openSession(this.elastic);
        this.elastic.set(this.x, this.point, this.curvature.upper);
        this.elastic.b.set(b);
        this.elastic.setWeights(this.weights);
        answer = await ask(this.elasticSession, this.elastic.update(), { cold: true, deadlineMs: left() });
        outcome = "elastic";
      }
      const found = answer.why === "" ? answer.solution : undefined;
      const why = outcome === "elastic" && found === undefined ? `${plain.why}; elastic: ${answer.why}` : plain.why;
      const tick = found !== undefined ? this.taken(found, outcome) : this.fallenBack();
      this.returned = tick.x.slice();
      this.due = true;
      return { ...tick, why, deadlineMet: !answer.late && !late(), solution: answer.solution };
    } finally {
      this.busy = false;
    }
  }

  /** Another plan to go on from, n entries; it is not moved on first. */
  restart(x: ArrayLike<number>): void {
    this.alone();
    this.x.set(takeVector("x", x, this.x.length, "variables"));
    this.returned = this.x.slice();
    this.due = this.prepared = false;
  }

  /** Ends its session. */
  async close(): Promise<void> {
    await Promise.all([this.session.close(), this.elastic && this.elasticSession.close()]);
  }

  /** As `close`, at the end of an `await using` block. */
  async [Symbol.asyncDispose](): Promise<void> {
    await this.close();
  }

  private async openSession(lcqp: Lcqp): Promise<Session> {
    const { priority, signal, reopen, reopenMs, onReopen, options } = this.settings;
    lcqp.set(this.x, this.point, this.curvature.upper);
    const controls = { priority, signal, reopen, reopenMs, options: { ...defaults, ...options } };
    return Session.open(this.connection, lcqp.problem(), lcqp === this.lcqp ? { ...controls, onReopen } : controls);
  }

  private alone(): void {
    if (this.busy) throw errorOf("failed_precondition", "a feedback is under way: one call at a time");
  }

  private move(): void {
    const { shift = {}, moved } = this.settings;
    const { equalities, inequalities, G, H, bounds } = this.multipliers;
    for (const vector of [this.x, bounds]) shiftBy(shift.variables, vector);
    shiftBy(shift.equalities, equalities);
    shiftBy(shift.inequalities, inequalities);
    for (const side of [G, H]) shiftBy(shift.pairs, side);
    moved?.(this.x);
    this.shiftDue = true;
  }

  private taken(solution: Solution, outcome: RealTimeTick["outcome"]): RealTimeTick {
    const { d, size, multipliers } = (outcome === "elastic" && this.elastic ? this.elastic : this.lcqp).read(solution);
    d.forEach((by, j) => (this.x[j] += by));
    const { equalities, inequalities, G, H } = multipliers;
    raise(this.weights.equalities, equalities);
    raise(this.weights.inequalities, inequalities);
    raise(this.weights.pairs, G.map((value, k) => Math.max(Math.abs(value), Math.abs(H[k]))));
    multipliers.equalities = equalities.slice(0, this.multipliers.equalities.length);
    Object.assign(this.multipliers, multipliers);
    return this.tick(outcome, this.x, size, this.lcqp.violation(d));
  }

  private fallenBack(): RealTimeTick {
    const kept = this.settings.fallback === "keep";
    const violation = this.lcqp.violation(new Float64Array(this.x.length));
    return this.tick(kept ? "kept" : "shifted", kept ? this.returned : this.x, 0, violation);
  }

  private tick(outcome: RealTimeTick["outcome"], x: Float64Array, step: number, violation: number): RealTimeTick {
    const { equalities, inequalities, G, H, bounds } = this.multipliers;
    const multipliers = {
      equalities: equalities.slice(),
      inequalities: inequalities.slice(),
      G: G.slice(),
      H: H.slice(),
      bounds: bounds.slice(),
    };
    return { outcome, x: x.slice(), multipliers, why: "", deadlineMet: true, step, violation };
  }
}

interface Asked {
  /** Empty if the solution is one. */
  why: string;
  late: boolean;
  solution?: Solution;
}

async function ask(session: Session, update: ProblemUpdate, controls: UpdateControls): Promise<Asked> {
  let solution: Solution;
  try {
    solution = await session.update(update, controls);
  } catch (error) {
    const late = error instanceof DeadlineError || error instanceof UnavailableError;
    if (!(late || error instanceof RefusedError) || !session.isOpen) throw error;
    return { why: error.message, late };
  }
  if (solution.status === "cancelled") throw errorOf("cancelled", "stopped within a tick");
  if (!solution.solved) return { why: `${solution.status}: ${solution.detail}`, late: false, solution };
  const saddle = "the LCQP's answer is a saddle point: it wants a larger diagonal";
  return { why: solution.secondOrder === "saddle" ? saddle : "", late: false, solution };
}

function shiftBy(blocks: ShiftBlock[] | undefined, vector: Float64Array): void {
  for (const { first, count, by } of blocks ?? []) vector.copyWithin(first, first + by, first + count);
}

function checkPlaces(field: string, places: readonly number[], size: number): void {
  places.forEach((place, index) => {
    if (!Number.isInteger(place) || place < 0 || place >= size)
      throw invalid(field, `must be in [0, ${size})`, { index, value: place });
    if (places.indexOf(place) !== index) throw invalid(field, "must not be named twice", { index, value: place });
  });
}

function checkShift(shift: Shift, sizes: Record<keyof Shift, number>): void {
  for (const name of Object.keys(sizes) as (keyof Shift)[]) {
    for (const [k, { first, count, by }] of (shift[name] ?? []).entries()) {
      const within = (part: string, value: number, most: number): void => {
        if (Number.isInteger(value) && value >= 0 && value <= most) return;
        throw invalid(`shift.${name}[${k}].${part}`, `must be a whole number in [0, ${most}]`, { value });
      };
      within("first", first, sizes[name]);
      within("count", count, sizes[name] - first);
      within("by", by, count);
    }
  }
}

// Weights stay strictly above the multipliers, so that no row lacks what it could have.
function raise(weights: Float64Array, multipliers: Float64Array): void {
  weights.forEach((weight, i) => {
    const multiplier = Math.abs(multipliers[i]);
    weights[i] = Math.max(1e-3, 1.001 * Math.max(multiplier, 0.5 * (weight + multiplier)));
  });
}
