// Solves the hopper's contact problem and draws the plan: the paths of body and foot, the leg, and the contacts.
//
//   marble example hopper > hopper.json && node build/examples/hopper.js hopper.json hopper.svg
import { readFileSync, writeFileSync } from "node:fs";

import { connect } from "@marble/client";

import { type Hopper, at, variables } from "./hopper-model.js";

const problem = JSON.parse(readFileSync(process.argv[2], "utf8")) as Hopper;
const client = connect();
const solution = await client.solve(problem);
client.close();
console.log(String(solution));
writeFileSync(process.argv[3], draw(solution.z));

type Point = [x: number, y: number];

function draw(z: Float64Array): string {
  const steps = Array.from({ length: z.length / variables }, (_, k) => z.subarray(k * variables, (k + 1) * variables));
  const body = steps.map((step): Point => [step[at.bodyX], step[at.bodyZ]]);
  const foot = steps.map((step): Point => [step[at.footX], step[at.footZ]]);
  const right = Math.max(...body.map(([x]) => x)) + 0.3;
  const stairs: Point[] = [
    [-0.3, 0],
    [0.75, 0],
    [0.75, 0.15],
    [1.15, 0.15],
    [1.15, 0.3],
    [1.85, 0.3],
  ];
  stairs.push([1.85, 0.15], [2.25, 0.15], [2.25, 0], [right, 0]);
  const legs = steps.map((step, k) => {
    const stands = step[at.normalForce] > 1e-6;
    const leg = line([body[k], foot[k]], stands ? "#c0392b" : "#9aa5b1", 0.006);
    return leg + dot(foot[k], 0.014, stands ? "#c0392b" : "#9aa5b1") + dot(body[k], 0.022, "#1f4e79");
  });
  // y points down in a picture
  const box = `-0.3 -1.3 ${(right + 0.3).toFixed(2)} 1.45`;
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="${box}" width="1200">
<title>A hopper crosses stairs: the leg is red where the foot stands</title>
<rect x="-0.3" y="-1.3" width="100%" height="100%" fill="white"/>
${line(stairs, "#4a4a4a", 0.012)}
${line(foot, "#e3b7b0", 0.006)}
${line(body, "#8fb4d6", 0.008)}
${legs.join("\n")}
</svg>
`;
}

function line(points: Point[], colour: string, width: number): string {
  const places = points.map(([x, y]) => `${x.toFixed(4)},${(-y).toFixed(4)}`).join(" ");
  return `<polyline points="${places}" fill="none" stroke="${colour}" stroke-width="${width}"/>`;
}

function dot([x, y]: Point, radius: number, colour: string): string {
  return `<circle cx="${x.toFixed(4)}" cy="${(-y).toFixed(4)}" r="${radius}" fill="${colour}"/>`;
}
