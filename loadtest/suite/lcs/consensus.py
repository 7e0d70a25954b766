"""C3 and C3+, consensus ADMM on the LCS of a step, written from their formulas.

C3: A. Aydinoglu, A. Wei, W.-C. Huang, M. Posa, Consensus complementarity control for multi-contact MPC, IEEE Trans.
Robotics 40 (2024). Copies δ of z = (x, λ, u) of each stage are projected onto 0 ≤ λ ⊥ E x + F λ + H u + c ≥ 0; here
exactly, by all 3^m faces. C3+: H. Bui et al., Push anything: single- and multi-object pushing from first sight with
contact-implicit MPC (2025). With η = E x + F λ + H u + c as variables, (λ, η) is projected by a closed form.

An iteration: z minimizes the cost + ‖z − δ + w‖²_G subject to the dynamics; δ is z + w projected in the norm of U;
w ← (w + z − δ)/ρ_scale, G ← ρ_scale G. A last QP ends it, with the copies δ − w, of C3+ δ. Its QPs are solved by OSQP
with the settings of the published code and bounds on the inputs, or ("kkt") by one factorization each, without bounds.
"""

import dataclasses
import itertools
import time

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from loop import Step
from planners import complementarity

MAX_FACES = 100  # of an exact projection by enumeration


@dataclasses.dataclass(frozen=True)
class Options:
    """The weights of C3's options files, one for all entries of a kind. scale: scale_lcs, λ is scaled by |D|/|A|."""

    plus: bool
    qp: str = "osqp"
    g_x: float = 0.1
    g_lambda: float = 0.1
    g_u: float = 0.0
    g_eta: float = 0.1
    u_x: float = 1000.0
    u_lambda: float = 1.0
    u_u: float = 1000.0
    u_eta: float = 1.0
    iterations: int = 10
    rho_scale: float = 2.0
    scale: bool = True


class Blocks:
    """A sparse matrix of dense blocks at fixed places; `values` takes their entries in the order of `add`."""

    def __init__(self, shape):
        self._shape, self._rows, self._columns, self._size = shape, [], [], 0

    def add(self, row, column, shape):
        i, j = np.indices(shape).reshape(2, -1)
        self._rows.append(row + i)
        self._columns.append(column + j)

    def close(self):
        rows, columns = np.concatenate(self._rows), np.concatenate(self._columns)
        self._order = np.lexsort((rows, columns))
        counts = np.bincount(columns, minlength=self._shape[1])
        self.matrix = sp.csc_matrix((np.zeros(rows.size), rows[self._order], np.concatenate([[0], np.cumsum(counts)])),
                                    shape=self._shape)
        return self

    def values(self, blocks):
        return np.concatenate([np.ravel(block) for block in blocks])[self._order]


class Consensus:
    """A controller. Its stages have the variables x, λ, u and, of C3+, η; then comes the last x."""

    def __init__(self, task, options, view):
        lcs = view.now.lcs
        self._task, self._options, self._N = task, options, task.stages
        self._n, self._m, self._k = lcs.nx, lcs.nl, lcs.nu
        n, m, k = self._n, self._m, self._k
        self._x, self._lam, self._u = slice(0, n), slice(n, n + m), slice(n + m, n + m + k)
        self._eta = slice(n + m + k, n + m + k + (m if options.plus else 0))
        self._size = self._eta.stop
        self._P = terminal_cost(task, lcs)
        self._G = self._stage_weights(options.g_x, options.g_lambda, options.g_u, options.g_eta)
        if options.plus:
            self._G[self._x] = self._G[self._u] = 0
        self._U = self._stage_weights(options.u_x, options.u_lambda, options.u_u, options.u_eta)
        if not options.plus and 3**m > MAX_FACES:
            raise ValueError(f"an exact projection has 3^{m} faces")
        self._low, self._high = view.now.u_min, view.now.u_max
        self._bounded = options.qp == "osqp" and bool(np.isfinite([*self._low, *self._high]).any())
        self._lay_out()
        self._osqp = None

    def _stage_weights(self, x, lam, u, eta):
        made = np.zeros(self._size)
        made[self._x], made[self._lam], made[self._u], made[self._eta] = x, lam, u, eta
        return made

    def _lay_out(self):
        n, m, k, N, size = self._n, self._m, self._k, self._N, self._size
        self._variables, per_stage = N * size + n, n + (m if self._options.plus else 0)
        self._equalities = n + N * per_stage
        rows = self._equalities + (N * k if self._bounded else 0)
        A, P = Blocks((rows, self._variables)), Blocks((self._variables, self._variables))
        A.add(0, 0, (n, n))
        for stage in range(N):
            row, at = n + stage * per_stage, stage * size
            for width, column in ((n, 0), (m, n), (k, n + m)):
                A.add(row, at + column, (n, width))
            A.add(row, at + size, (n, n))
            if self._options.plus:
                for width, column in ((n, 0), (m, n), (k, n + m), (m, n + m + k)):
                    A.add(row + n, at + column, (m, width))
            if self._bounded:
                A.add(self._equalities + stage * k, at + n + m, (k, k))
            P.add(at, at, (size, size))
        P.add(N * size, N * size, (n, n))
        self._A, self._H = A.close(), P.close()
        self._upper = sp.triu(sp.csc_matrix((np.arange(self._H.matrix.nnz) + 1.0, self._H.matrix.indices,
                                             self._H.matrix.indptr))).tocsc()
        self._upper_of = self._upper.data.astype(int) - 1

    def _constraints(self, lcs, x0):
        n, m, k, N = self._n, self._m, self._k, self._N
        dynamics = [lcs.A, lcs.D, lcs.B, -np.eye(n)]
        rest, right = [], -lcs.d
        if self._options.plus:
            rest, right = [lcs.E, lcs.F, lcs.H, -np.eye(m)], np.concatenate([-lcs.d, -lcs.c])
        one = dynamics + rest + ([np.eye(k)] if self._bounded else [])
        data = self._A.values([np.eye(n), *itertools.chain.from_iterable([one] * N)])
        equal = np.concatenate([x0, np.tile(right, N)])
        if not self._bounded:
            return data, equal, equal
        return data, np.concatenate([equal, np.tile(self._low, N)]), np.concatenate([equal, np.tile(self._high, N)])

    def _hessian(self, penalty):
        n, size = self._n, self._size
        stage = np.zeros((size, size))
        stage[self._x, self._x], stage[self._u, self._u] = 2 * self._task.Q, 2 * self._task.R
        stage[np.diag_indices(size)] += 2 * penalty
        return self._H.values([stage] * self._N + [2 * self._P])

    def step(self, view):
        lcs, o, begun = view.now.lcs, self._options, time.perf_counter()
        scale = np.linalg.norm(lcs.D) / np.linalg.norm(lcs.A) if o.scale and self._m else 1.0
        scaled = _Scaled(lcs, scale)
        data, low, high = self._constraints(scaled, view.now.x0)
        faces = None if o.plus else self._faces(scaled)
        linear = np.zeros((self._N, self._size))
        linear[:, self._x] = -2 * view.x_ref[:-1] @ self._task.Q
        last = -2 * self._P @ view.x_ref[-1]
        delta, w, G, failed = np.zeros((self._N, self._size)), np.zeros((self._N, self._size)), self._G, 0
        for iteration in range(o.iterations + 1):
            final = iteration == o.iterations
            copies = delta if final and o.plus else delta - w
            gradient = np.concatenate([(linear - 2 * G * copies).ravel(), last])
            z, good = self._solve(self._hessian(G), gradient, data, low, high)
            failed += not good
            stages = z[:-self._n].reshape(self._N, self._size)
            if not final:
                delta = self._project(w + stages, faces)
                w, G = (w + stages - delta) / o.rho_scale, o.rho_scale * G
        solve_s = time.perf_counter() - begun
        lam, u = stages[:, self._lam] / scale, stages[:, self._u]
        return Step(u[0], solve_s, failed > 0, complementarity(lcs, stages[:, self._x], u, lam))

    def _solve(self, hessian, gradient, data, low, high):
        if self._options.qp == "kkt":
            P, A = self._H.matrix, self._A.matrix
            P.data[:], A.data[:] = hessian, data
            K = sp.bmat([[P + 1e-9 * sp.eye(P.shape[0]), A.T], [A, -1e-11 * sp.eye(A.shape[0])]]).tocsc()
            z = sp.linalg.splu(K).solve(np.concatenate([-gradient, low]))[:self._variables]
            return z, bool(np.isfinite(z).all())
        import osqp

        upper = hessian[self._upper_of]
        if self._osqp is None:
            P, A = self._upper.copy(), self._A.matrix.copy()
            P.data[:], A.data[:] = upper, data
            self._osqp = osqp.OSQP()
            self._osqp.setup(P, gradient, A, low, high, verbose=False, eps_abs=1e-5, eps_rel=1e-5, max_iter=1000,
                             rho=1e-4, check_termination=25, warm_starting=True)
        else:
            self._osqp.update(Px=upper, Ax=data, q=gradient, l=low, u=high)
        result = self._osqp.solve()
        good = result.info.status_val in (1, 2) and bool(np.isfinite(result.x).all())
        return (result.x if np.isfinite(result.x).all() else np.zeros(self._variables)), good

    def _project(self, y, faces):
        made = y.copy()
        if self._options.plus:
            lam, eta = y[:, self._lam], y[:, self._eta]
            by_lam = np.maximum(lam, 0) ** 2 * self._options.u_lambda  # what it saves to keep λ, or η
            by_eta = np.maximum(eta, 0) ** 2 * self._options.u_eta
            made[:, self._lam] = np.where(by_eta > by_lam, 0, np.maximum(lam, 0))
            made[:, self._eta] = np.where(by_eta > by_lam, np.maximum(eta, 0), 0)
            return made
        rows, offset, cases = faces
        best = np.full(len(y), np.inf)
        for active, back in cases:
            near = y - (y @ rows[active].T + offset[active]) @ back.T
            inside = (near @ rows.T + offset >= -1e-8).all(axis=1)
            price = np.where(inside, ((near - y) ** 2) @ self._U, np.inf)
            better = price < best
            made[better], best[better] = near[better], price[better]
        return made

    def _faces(self, lcs):
        """Rows of λ and of E x + F λ + H u + c; of each face its active rows, and the map of what they violate to the
        nearest point."""
        m = self._m
        rows = np.vstack([np.hstack([np.zeros((m, self._n)), np.eye(m), np.zeros((m, self._k))]),
                          np.hstack([lcs.E, lcs.F, lcs.H])])
        weighted, cases = rows / self._U, []
        for sides in itertools.product((0, 1, 2), repeat=m):
            active = np.array([j + m * side for j, choice in enumerate(sides)
                               for side in ((choice,) if choice < 2 else (0, 1))])
            gram = rows[active] @ weighted[active].T
            try:
                cases.append((active, np.linalg.solve(gram, weighted[active]).T))
            except np.linalg.LinAlgError:
                continue
        return rows, np.concatenate([np.zeros(m), lcs.c]), cases

    def close(self):
        pass


class _Scaled:
    """The LCS of scaled multipliers: λ = λ'/scale, with the complementarity rows divided by it."""

    def __init__(self, lcs, scale):
        self.A, self.B, self.D, self.d = lcs.A, lcs.B, lcs.D / scale, lcs.d
        self.E, self.F, self.H, self.c = lcs.E * scale, lcs.F, lcs.H * scale, lcs.c * scale


def terminal_cost(task, lcs):
    """P of the task, or the solution of the Riccati equation."""
    return scipy.linalg.solve_discrete_are(lcs.A, lcs.B, task.Q, task.R) if task.P is None else task.P
