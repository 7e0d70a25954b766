"""The real JAX: its derivatives, compiled once, the patterns that they are sparse by, and answers here and on a server."""

import pathlib
import tempfile
import unittest

import jax
import jax.numpy as jnp
import numpy as np
from adapter_page import local_and_remote

import marble
from marble.nlp.jax_pattern import pattern_of

STAGES, STEP = 12, 0.2
MASKED = np.array([[1.0, 0, 2], [0, 3, 0]])


def pushed(state, push):
    return jnp.array([state[0] + STEP * state[1], state[1] + STEP * (jnp.sin(state[0]) + push)])


def rollout(x):
    return jax.lax.scan(lambda state, push: (pushed(state, push),) * 2, x[:2], x[2:])[1]


def stages(x):
    x = x.reshape(STAGES, 4)
    return x[1:, :2] - jax.vmap(lambda z: pushed(z[:2], z[2] + z[3]))(x[:-1])


# Name, size of x, function, and how many entries its Jacobian and the Hessian of its squares' sum have at most.
SHAPES = [
    ("one from one", 4, jnp.sin, 4, 4),
    ("a matrix with zeros", 3, lambda x: MASKED @ x, 3, 5),
    ("either branch", 4, lambda x: jnp.where(x[0] > 0, x[1:], 2 * x[:-1]), 6, 10),
    ("a choice between functions", 3, lambda x: jax.lax.cond(x[0] > 0, jnp.sin, lambda z: z[::-1], x), 5, 5),
    ("a loop over time", 6, rollout, 32, 36),
    ("stages", 4 * STAGES, stages, 5 * 2 * (STAGES - 1) - 2 * (STAGES - 1), 600),
    ("places that are set", 3, lambda x: jnp.zeros(5).at[np.array([0, 2])].set(x[:2]).at[3].add(x[2]), 3, 3),
    ("a running sum", 4, jnp.cumsum, 10, 16),
    ("a softmax of rows", 4, lambda x: jax.nn.softmax(x.reshape(2, 2), axis=1), 8, 8),
    ("products by blocks", 16, lambda x: jnp.einsum("ijk,ik->ij", x[:12].reshape(2, 3, 2), x[12:].reshape(2, 2)), 24, 256),
    ("a loop by index", 4, lambda x: jax.lax.fori_loop(0, 3, lambda i, z: z.at[i].multiply(2.0), x), 4, 4),
    ("a table", 3, lambda x: jnp.interp(x, np.array([0.0, 1, 2]), np.array([0.0, 1, 4])), 3, 9),
    ("what is not looked into", 3, jnp.sort, 9, 9),
    ("neighbours", 5, lambda x: jnp.roll(x, 1) * x, 10, 25),
]


class Patterns(unittest.TestCase):
    def test_are_sparse_and_lack_nothing(self):
        random = np.random.default_rng(0)
        for name, size, function, most, most_second in SHAPES:
            with self.subTest(name), jax.enable_x64(True):
                def flat(x, function=function):
                    return jnp.ravel(function(x))

                def slope(x, flat=flat):
                    return jax.grad(lambda at: jnp.sum(flat(at) ** 2))(x)

                for of, entries in ((flat, most), (slope, most_second)):
                    pattern = pattern_of(of, size).toarray()
                    self.assertLessEqual(pattern.sum(), entries)
                    points = 2 * random.normal(size=(10, size))
                    there = np.asarray(jax.jit(jax.vmap(jax.jacfwd(of)))(points)) != 0
                    self.assertFalse((there & ~pattern).any())


def plan(x, p):
    """A mass is pushed towards a wall at 1, which pushes back once it is there."""
    x = x.reshape(STAGES, 4)
    return jnp.sum((x[:, 0] - p["goal"]) ** 2) + 0.01 * jnp.sum(x[:, 2] ** 2) + 1e-3 * jnp.sum(x[:, 3] ** 2)


WALL = {"f": plan, "g": lambda x, p: jnp.concatenate([x[:2] - p["state"], stages(x).ravel()]),
        "G": lambda x, p: 1 - x.reshape(STAGES, 4)[:, 0], "H": lambda x, p: -x.reshape(STAGES, 4)[:, 3]}


class Solving(unittest.TestCase):
    def test_the_lectures_example(self):
        answer = marble.nlp.solve_jax({"f": lambda x: x[0] ** 3 + x[1] ** 2, "g": lambda x: x @ x}, [2, 2], lbx=1, lbg=10,
                                      ubg=10)
        self.assertTrue(answer.solved and answer.b_stationary, answer)
        np.testing.assert_allclose(answer.x, [1, 3], atol=1e-8)
        np.testing.assert_allclose(answer.y, [-1], atol=1e-6)

    def test_rows_with_one_bound_or_two_and_pairs(self):
        problem = {"f": lambda x: -x[1], "g": lambda x: jnp.stack([x[0] - x[1], jnp.sin(x[0])])}
        answer = marble.nlp.solve_jax(problem, [0, 0], lbg=[0, -np.inf], ubg=[5, 0.5])
        self.assertTrue(answer.solved and len(answer.nu) == 3)
        self.assertAlmostEqual(answer.x[1], np.pi / 6)
        # stackelberg1 of MacMPEC
        problem = {"f": lambda x: x[0] ** 2 / 2 + x[0] * x[1] / 2 - 95 * x[0], "G": lambda x: x[1],
                   "H": lambda x: 2 * x[1] + x[0] / 2 - 100}
        answer = marble.nlp.solve_jax(problem, [100, 25], lbx=0, ubx=[200, np.inf])
        self.assertTrue(answer.solved)
        self.assertAlmostEqual(answer.objective, -9800 / 3, 5)

    def test_derivatives_are_the_dense_ones_and_sparse(self):
        p = {"goal": 2.0, "state": np.zeros(2)}
        given, x = marble.nlp.JaxFunctions(WALL, 4 * STAGES, p=p, lbg=0, ubg=0), np.linspace(-1, 1, 4 * STAGES)
        m = marble.nlp.Multipliers(np.linspace(1, 2, 2 * STAGES), np.zeros(0), np.ones(STAGES), np.zeros(STAGES))
        at, curvature = given.derivatives(x), given.hessian(x, m)
        with jax.enable_x64(True):
            np.testing.assert_allclose(at["equalities"].toarray(), jax.jacfwd(lambda x: WALL["g"](x, p))(x), atol=1e-12)
            np.testing.assert_allclose(at["G"].toarray(), jax.jacfwd(lambda x: WALL["G"](x, p))(x), atol=1e-12)
            np.testing.assert_allclose(at["gradient"], jax.grad(lambda x: plan(x, p))(x), atol=1e-12)
            dense = jax.hessian(lambda x: plan(x, p) + WALL["g"](x, p) @ m.y - WALL["G"](x, p) @ m.xi)(x)
            np.testing.assert_allclose(curvature.toarray(), dense, atol=1e-12)
        self.assertEqual(at["equalities"].nnz, 2 + 8 * (STAGES - 1))
        self.assertEqual(curvature.nnz, 3 * STAGES)

    def test_a_plan_has_the_same_bits_on_a_server_and_is_compiled_once(self):
        traced = []

        def counted(x, p):
            traced.append(1)
            return plan(x, p)

        given = marble.nlp.JaxFunctions({**WALL, "f": counted}, 4 * STAGES, p={"goal": 2.0, "state": np.zeros(2)}, lbg=0,
                                        ubg=0)
        with tempfile.TemporaryDirectory() as folder, local_and_remote(pathlib.Path(folder)) as clients:
            def solved(client, goal):
                given.p = {"goal": goal, "state": np.zeros(2)}
                return marble.nlp.solve(given.values, given.derivatives, np.zeros(4 * STAGES), hessian=given.hessian,
                                        server=client)

            answers = [solved(client, 2.0) for client in clients]
            self.assertTrue(answers[0].solved and answers[0].b_stationary, answers[0].detail)
            self.assertEqual(len({answer.x.tobytes() for answer in answers}), 1)
            self.assertLessEqual(answers[0].x[::4].max(), 1 + 1e-6)
            self.assertLess(answers[0].x[3::4].min(), -0.1)  # the wall pushes
            traces = len(traced)
            nearer = solved(clients[0], 0.5)
            self.assertTrue(nearer.solved)
            self.assertEqual(len(traced), traces)

    def test_real_time_iteration_takes_them(self):
        given = marble.nlp.JaxFunctions(WALL, 4 * STAGES, p={"goal": 0.5, "state": np.zeros(2)}, lbg=0, ubg=0)
        with marble.nlp.RealTime(given.values, given.derivatives, np.zeros(4 * STAGES), equalities=[0, 1],
                                 hessian=given.hessian, server="local") as loop:
            state = np.zeros(2)
            for _ in range(30):
                tick = loop.feedback(state)
                self.assertEqual((tick.outcome, tick.why), ("answered", ""))
                state = tick.x[4:6]
        self.assertLess(abs(state[0] - 0.5), 0.1)

    def test_what_is_computed_elsewhere_stays_single(self):
        marble.nlp.solve_jax({"f": lambda x: x @ x}, [1.0])
        self.assertEqual(jnp.ones(2).dtype, np.float32)

    def test_faults_are_named(self):
        def refused(problem, **settings):
            with self.assertRaises(marble.InvalidArgument) as caught:
                marble.nlp.solve_jax(problem, [1.0, 2.0], **settings)
            return caught.exception

        self.assertEqual(refused({"g": jnp.sin}).field, "problem")
        self.assertEqual(refused({"f": jnp.sum, "h": jnp.sin}).field, "problem")
        self.assertEqual(refused({"f": jnp.sin}).field, "problem")
        self.assertEqual(refused({"f": jnp.sum, "G": lambda x: x, "H": lambda x: x[:1]}).field, "values.H")
        fault = refused({"f": jnp.sum, "g": lambda x: jnp.log(jnp.stack([x[0], -x[1]]))}, lbg=0)
        self.assertEqual((fault.field, fault.index), ("values.inequalities", 1))
        self.assertEqual(refused({"f": jnp.sum}, some_option=1).field, "some_option")
        with self.assertRaisesRegex(ZeroDivisionError, "of mine"):
            marble.nlp.solve_jax({"f": self.broken}, [1.0])

    @staticmethod
    def broken(x):
        raise ZeroDivisionError("of mine")


if __name__ == "__main__":
    unittest.main()
