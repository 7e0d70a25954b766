import { secondsOrZero } from "../checks.js";
import { errorOf, invalid } from "../errors.js";
import { packDoubles, packIntegers } from "../packed.js";
import { type Words, valueOf, word, words } from "../words.js";
import type { Connection } from "../connection/connection.js";
import {
  ProblemPart as PartNumber,
  ScenarioQuantity_Distribution as DistributionNumber,
  type ScenarioEntries as EntriesMessage,
  type Scenarios as Message,
} from "../generated/marble/v1/scenarios.js";
import { type SolveResponse, SolverService } from "../generated/marble/v1/service.js";
import {
  type OutOfSample,
  ScenarioEnd as EndNumber,
  type SampleAverageStage as StageMessage,
  Status as StatusNumber,
} from "../generated/marble/v1/solution.js";
import type { Problem } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { Solution, type Status } from "../model/solution.js";
import { type CallControls, serverStream } from "./calls.js";
import { type RequestControls, expect, solveRequest } from "./solve.js";

/** A part of a problem's data; for a matrix, the values of its entries column by column. */
export type ProblemPart = Words<typeof PartNumber, "PROBLEM_PART_">;

/** Entries of one part of the base problem. */
export interface ScenarioEntries {
  part: ProblemPart;
  /** Indices of the entries, ascending; default: all. For the Hessian, of the upper triangle. */
  positions?: ArrayLike<number>;
}

/** Scenarios as a table of the data that differ from the base problem. */
export interface ScenarioSamples {
  /** The columns of the table, without duplicates. */
  entries: ScenarioEntries[];
  /** One row per scenario with the values of these entries. */
  values: ArrayLike<number>[];
  /** Weights of the scenarios, > 0; default: equal. */
  weights?: ArrayLike<number>;
}

/** A random number that the server draws for each scenario, and the entries that depend on it. */
export interface ScenarioQuantity {
  /** "uniform" in [location, location + scale), "normal" with this mean and deviation, "lognormal" its exponential. */
  distribution?: Words<typeof DistributionNumber, "DISTRIBUTION_">;
  /** Default 0. */
  location?: number;
  /** Default 1. */
  scale?: number;
  /** Lower limit; smaller numbers are raised to it. */
  least?: number;
  /** Upper limit; larger numbers are lowered to it. */
  most?: number;
  /** Entries to which the number times the gain is added. One gain per entry, or one for all. */
  effects: { entries: ScenarioEntries; gains: ArrayLike<number> }[];
}

/** The variables of the first stage, the scenarios, and the sample sizes. */
export interface ScenarioControls extends Omit<RequestControls, "initialPoint" | "warmStart">, CallControls {
  /** Variables of the first stage, ascending. All others belong to the recourse and may differ between scenarios. */
  firstStage: ArrayLike<number>;
  /**
   * Scenarios as a table, or quantities that the server draws; they depend only on the seed and the scenario's number.
   */
  scenarios: ScenarioSamples | { seed?: number; quantities: ScenarioQuantity[] };
  /** Rows and pairs with first-stage variables only whose data differ between scenarios. */
  own?: { equalities?: ArrayLike<number>; inequalities?: ArrayLike<number>; pairs?: ArrayLike<number> };
  /** Initial sample size; default 1. */
  initialSampleSize?: number;
  /** Growth factor of the sample size, > 1; default 2. */
  growth?: number;
  /** Maximum sample size; default 64. */
  maxSampleSize?: number;
  /** Ends when the 95 % interval of the out-of-sample cost is at most this fraction of the cost; default 0: never. */
  tolerance?: number;
  /** Minimum sample size for this; default 8. */
  minSampleSize?: number;
  /** Maximum fraction of out-of-sample scenarios without feasible recourse for this; default 0.05. */
  maxInfeasibleFraction?: number;
  /** Minimum number of out-of-sample scenarios per stage; default 16. */
  outOfSampleScenarios?: number;
  /** Called after every stage. */
  onStage?: (stage: SampleAverageStage) => void;
  /** Called for every iteration. */
  onProgress?: (row: Progress) => void;
  /** Minimum time between two rows of progress, in seconds; default 0: every iteration. */
  progressIntervalS?: number;
}

/** The result of a stage: the problem with one sample of scenarios. */
export interface SampleAverageStage extends Omit<StageMessage, "status" | "outOfSample"> {
  status: Status | "unknown";
  /** The cost of its plan in out-of-sample scenarios: mean ± halfWidth is the 95 % interval. Absent without any. */
  outOfSample?: OutOfSample;
}

/** The plan of the newest solved stage. */
export interface ScenarioSolution {
  end: Words<typeof EndNumber, "SCENARIO_END_"> | "unknown";
  /** The sample size of that stage; 0 if no stage was solved. */
  scenarios: number;
  /** The plan, in the order of firstStage. */
  x: Float64Array;
  /** The other variables, for each scenario. */
  recourse: Float64Array[];
  /** Scenarios that are infeasible even alone. */
  infeasible: number[];
  stages: SampleAverageStage[];
  /** The solution of the stage's LCQP; z consists of x and the recourse of each scenario. */
  solution: Solution;
}

export async function scenarios(
  connection: Connection,
  problem: Problem,
  controls: ScenarioControls,
): Promise<ScenarioSolution> {
  const request = {
    solve: { ...solveRequest(problem, controls), scenarios: messageOf(controls) },
    progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS),
    iterateEvery: 0,
  };
  const messages = serverStream(connection, SolverService.solveScenarios, request, controls, connection.deadlineMs);
  for await (const { event } of messages) {
    if (event?.$case === "stage") controls.onStage?.(stageOf(event.value));
    if (event?.$case === "progress" && controls.onProgress) event.value.rows.map(progressOf).forEach(controls.onProgress);
    if (event?.$case === "result") return scenarioSolutionOf(event.value);
  }
  throw errorOf("internal", "the server ended the call without a result");
}

export function scenarioSolutionOf(response: SolveResponse): ScenarioSolution {
  const message = expect(response.solution);
  const { scenarios } = message;
  if (scenarios === undefined) {
    throw errorOf("failed_precondition", "this solution has no scenarios: its problem was solved alone");
  }
  const solution = new Solution(response.jobId, message);
  const { scenarios: count, firstStage } = scenarios;
  const own = count > 0 ? (solution.z.length - firstStage) / count : 0;
  return {
    end: word(EndNumber, "SCENARIO_END_", scenarios.end) ?? "unknown",
    scenarios: count,
    x: solution.z.slice(0, firstStage),
    recourse: Array.from({ length: count }, (_, s) => {
      const first = firstStage + s * own;
      return solution.z.slice(first, first + own);
    }),
    infeasible: scenarios.infeasible,
    stages: scenarios.stages.map(stageOf),
    solution,
  };
}

export function stageOf(message: StageMessage): SampleAverageStage {
  return { ...message, status: word(StatusNumber, "STATUS_", message.status) ?? "unknown" };
}

export function messageOf(controls: ScenarioControls): Message {
  const { firstStage, scenarios, own } = controls;
  return {
    firstStage: integers(firstStage),
    ownEqualities: integers(own?.equalities),
    ownInequalities: integers(own?.inequalities),
    ownPairs: integers(own?.pairs),
    scenarios: "quantities" in scenarios ? samplerOf(scenarios.seed ?? 0, scenarios.quantities) : samplesOf(scenarios),
    initialSampleSize: controls.initialSampleSize,
    growth: controls.growth,
    maxSampleSize: controls.maxSampleSize,
    tolerance: controls.tolerance,
    minSampleSize: controls.minSampleSize,
    maxInfeasibleFraction: controls.maxInfeasibleFraction,
    outOfSampleScenarios: controls.outOfSampleScenarios,
  };
}

function samplesOf({ entries, values, weights }: ScenarioSamples): Message["scenarios"] {
  const width = values[0]?.length ?? 0;
  const table = new Float64Array(width * values.length);
  values.forEach((row, i) => {
    if (row.length !== width) throw invalid("scenarios.values", `must have ${width} numbers, as many as the first`, { index: i });
    table.set(Array.from(row), i * width);
  });
  return {
    $case: "samples",
    value: {
      entries: entries.map(entriesOf),
      values: packDoubles(table),
      weights: packDoubles(Float64Array.from(weights ?? [])),
    },
  };
}

function samplerOf(seed: number, quantities: ScenarioQuantity[]): Message["scenarios"] {
  return {
    $case: "sampler",
    value: {
      seed,
      quantities: quantities.map(({ distribution, location, scale, least, most, effects }) => ({
        distribution: valueOf(DistributionNumber, "DISTRIBUTION_", distribution) ?? unknownWord("distribution", distribution),
        location: location ?? 0,
        scale,
        least,
        most,
        effects: effects.map(({ entries, gains }) => ({
          entries: entriesOf(entries),
          gains: packDoubles(Float64Array.from(gains)),
        })),
      })),
    },
  };
}

function entriesOf({ part, positions }: ScenarioEntries): EntriesMessage {
  const number = valueOf(PartNumber, "PROBLEM_PART_", part);
  if (number !== undefined) return { part: number, positions: integers(positions) };
  throw invalid("part", `must be one of ${words(PartNumber, "PROBLEM_PART_").join(", ")}`, { value: part });
}

function integers(values: ArrayLike<number> = []): Uint8Array {
  return packIntegers(Int32Array.from(values));
}

function unknownWord(field: string, value: unknown): never {
  throw invalid(field, `must be one of ${words(DistributionNumber, "DISTRIBUTION_").join(", ")}`, { value });
}
