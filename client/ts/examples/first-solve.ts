// Finds the point nearest to (1, 1, 3) that has one of its first two coordinates at zero.
import { connect } from "@marble/client";

const client = connect(); // MARBLE_SERVER, else 127.0.0.1:50051

const solution = await client.solve({
  name: "first",
  Q: [
    [2, 0, 0],
    [0, 2, 0],
    [0, 0, 2],
  ],
  g: [-2, -2, -6],
  c0: 11,
  C: [[0, 0, -1]], // z2 ≤ 2
  d: [2],
  L: [[1, 0, 0]], // 0 ≤ z0 ⊥ z1 ≥ 0
  R: [[0, 1, 0]],
});

console.log(String(solution));
console.log("z =", solution.z);
client.close();
