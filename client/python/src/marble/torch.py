"""An LCQP as a layer of PyTorch: its answer as a function of its numbers, with gradients by the adjoint."""

from __future__ import annotations

from typing import Any

import torch

from marble.errors import InvalidArgument
from marble.layers import Layer as _Layer


def _array(values: Any) -> Any:
    if not isinstance(values, torch.Tensor) or values.is_complex():
        raise InvalidArgument("numbers", "must be real tensors", value=getattr(values, "dtype", type(values).__name__))
    return values.detach().cpu().double().numpy()


class _Answer(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, layer: _Layer, *numbers: Any) -> tuple[Any, ...]:
        arrays = [_array(values) for values in numbers]
        answers = layer.answers(*arrays)
        ctx.layer, ctx.arrays, ctx.answers, ctx.like = layer, arrays, answers, numbers
        return tuple(torch.from_numpy(values.copy()).to(numbers[0]) for values in layer.of_answers(answers))

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[misc]
    def backward(ctx: Any, *weights: Any) -> tuple[Any, ...]:
        by = [values.detach().cpu().double().numpy() for values in weights]
        gradients = ctx.layer.gradients(ctx.arrays, ctx.answers, by)
        return (None, *(torch.from_numpy(values).to(like) for values, like in zip(gradients, ctx.like, strict=True)))


class Layer(torch.nn.Module):  # type: ignore[misc]
    """As marble.layers.Layer, of tensors: `z = Layer(problem, ["g", "b"])(g, b)`.

    Solves in double precision; what comes back has the kind and the place of the first tensor. Derivatives are of first
    order.
    """

    def __init__(self, problem: Any, parameters: Any, **settings: Any) -> None:
        super().__init__()
        self.layer = _Layer(problem, parameters, **settings)

    def forward(self, *numbers: Any) -> Any:
        """The outputs: one tensor, or a tuple of several."""
        found = _Answer.apply(self.layer, *numbers)
        return found[0] if len(found) == 1 else found


__all__ = ["Layer"]
