import assert from "node:assert/strict";
import { readFileSync } from "node:fs";

import { type SolutionFacts, kindOf, kindText, whatToTry } from "../src/shared/solution-kind.js";

import { test } from "./support/test.js";

type Case = { kind: string; text: string; what_to_try: string; facts: Record<string, never> };

test("the kinds of answers follow the table of cases that all languages have", () => {
  const table = new URL("../../../../tests/answers/kinds.json", import.meta.url);
  for (const { kind, text, what_to_try, facts } of JSON.parse(readFileSync(table, "utf8")) as Case[]) {
    const { b_stationary: bStationary, second_order: secondOrder, budget_spent: budgetSpent, global_search: globalSearch } = facts;
    const words = { proved: false, objective: 0, gap: Infinity, numStarts: 1, ...facts };
    const given = { ...words, bStationary, secondOrder, budgetSpent, globalSearch } as unknown as SolutionFacts;
    assert.deepEqual([kindOf(given), kindText(given), whatToTry(given)], [kind, text, what_to_try]);
  }
});
