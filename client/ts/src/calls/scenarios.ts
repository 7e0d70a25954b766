import { secondsOrZero } from "../base/checks.js";
import { errorOf, invalid } from "../base/errors.js";
import { packDoubles, packIntegers } from "../base/packed.js";
import { type Words, valueOf, word, words } from "../base/words.js";
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
  type ScenarioLevel as LevelMessage,
  Status as StatusNumber,
} from "../generated/marble/v1/solution.js";
import type { Problem } from "../model/problem.js";
import { type Progress, progressOf } from "../model/progress.js";
import { Solution, type Status } from "../model/solution.js";
import { type CallControls, serverStream } from "./calls.js";
import { type RequestControls, expect, solveRequest } from "./solve.js";

/** A part of a problem by its numbers alone; of a matrix the values of its entries, column by column. */
export type ProblemPart = Words<typeof PartNumber, "PROBLEM_PART_">;

/** Entries of one part of the base problem. */
export interface ScenarioEntries {
  part: ProblemPart;
  /** Which, ascending; absent means all of them. Of the Hessian, those of the upper triangle. */
  positions?: ArrayLike<number>;
}

/** Worlds by what differs from the base problem. */
export interface ScenarioSamples {
  /** The columns of the table. No entry twice. */
  entries: ScenarioEntries[];
  /** A row for each world: the numbers of all these entries. */
  values: ArrayLike<number>[];
  /** Of the worlds, > 0; absent means that all weigh alike. */
  weights?: ArrayLike<number>;
}

/** A random number that the server draws once for each world, and what it moves. */
export interface ScenarioQuantity {
  /** "uniform" in [location, location + scale), "normal" with that mean and deviation, "lognormal" its exponential. */
  distribution?: Words<typeof DistributionNumber, "DISTRIBUTION_">;
  /** Default 0. */
  location?: number;
  /** Default 1. */
  scale?: number;
  /** What is below becomes this. */
  least?: number;
  /** What is above becomes this. */
  most?: number;
  /** Entries that are the base problem's plus the number times their gains: one for each, or one for all. */
  effects: { entries: ScenarioEntries; gains: ArrayLike<number> }[];
}

/** Which variables are the plan, which worlds there are, and how many are looked at. */
export interface ScenarioControls extends Omit<RequestControls, "initialPoint" | "warmStart">, CallControls {
  /** Variables that are decided once, ascending; all others are decided anew in every world. */
  firstStage: ArrayLike<number>;
  /** Worlds as a table; or quantities that the server draws, a function of the seed and the world's number alone. */
  worlds: ScenarioSamples | { seed?: number; quantities: ScenarioQuantity[] };
  /** Rows and pairs of the plan alone that differ by world all the same. */
  own?: { equalities?: ArrayLike<number>; inequalities?: ArrayLike<number>; pairs?: ArrayLike<number> };
  /** N of the first level; default 1. */
  firstScenarios?: number;
  /** By which N grows, > 1; default 2. */
  growth?: number;
  /** N of the last level; default 64. */
  mostScenarios?: number;
  /** Ends when the 95 % interval of the cost in worlds not seen is this part of it; default 0: never. */
  tolerance?: number;
  /** But not before N is as large; default 8. */
  leastScenarios?: number;
  /** And not while a larger share of fresh worlds has no recourse; default 0.05. */
  withoutRecourse?: number;
  /** In how many fresh worlds at least a level's plan is tried; default 16. */
  freshScenarios?: number;
  /** Called for every level as it is there. */
  onLevel?: (level: ScenarioLevel) => void;
  /** Called for every iteration. */
  onProgress?: (row: Progress) => void;
  /** Least time between two rows of progress, in seconds; 0, the default, tells every iteration. */
  progressIntervalS?: number;
}

/** What a level came to. */
export interface ScenarioLevel extends Omit<LevelMessage, "status" | "fresh"> {
  status: Status | "unknown";
  /** Its plan in worlds that it has not seen: mean ± halfWidth is the 95 % interval. Absent where none were tried. */
  fresh?: OutOfSample;
}

/** The newest plan that a level has proved good. */
export interface ScenarioAnswer {
  end: Words<typeof EndNumber, "SCENARIO_END_"> | "unknown";
  /** N of the level that it is of; 0 where none was solved. */
  scenarios: number;
  /** The plan, in the order of firstStage. */
  x: Float64Array;
  /** Of each world the other variables. */
  recourse: Float64Array[];
  /** Worlds that have no plan even by themselves. */
  infeasible: number[];
  levels: ScenarioLevel[];
  /** Of the level's LCQP: status, objective, violations; z is the plan and then each world's recourse. */
  solution: Solution;
}

export async function scenarios(
  connection: Connection,
  problem: Problem,
  controls: ScenarioControls,
): Promise<ScenarioAnswer> {
  const request = {
    solve: { ...solveRequest(problem, controls), scenarios: messageOf(controls) },
    progressIntervalS: secondsOrZero("progressIntervalS", controls.progressIntervalS),
    iterateEvery: 0,
  };
  const messages = serverStream(connection, SolverService.solveScenarios, request, controls, connection.deadlineMs);
  for await (const { event } of messages) {
    if (event?.$case === "level") controls.onLevel?.(levelOf(event.value));
    if (event?.$case === "progress" && controls.onProgress) event.value.rows.map(progressOf).forEach(controls.onProgress);
    if (event?.$case === "result") return scenarioAnswerOf(event.value);
  }
  throw errorOf("internal", "the server ended the call without an answer");
}

export function scenarioAnswerOf(response: SolveResponse): ScenarioAnswer {
  const message = expect(response.solution);
  const outcome = message.scenarios;
  if (outcome === undefined) {
    throw errorOf("failed_precondition", "there are no scenarios in this answer: its problem was solved alone");
  }
  const solution = new Solution(response.jobId, message);
  const { scenarios: count, firstStage } = outcome;
  const own = count > 0 ? (solution.z.length - firstStage) / count : 0;
  return {
    end: word(EndNumber, "SCENARIO_END_", outcome.end) ?? "unknown",
    scenarios: count,
    x: solution.z.slice(0, firstStage),
    recourse: Array.from({ length: count }, (_, s) => {
      const first = firstStage + s * own;
      return solution.z.slice(first, first + own);
    }),
    infeasible: outcome.infeasible,
    levels: outcome.levels.map(levelOf),
    solution,
  };
}

export function levelOf(message: LevelMessage): ScenarioLevel {
  return { ...message, status: word(StatusNumber, "STATUS_", message.status) ?? "unknown" };
}

export function messageOf(controls: ScenarioControls): Message {
  const { firstStage, worlds, own } = controls;
  return {
    firstStage: integers(firstStage),
    ownEqualities: integers(own?.equalities),
    ownInequalities: integers(own?.inequalities),
    ownPairs: integers(own?.pairs),
    worlds: "quantities" in worlds ? samplerOf(worlds.seed ?? 0, worlds.quantities) : samplesOf(worlds),
    firstScenarios: controls.firstScenarios,
    growth: controls.growth,
    mostScenarios: controls.mostScenarios,
    tolerance: controls.tolerance,
    leastScenarios: controls.leastScenarios,
    withoutRecourse: controls.withoutRecourse,
    freshScenarios: controls.freshScenarios,
  };
}

function samplesOf({ entries, values, weights }: ScenarioSamples): Message["worlds"] {
  const width = values[0]?.length ?? 0;
  const table = new Float64Array(width * values.length);
  values.forEach((row, i) => {
    if (row.length !== width) throw invalid("worlds.values", `must have ${width} numbers, as many as the first`, { index: i });
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

function samplerOf(seed: number, quantities: ScenarioQuantity[]): Message["worlds"] {
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
