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


if __name__ == "__main__":
    unittest.main()
