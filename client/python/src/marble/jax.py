"""An LCQP as a function for JAX: its answer by its numbers, with gradients by the adjoint, under jit, grad and vmap."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from marble.errors import InvalidArgument
from marble.layers import Layer as _Layer
from marble.model.derivatives import ANSWER


def layer(problem: Any, parameters: Any, **settings: Any) -> Callable[..., Any]:
    """As marble.layers.Layer, of JAX's arrays: `z = layer(problem, ["g", "b"])(g, b)`; a tuple of several outputs.

    Solves in double precision on the host; with jax_enable_x64 nothing is rounded on the way. Derivatives are
    reverse-mode and of first order.
    """
    own = _Layer(problem, parameters, **settings)

    def rows(numbers: Any) -> tuple[int, ...]:
        counts = [values.shape[0] for values in numbers if values.ndim == 2]
        return (max(counts),) if counts else ()

    def host(work: Callable[..., Any], like: Any, *numbers: Any) -> Any:
        def cast(*arrays: Any) -> Any:
            # vmap adds axes in front: all of them are rows here.
            lead = np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
            flat = [np.broadcast_to(array, (*lead, array.shape[-1])).reshape(-1, array.shape[-1]) if lead else array
                    for array in map(np.asarray, arrays)]
            return tuple(np.asarray(made, spec.dtype).reshape(*lead, made.shape[-1])
                         for made, spec in zip(work(*flat), like, strict=True))

        return jax.pure_callback(cast, like, *numbers, vmap_method="expand_dims")

    def found(*numbers: Any) -> tuple[Any, ...]:
        kind = jnp.result_type(*numbers, jnp.float32)
        like = tuple(jax.ShapeDtypeStruct((*rows(numbers), own.answer_sizes[name]), kind) for name in ANSWER)
        answers: tuple[Any, ...] = host(own.answers, like, *numbers)
        return answers

    @jax.custom_vjp  # type: ignore[misc]
    def answer(*numbers: Any) -> tuple[Any, ...]:
        return own.of_answers(found(*numbers))

    def forward(*numbers: Any) -> tuple[Any, Any]:
        answers = found(*numbers)
        return own.of_answers(answers), (numbers, answers)

    def backward(kept: Any, weights: Any) -> tuple[Any, ...]:
        numbers, answers = kept
        lead = rows(numbers)
        wide = [jnp.broadcast_to(values, (*lead, values.shape[-1])) for values in numbers]
        like = tuple(jax.ShapeDtypeStruct(values.shape, values.dtype) for values in wide)
        count = len(numbers)

        def work(*arrays: Any) -> Any:
            return own.gradients(arrays[:count], arrays[count:count + len(ANSWER)], arrays[count + len(ANSWER):])

        gradients = host(work, like, *wide, *answers, *weights)
        return tuple(whole.reshape(-1, *values.shape).sum(axis=0) if whole.shape != values.shape else whole
                     for whole, values in zip(gradients, numbers, strict=True))

    answer.defvjp(forward, backward)

    def call(*numbers: Any) -> Any:
        arrays = [jnp.asarray(values) for values in numbers]
        own.check_shapes([values.shape for values in arrays])
        for name, values in zip(own.parameters, arrays, strict=True):
            if jnp.iscomplexobj(values):
                raise InvalidArgument(name, "must be real", value=f"of type {values.dtype}")
        outputs = answer(*arrays)
        return outputs[0] if len(outputs) == 1 else outputs

    return call


__all__ = ["layer"]
