import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

import { Solution as Message } from "../src/generated/marble/v1/solution.js";
import { Solution } from "../src/model/solution.js";
import { type SolutionFacts, kindOf, kindText, whatToTry } from "../src/shared/solution-kind.js";

import { test } from "./support/test.js";

const tables = new URL("../../../../tests/answers/", import.meta.url);
const read = (name: string): unknown => JSON.parse(readFileSync(new URL(name, tables), "utf8"));

type Case = { kind: string; text: string; what_to_try: string; facts: Record<string, never> };

test("the kinds of answers follow the table of cases that all languages have", () => {
  for (const { kind, text, what_to_try, facts } of read("kinds.json") as Case[]) {
    const { b_stationary: bStationary, second_order: secondOrder, budget_spent: budgetSpent, global_search: globalSearch } = facts;
    const words = { proved: false, objective: 0, gap: Infinity, starts: 1, ...facts };
    const given = { ...words, bStationary, secondOrder, budgetSpent, globalSearch } as unknown as SolutionFacts;
    assert.deepEqual([kindOf(given), kindText(given), whatToTry(given)], [kind, text, what_to_try]);
  }
});

test("a budget is spent as the table of cases that all languages have says", () => {
  type Budget = { options: Record<string, number>; factorizations: number; detail: string; spent: boolean };
  for (const { options, factorizations, detail, spent } of read("budgets.json") as Budget[]) {
    const { max_local_search_factorizations: maxLocalSearchFactorizations, num_starts: numStarts, effort } = options;
    const used = { maxLocalSearchFactorizations, numStarts, effort };
    const solution = new Solution("", Message.fromPartial({ status: 1, factorizations, detail, options: used }));
    assert.equal(solution.whatToTry.includes("spent max_local_search_factorizations"), spent, solution.whatToTry);
  }
});
