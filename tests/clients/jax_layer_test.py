"""marble.jax with the real package: gradients against finite differences, under jit, vmap and with a batch axis."""

import concurrent.futures
import unittest

import jax

jax.config.update("jax_enable_x64", True)
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
from jax.test_util import check_grads  # noqa: E402
from layer_problem import NAMES, numbers, problem, settings  # noqa: E402

import marble.jax  # noqa: E402


class JaxLayer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.layer = staticmethod(marble.jax.layer(problem(), NAMES, **settings()))
        cls.numbers = [jnp.asarray(values) for values in numbers()]

    def test_gradients_are_the_differences(self):
        check_grads(lambda *n: self.layer(*n), self.numbers, order=1, modes=["rev"], atol=1e-4, rtol=1e-4, eps=1e-6)

    def test_under_jit_and_grad(self):
        loss = lambda *n: jnp.sum(self.layer(*n) ** 2)  # noqa: E731
        plain, jitted = jax.grad(loss)(*self.numbers), jax.jit(jax.grad(loss))(*self.numbers)
        np.testing.assert_allclose(plain, jitted, rtol=1e-12)

    def test_rows_and_vmap_are_one_problem_each(self):
        g = self.numbers[0] + 1e-3 * jnp.arange(3)[:, None]
        rest = self.numbers[1:]
        one = jnp.stack([self.layer(row, *rest) for row in g])
        np.testing.assert_array_equal(self.layer(g, *rest), one)
        np.testing.assert_array_equal(jax.vmap(lambda row: self.layer(row, *rest))(g), one)
        loss = lambda b, values: jnp.sum(self.layer(values, b, *rest[1:]) ** 2)  # noqa: E731
        shared = jax.grad(loss)(rest[0], g)
        each = sum(jax.grad(loss)(rest[0], row) for row in g)
        np.testing.assert_allclose(shared, each, rtol=1e-10)
        mapped = jax.vmap(jax.grad(loss), in_axes=(None, 0))(rest[0], g)
        np.testing.assert_allclose(mapped.sum(axis=0), each, rtol=1e-10)

    def test_wrong_arrays_are_refused_while_it_is_traced(self):
        one = marble.jax.layer(problem(), ["g"], **settings())
        g = self.numbers[0]
        for wrong in (g[:3], g[0], jnp.tile(g, (2, 2, 1)), g * 1j):
            for call in (one, jax.jit(one), jax.grad(lambda values: one(values).real.sum(), holomorphic=False)):
                with self.assertRaises((marble.InvalidArgument, TypeError)):
                    call(wrong)
        with self.assertRaises(marble.InvalidArgument):
            one()
        with self.assertRaises(marble.InvalidArgument):
            jax.vmap(one)(g)

    def test_no_rows_have_no_answers_and_no_gradients(self):
        one = marble.jax.layer(problem(), ["g"], **settings())
        rows = jnp.zeros((0, 6))
        for z in (one(rows), jax.vmap(one)(rows), jax.grad(lambda values: one(values).sum())(rows)):
            self.assertEqual(z.shape, (0, 6))

    def test_a_failed_solve_is_an_error_that_names_its_reason(self):
        falls = marble.jax.layer(marble.LCQP(None, [1.0], C=[1.0]), ["g"])
        for call in (falls, jax.jit(falls), jax.grad(lambda g: falls(g).sum()), jax.vmap(falls)):
            with self.assertRaisesRegex(Exception, "Unsolved: unbounded"):
                jax.block_until_ready(call(-jnp.ones((2, 1)) if call is not falls else -jnp.ones(1)))
        with marble.Client("local") as client:
            closed = marble.jax.layer(problem(), ["g"], client=client)
        with self.assertRaisesRegex(Exception, "the client is closed"):
            jax.block_until_ready(closed(self.numbers[0]))

    def test_threads_share_a_layer(self):
        expected = self.layer(*self.numbers)
        with concurrent.futures.ThreadPoolExecutor(4) as pool:
            for z in pool.map(lambda _: self.layer(*self.numbers), range(16)):
                np.testing.assert_array_equal(z, expected)


if __name__ == "__main__":
    unittest.main()
