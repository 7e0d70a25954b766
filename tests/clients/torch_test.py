"""marble.torch with the real package: gradients against finite differences, with a batch axis, in another precision."""

import unittest

import numpy as np
import torch
from layer_problem import NAMES, numbers, problem, settings

import marble.torch


class TorchLayer(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.layer = marble.torch.Layer(problem(), NAMES, **settings())

    def numbers(self):
        return [torch.tensor(values, requires_grad=True) for values in numbers()]

    def test_gradients_are_the_differences(self):
        self.assertTrue(torch.autograd.gradcheck(self.layer, self.numbers(), eps=1e-6, atol=1e-4, rtol=1e-3))

    def test_rows_are_one_problem_each_and_add_up_what_they_share(self):
        g, *rest = self.numbers()
        rows = (g + 1e-3 * torch.arange(3)[:, None]).detach().requires_grad_()
        self.layer(rows, *rest).square().sum().backward()
        shared = rest[0].grad.clone()
        each = torch.zeros_like(shared)
        for row in rows.detach():
            again = self.numbers()[1:]
            self.layer(row, *again).square().sum().backward()
            each += again[0].grad
        torch.testing.assert_close(shared, each)
        self.assertEqual(rows.grad.shape, rows.shape)

    def test_what_comes_back_has_the_kind_of_what_went_in(self):
        z = self.layer(*(values.detach().float() for values in self.numbers()))
        self.assertEqual(z.dtype, torch.float32)
        exact = self.layer(*(values.detach() for values in self.numbers()))
        np.testing.assert_allclose(z.numpy(), exact.numpy(), rtol=1e-4, atol=1e-4)

    def test_wrong_tensors_are_refused(self):
        one = marble.torch.Layer(problem(), ["g"], **settings())
        g = self.numbers()[0].detach()
        for wrong in (g[:3], g[0], g.repeat(2, 2, 1), g * 1j, g * torch.nan, g.numpy(), None):
            with self.assertRaises(marble.InvalidArgument):
                one(wrong)
        with self.assertRaises(marble.InvalidArgument):
            one()

    def test_no_rows_have_no_answers_and_no_gradients(self):
        one = marble.torch.Layer(problem(), ["g", "b"], **settings())
        rows, b = torch.zeros((0, 6), dtype=torch.double, requires_grad=True), self.numbers()[1]
        z = one(rows, b)
        z.sum().backward()
        self.assertEqual((z.shape, rows.grad.shape), ((0, 6), (0, 6)))
        self.assertEqual(b.grad.abs().max(), 0)

    def test_an_unsolved_row_raises_and_a_closed_client_says_so(self):
        falls = marble.torch.Layer(marble.LCQP(None, [1.0], C=[1.0]), ["g"])
        with self.assertRaises(marble.Unsolved):
            falls(torch.tensor([[1.0], [-1.0]], requires_grad=True))
        with marble.Client("local") as client:
            closed = marble.torch.Layer(problem(), ["g"], client=client)
        with self.assertRaises(marble.FailedPrecondition):
            closed(self.numbers()[0])

    def test_what_is_changed_in_place_later_does_not_change_gradients(self):
        one, gradients = marble.torch.Layer(problem(), ["g"], **settings()), []
        for change in (1, 2):
            g = self.numbers()[0]
            z = one(g)
            with torch.no_grad():
                g.mul_(change)
            z.sum().backward()
            gradients.append(g.grad)
        torch.testing.assert_close(*gradients)


if __name__ == "__main__":
    unittest.main()
