"""Published nonlinear problems with pairs, each with its best known objective; formulas for any scalars.

S. Leyffer's MacMPEC (kth, jr, ralph, scholtes, df1, bard, bilevel, gauvin, stackelberg, nash, desilva, gnash, hakonsen,
design-cent, ex9.2.8), J. Outrata (outrata), F. Murphy, H. Sherali, A. Soyster (oligopoly), P. Clark, A. Westerberg
(clark), Z. Gumus, C. Floudas (gumus), J. Falk, J. Liu (falk), J. Bard (bard91).
"""

import dataclasses
import math
from collections.abc import Callable

FREE = math.inf


@dataclasses.dataclass(frozen=True)
class Problem:
    """min f, equalities = 0, inequalities >= 0, 0 <= G ⊥ H >= 0, lower <= x <= upper.

    best: as published, with its digits. parts: of the scalars of x and a function exp for such scalars, a dictionary of
    f and any of equalities, inequalities, G and H.
    """

    name: str
    best: str
    start: list[float]
    parts: Callable
    lower: list[float] | None = None
    upper: list[float] | None = None

    @property
    def bounds(self):
        """Of each variable."""
        n = len(self.start)
        return self.lower or [-FREE] * n, self.upper or [FREE] * n

    @property
    def tolerance(self):
        """What an objective may be above the best known one: 1e-5 of it, and half a unit of its last digit."""
        digits = len(self.best.partition(".")[2])
        return 1e-5 * max(1.0, abs(float(self.best))) + (0.5 * 10.0**-digits if digits else 0.0)


def pair(name, best, start, f, G, H, lower=None):
    """Of two variables and one pair."""
    return Problem(name, best, start, lambda x, exp: {"f": f(*x), "G": [G(*x)], "H": [H(*x)]}, lower)


def outrata(name, best, more):
    def parts(v, exp):
        x, a, b, c, d = v
        return {"f": 0.5 * ((a - 3) ** 2 + (b - 4) ** 2) + more(v), "G": [a, b, c, d],
                "H": [(1 + 0.2 * x) * a - (3 + 1.333 * x) - 0.333 * c + 2 * a * d,
                      (1 + 0.1 * x) * b - x + c + 2 * b * d, 0.333 * a - b + 1 - 0.1 * x,
                      9 + 0.1 * x - a**2 - b**2]}

    return Problem(name, best, [0, 3, 4, 0, 0], parts, [0] * 5, [10] + [FREE] * 4)


COST, BETA = [10, 8, 6, 4, 2], [1.2, 1.1, 1.0, 0.9, 0.8]


def profit(v, gamma):
    """The leader's loss, and what the price is and depends on."""
    total = v[0] + v[1] + v[2] + v[3] + v[4]
    price = 5000.0 ** (1 / gamma) * total ** (-1 / gamma)
    loss = COST[0] * v[0] + BETA[0] / (BETA[0] + 1) * 5.0 ** (-1 / BETA[0]) * v[0] ** ((BETA[0] + 1) / BETA[0])
    return loss - v[0] * price, price, total


def oligopoly(name, gamma, best):
    def parts(v, exp):
        f, price, total = profit(v, gamma)
        G, H = [], []
        for i in range(1, 5):
            marginal = COST[i] + 5.0 ** (-1 / BETA[i]) * v[i] ** (1 / BETA[i]) - price + v[i] * price / (gamma * total)
            G += [v[i] - 1e-3, v[4 + i]]
            H += [marginal + v[4 + i], 150 - v[i]]
        return {"f": f, "G": G, "H": H}

    return Problem(name, best, [50, 40, 40, 40, 40, 0, 0, 0, 0], parts, [1e-3] * 5 + [0] * 4, [150] * 5 + [FREE] * 4)


def gnash(name, gamma, limit, best):
    def parts(v, exp):
        f, price, total = profit(v, gamma)
        made = {"f": f, "equalities": [], "G": [], "H": []}
        for i in range(1, 5):
            at_zero, at_limit = v[3 + 2 * i], v[4 + 2 * i]
            made["equalities"].append(COST[i] + 5.0 ** (-1 / BETA[i]) * v[i] - price + v[i] * price / (gamma * total)
                                      - at_zero + at_limit)
            made["G"] += [v[i], limit - v[i]]
            made["H"] += [at_zero, at_limit]
        return made

    return Problem(name, best, [min(75.0, limit)] + [0.0] * 12, parts, [0] * 13, [limit] + [FREE] * 12)


def scholtes(first, second, third):
    def parts(v, exp):
        return {"f": first * (v[0] + 1) ** 2 + (v[1] - second) ** 2 + third * (v[2] + 1) ** 2, "G": [v[0]],
                "H": [v[1] - exp(v[0]) - exp(v[2])]}

    return parts


def design_centre(v, exp):
    def inside(k):
        return v[2] ** 2 - (v[3 + 2 * k] - v[0]) ** 2 - (v[4 + 2 * k] - v[1]) ** 2

    def pull(k, j):
        return 2 * (v[3 + 2 * k + j] - v[j]) * v[9 + k]

    return {"f": -3.141592654 * v[2] ** 2,
            "equalities": [1 + pull(0, 0), 2 * v[4] + pull(0, 1), -0.25 + pull(1, 0), -1 + pull(1, 1), pull(2, 0),
                           1 + pull(2, 1)],
            "inequalities": [v[3] + v[4] ** 2, 0.75 - 0.25 * v[5] - v[6], v[8] + 1],
            "G": [v[9], v[10], v[11]], "H": [inside(0), inside(1), inside(2)]}


def bilevel3(v, exp):
    a, b, c, d = v[:4]
    return {"f": -a**2 - 3 * b - 4 * c + d**2,
            "equalities": [2 * c + 2 * v[4] - 3 * v[5] - v[6], 4 * v[5] - 5 - v[4] - v[7],
                           a**2 - 2 * a + b**2 - 2 * c + d + 3 - v[8], b + 3 * c - 4 * d - 4 - v[9], c - v[10],
                           d - v[11]],
            "inequalities": [4 - a**2 - 2 * b], "G": v[8:12], "H": v[4:8]}


def bard3(v, exp):
    a, b, c, d = v[:4]
    return {"f": -a**2 - 3 * b - 4 * c + d**2, "inequalities": [4 - a**2 - 2 * b],
            "G": [a**2 - 2 * a + b**2 - 2 * c + d + 3, b + 3 * c - 4 * d - 4, c, d],
            "H": [v[4], v[5], 2 * c + 2 * v[4] - 3 * v[5], -5 - v[4] + 4 * v[5]]}


def hakonsen(v, exp):
    a, b, leisure, p, q, s, t = v
    return {"f": -((a * b * leisure) ** (1.0 / 3.0)), "equalities": [a * p + b * q + leisure + 25 - 100],
            "inequalities": [p * s * a + q * t * b - 25], "G": [a, b, p, q],
            "H": [1 - p, 1 - q, 3 * a * p * (1 + s) - 100, 3 * b * q * (1 + t) - 100]}


def one(parts):
    """With names for the variables instead of a list."""
    return lambda v, exp: parts(*v)


PROBLEMS = [
    pair("kth1", "0", [1, 1], lambda a, b: a + b, lambda a, b: a, lambda a, b: b),
    pair("kth2", "0", [1, 1], lambda a, b: a + (b - 1) ** 2, lambda a, b: a, lambda a, b: b),
    pair("kth3", "0.5", [1, 1], lambda a, b: 0.5 * (a - 1) ** 2 + (b - 1) ** 2, lambda a, b: a, lambda a, b: b),
    pair("scholtes3", "0.5", [0.5, 0.5], lambda a, b: 0.5 * ((a - 1) ** 2 + (b - 1) ** 2), lambda a, b: a,
         lambda a, b: b),
    pair("jr1", "0.5", [1, 1], lambda a, b: (a - 1) ** 2 + b**2, lambda a, b: b, lambda a, b: b - a),
    pair("jr2", "0.5", [1, 1], lambda a, b: (b - 1) ** 2 + a**2, lambda a, b: b, lambda a, b: b - a),
    pair("ralph1", "0", [1, 1], lambda a, b: 2 * a - b, lambda a, b: b, lambda a, b: b - a, [0, 0]),
    pair("ralph2", "0", [1, 1], lambda a, b: a**2 + b**2 - 4 * a * b, lambda a, b: a, lambda a, b: b),
    Problem("scholtes1", "2", [1, 1, 1], scholtes(1, 2.5, 1), [0, -FREE, 0]),
    Problem("scholtes2", "15", [1, 1, 1], scholtes(1, 0, 10), [0, -FREE, 0]),
    Problem("scholtes4", "0", [0, 1, 0], one(lambda a, b, c: {
        "f": a + b - c, "inequalities": [4 * a - c, 4 * b - c], "G": [a], "H": [b]})),
    Problem("scholtes5", "1", [1, 1, 1], one(lambda a, b, c: {
        "f": (a - 1) ** 2 + (b - 2) ** 2 + (c + 1) ** 2, "G": [a, b], "H": [c, c]}), [0, 0, 0]),
    Problem("ex9.2.8", "1.5", [0, 0, 0, 0], one(lambda a, b, c, d: {
        "f": -4 * a * b + 3 * b + 2 * a + 1, "equalities": [4 * a - 1 - c + d], "G": [b, 1 - b], "H": [c, d]}),
        [0] * 4, [1, FREE, FREE, FREE]),
    Problem("bilevel3", "-12.67871", [0.0] * 12, bilevel3, [0, 0, -FREE, -FREE] + [0] * 8),
    Problem("hakonsen", "-24.3668", [1, 1, 1, 0, 0, 0, 0], hakonsen, [0] * 7),
    Problem("design-cent-1", "-1.86065", [0, 0, 1, -1, 0, 0.2425356, 0.9701425, 0, -1, 0.5, 0.5153882, 0.5],
            design_centre),
    Problem("df1", "0", [0, 0], one(lambda a, b: {
        "f": (a - 1 - b) ** 2, "inequalities": [2 - a**2, 3 - (a - 1) ** 2 - (b - 1) ** 2], "G": [b],
        "H": [b - a**2 + 1]}), [-1, -FREE], [2, FREE]),
    Problem("bard1", "17", [0] * 5, one(lambda x, y, a, b, c: {
        "f": (x - 5) ** 2 + (2 * y + 1) ** 2, "equalities": [2 * (y - 1) - 1.5 * x + a - 0.5 * b + c],
        "G": [3 * x - y - 3, 0.5 * y + 4 - x, 7 - x - y], "H": [a, b, c]}), [0] * 5),
    Problem("bard3", "-12.67871", [0] * 6, bard3, [0] * 6),
    Problem("bard91", "2", [3, 6, 1, 1], one(lambda a, b, c, d: {
        "f": a + c, "G": [b, c, d], "H": [2 - d, a - d, b + c - a - 4]}), [2, 0, 0, 0], [4, FREE, FREE, FREE]),
    Problem("gauvin", "20", [7, 5, 0], one(lambda x, y, u: {
        "f": x**2 + (y - 10) ** 2, "G": [y, u], "H": [4 * (x + 2 * y - 30) + u, 20 - x - y]}), [0] * 3,
        [15, FREE, FREE]),
    Problem("stackelberg1", "-3266.6667", [100, 25, 0], one(lambda x, y, u: {
        "f": 0.5 * x**2 + 0.5 * x * y - 95 * x, "equalities": [2 * y + 0.5 * x - 100 - u], "G": [y], "H": [u]}),
        [0] * 3, [200, FREE, FREE]),
    Problem("nash1", "0", [5, 5, 10, 10, 0, 0], one(lambda a, b, c, d, u, w: {
        "f": 0.5 * ((a - c) ** 2 + (b - d) ** 2),
        "equalities": [-34 + 2 * c + 8.0 / 3.0 * d + u, -24.25 + 1.25 * c + 2 * d + w],
        "G": [15 - b - c, 15 - a - d], "H": [u, w]}), [0, 0, -FREE, -FREE, 0, 0], [10, 10] + [FREE] * 4),
    Problem("desilva", "-1", [0, 0, 1, 1, 0, 0], one(lambda a, b, c, d, u, w: {
        "f": a**2 - 2 * a + b**2 - 2 * b + c**2 + d**2,
        "equalities": [2 * (c - a) + 2 * (c - 1) * u, 2 * (d - b) + 2 * (d - 1) * w],
        "G": [0.25 - (c - 1) ** 2, 0.25 - (d - 1) ** 2], "H": [u, w]}), [0, 0, -FREE, -FREE, 0, 0],
        [2, 2] + [FREE] * 4),
    Problem("clark", "5", [0] * 5, one(lambda x, y, a, b, c: {
        "f": (x - 3) ** 2 + (y - 2) ** 2, "equalities": [2 * (y - 5) + a - 2 * b + 2 * c],
        "G": [1 + 2 * x - y, 2 * y - x - 2, 14 - x - 2 * y], "H": [a, b, c]}), [0, -FREE, 0, 0, 0], [8] + [FREE] * 4),
    Problem("gumus", "2250", [10, 4, 100, 0], one(lambda x, y, a, b: {
        "f": 16 * x**2 + 9 * y**2, "equalities": [4 * (x + y - 20) ** 3 + a - b], "inequalities": [4 * x - y],
        "G": [50 - 4 * x - y, y], "H": [a, b]}), [0] * 4, [12.5, 50, FREE, FREE]),
    Problem("falk", "-2.25", [0, 0, 1, 1, 0, 0, 0, 0], one(lambda a, b, c, d, e, g, h, i: {
        "f": a**2 - 3 * a + b**2 - 3 * b + c**2 + d**2, "equalities": [2 * (c - a) - e + g, 2 * (d - b) - h + i],
        "G": [c - 0.5, 1.5 - c, d - 0.5, 1.5 - d], "H": [e, g, h, i]}), [0, 0, -FREE, -FREE, 0, 0, 0, 0]),
    gnash("gnash10", 1.0, 150, "-230.823"),
    gnash("gnash11", 1.1, 150, "-129.912"),
    gnash("gnash12", 1.3, 150, "-36.9331"),
    gnash("gnash13", 1.5, 150, "-7.06178"),
    gnash("gnash14", 1.7, 150, "-0.179046"),
    gnash("gnash15", 1.0, 50, "-354.699"),
    gnash("gnash16", 1.1, 40, "-241.442"),
    gnash("gnash17", 1.3, 30, "-90.7491"),
    gnash("gnash18", 1.5, 25, "-25.6982"),
    gnash("gnash19", 1.7, 20, "-6.11671"),
    outrata("outrata31", "3.2077", lambda v: 0),
    outrata("outrata32", "3.4494", lambda v: 0.5 * (v[3] - 1) ** 2),
    outrata("outrata33", "4.60425", lambda v: 5 * v[4] ** 2),
    outrata("outrata34", "6.59268", lambda v: 0.5 * ((v[3] - 1) ** 2 + (v[4] - 1) ** 2 + v[0] ** 2)),
    oligopoly("oligopoly10", 1.0, "-343.345"),
    oligopoly("oligopoly11", 1.1, "-203.155"),
    oligopoly("oligopoly13", 1.3, "-68.1357"),
    oligopoly("oligopoly15", 1.5, "-19.1541"),
    oligopoly("oligopoly17", 1.7, "-3.1612"),
]
