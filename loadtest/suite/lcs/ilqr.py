"""iLQR on MuJoCo's own dynamics: W. Li and E. Todorov, Iterative linear quadratic regulator design for nonlinear
biological movement systems (2004). Derivatives are finite differences of mj_step; the Hessian of the cost is that of
Gauss and Newton, in the tangent space; the Riccati recursion is regularized, and a line search follows."""

import copy
import dataclasses
import time

import mujoco as mj
import numpy as np
from consensus import terminal_cost
from loop import Step

STEPS = 0.5 ** np.arange(8)
REGULARIZATIONS = (1e-6, 1e-2, 1.0, 1e2, 1e4)


@dataclasses.dataclass(frozen=True)
class Options:
    """iterations: at each control step, after first_iterations at the first. timestep: of the plan, in s; difference:
    of the derivatives."""

    iterations: int = 2
    first_iterations: int = 50
    timestep: float = 0.01
    difference: float = 1e-6


class Ilqr:
    """A controller; it plans over the horizon of the others, from its last plan moved on by a control step."""

    def __init__(self, task, options, model, view):
        self._task, self._options = task, options
        self._model = copy.copy(model)
        self._model.opt.timestep = options.timestep
        self._data = mj.MjData(self._model)
        self._steps = round(task.stages * task.dt / options.timestep)
        self._P, self._weight = terminal_cost(task, view.now.lcs), options.timestep / task.dt
        self._low, self._high = view.now.u_min, view.now.u_max
        self._U, self._first = np.zeros((self._steps, model.nu)), True
        self._shift = 1 / task.rate / options.timestep

    def step(self, view):
        begun = time.perf_counter()
        if not self._first:  # inputs are held over the steps of the plan
            at = np.minimum(np.arange(self._steps) + self._shift, self._steps - 1).astype(int)
            self._U = self._U[at]
        count = self._options.first_iterations if self._first else self._options.iterations
        self._first = False
        start = (view.data.qpos.copy(), view.data.qvel.copy(), view.data.qacc_warmstart.copy())
        targets = self._targets(view)
        X, cost = self._roll_out(start, targets, self._U)
        for _ in range(count):
            found = self._improve(start, targets, X, cost)
            if found is None:
                break
            self._U, X, cost = found
        return Step(self._U[0].copy(), time.perf_counter() - begun, not np.isfinite(cost))

    def _targets(self, view):
        """Configurations and velocities of the plan's steps: the task's, whose stages may be longer."""
        task, made = self._task, []
        for k in range(self._steps + 1):
            part = min(k * self._weight, task.stages)
            low = min(int(part), task.stages - 1)
            x = view.x_ref[low] + (part - low) * (view.x_ref[low + 1] - view.x_ref[low])
            made.append(view.now.configuration(x))
        return made

    def _error(self, target, q, v):
        dq = np.zeros(self._model.nv)
        mj.mj_differentiatePos(self._model, dq, 1.0, target[0], q)
        return np.concatenate([dq, v - target[1]])

    def _set(self, q, v, warm=None):
        self._data.qpos[:], self._data.qvel[:] = q, v
        self._data.qacc_warmstart[:] = 0 if warm is None else warm

    def _roll_out(self, start, targets, U, gains=None, around=None, step=1.0):
        """States (q, v) and the cost; with feedback, gains (k, K) around the states of another plan."""
        task, d, cost = self._task, self._data, 0.0
        self._set(*start)
        X = [(start[0], start[1])]
        for k in range(self._steps):
            q, v = X[-1]
            if gains is not None:
                moved = self._error(around[k], q, v)
                U[k] = np.clip(U[k] + step * gains[0][k] + gains[1][k] @ moved, self._low, self._high)
            e = self._error(targets[k], q, v)
            cost += self._weight * (e @ task.Q @ e + U[k] @ task.R @ U[k])
            d.ctrl[:] = U[k]
            mj.mj_step(self._model, d)
            X.append((d.qpos.copy(), d.qvel.copy()))
            if not np.isfinite(d.qvel).all() or np.abs(d.qvel).max() > 1e4:
                return X, np.inf
        e = self._error(targets[-1], *X[-1])
        return X, cost + e @ self._P @ e

    def _improve(self, start, targets, X, cost):
        """One iteration: inputs, states and cost, or None if no step length has a lower cost."""
        derivatives = self._derivatives(X)
        for regularization in REGULARIZATIONS:
            gains = self._backward(targets, X, derivatives, regularization)
            if gains is None:
                continue
            for step in STEPS:
                U = self._U.copy()
                made, price = self._roll_out(start, targets, U, gains, X, step)
                if price < cost * (1 - 1e-9):
                    return U, made, price
        return None

    def _derivatives(self, X):
        m, d, n, made = self._model, self._data, 2 * self._model.nv, []
        for k in range(self._steps):
            self._set(*X[k])
            d.ctrl[:] = self._U[k]
            mj.mj_forward(m, d)  # a warm start of the contact forces
            A, B = np.zeros((n, n)), np.zeros((n, m.nu))
            mj.mjd_transitionFD(m, d, self._options.difference, True, A, B, None, None)
            made.append((A, B))
        return made

    def _backward(self, targets, X, derivatives, regularization):
        task, w = self._task, self._weight
        e = self._error(targets[-1], *X[-1])
        V, v = 2 * self._P, 2 * self._P @ e
        k_all, K_all = np.zeros_like(self._U), np.zeros((self._steps, self._model.nu, V.shape[0]))
        for k in reversed(range(self._steps)):
            A, B = derivatives[k]
            e = self._error(targets[k], *X[k])
            Qx, Qu = 2 * w * task.Q @ e + A.T @ v, 2 * w * task.R @ self._U[k] + B.T @ v
            Qxx, Qux, Quu = 2 * w * task.Q + A.T @ V @ A, B.T @ V @ A, 2 * w * task.R + B.T @ V @ B
            # Inputs at a bound that the gradient pushes outwards stay there.
            free = ~((self._U[k] <= self._low) & (Qu > 0) | (self._U[k] >= self._high) & (Qu < 0))
            if free.any():
                try:
                    solved = np.linalg.solve(Quu[np.ix_(free, free)] + regularization * np.eye(free.sum()),
                                             np.column_stack([Qu, Qux])[free])
                except np.linalg.LinAlgError:
                    return None
                k_all[k, free], K_all[k, free] = -solved[:, 0], -solved[:, 1:]
            step, gain = k_all[k], K_all[k]
            v = Qx + gain.T @ Quu @ step + gain.T @ Qu + Qux.T @ step
            V = Qxx + gain.T @ Quu @ gain + gain.T @ Qux + Qux.T @ gain
            V = (V + V.T) / 2
        return (k_all, K_all) if np.isfinite(k_all).all() else None

    def close(self):
        pass
