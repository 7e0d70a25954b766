"""Targets of a hopper that goes forward in hops: configurations by inverse kinematics, and where to place the foot.

The hop repeats: in a stance the foot rests while the centre of mass is braked and pushed up with constant acceleration;
in a flight the centre of mass falls freely while the foot swings to its next place. Its forward speed is constant. Contact
forces and inputs are the planner's: it need not follow the phases. The place of each further step is shifted by the error
of the capture point x + v sqrt(z / g), as in J. Pratt et al., Capture point: a step toward humanoid push recovery (2006).
"""

import dataclasses
import functools

import mujoco as mj
import numpy as np

GRAVITY = 9.81


@dataclasses.dataclass(frozen=True)
class Gait:
    """speed: m/s. period, flight: s, of a hop and of its flight. clearance: m, of the foot in flight. pause: s at rest
    before the first hop. offset: m, of the centre of mass before the foot's middle. posture: pitch of torso, thigh and
    shank at rest, rad; the foot is level. tolerance: m, errors for which steps are not shifted; reach: m, largest shift. ramp: hops, ever longer, before those at full speed."""

    speed: float
    period: float = 0.3
    flight: float = 0.12
    clearance: float = 0.02
    pause: float = 0.6
    offset: float = 0.08
    posture: tuple = (-0.4, -0.2, 0.5)
    tolerance: float = 0.05
    reach: float = 0.3
    ramp: int = 0
    samples: int = 30


class Hops:
    """The targets of a gait for one model. Outputs are positions of the centre of mass (x, z) and of the foot (x, z,
    pitch), and the torso's pitch: as many as there are joints."""

    def __init__(self, model, gait):
        self.gait, self._model, self._data = gait, model, mj.MjData(model)
        self._foot = model.geom("foot").id
        self._radius = model.geom_size[self._foot][0]
        torso, thigh, shank = gait.posture
        q = np.array([0, 0, torso, torso - thigh, thigh - shank, shank])
        self._place(q)
        q[1] += self._radius - self._data.geom_xpos[self._foot][2]
        self._place(q)
        self._height = self._data.subtree_com[0][2]
        at_rest = np.array([gait.offset, self._height, 0, self._radius, 0, torso])
        self.rest = self._configuration(q, at_rest)
        self._place(self.rest)
        self.jacobian = self._jacobian()
        self._on_the_spot, self._table = self._hop(0.0), self._hop(gait.speed)

    def cost(self, position, velocity, joints):
        """A cost (12, 12) of the outputs' positions and velocities, as linear at rest, and a small one of each joint."""
        J, none = self.jacobian, np.zeros((6, 6))
        Q, V = (J.T @ np.diag(weights) @ J + joints * scale * np.eye(6)
                for weights, scale in ((position, 1.0), (velocity, 0.02)))
        return np.block([[Q, none], [none, V]])

    def capture_cost(self, weight):
        """A cost (12, 12) of the distance of the foot from the capture point, as it is in the gait."""
        row = np.concatenate([self.jacobian[0] - self.jacobian[2], self.jacobian[0] / self._frequency()])
        return weight * np.outer(row, row)

    def target(self, data, time):
        """Configuration and velocity wanted at a time ≥ data.time, for the state of data."""
        q, v = self._nominal(time)
        shift = np.zeros(6)
        shift[0], shift[2] = self._shifts(data.qpos.tobytes(), data.qvel.tobytes(), data.time, time)
        return q + np.linalg.solve(self.jacobian, shift), v

    def _frequency(self):
        return np.sqrt(GRAVITY / self._height)

    def _shifts(self, q, v, now, time):
        """Of the centre of mass and of the foot, in m."""
        centre, foot, captured = self._errors(q, v, now)
        beyond, reach = self.gait.tolerance, self.gait.reach

        def excess(error):
            return float(np.clip(error - np.clip(error, -beyond, beyond), -reach, reach))

        first, step = self._step(now), self._step(time)
        way = (np.ceil(first + 1e-9) - first) if first % 1 else 1.0  # to the next stance
        part = np.clip((step - first) / way, 0, 1)
        part = part * part * (3 - 2 * part)
        return excess(centre), foot + part * (excess(captured) - foot)

    @functools.lru_cache(maxsize=4)  # of the stages of a control step
    def _errors(self, q, v, now):
        measured = self._measures(np.frombuffer(q), np.frombuffer(v))
        wanted = self._measures(*self._nominal(now))
        centre, speed, foot = measured - wanted
        return centre, foot, centre + speed / self._frequency()

    def _measures(self, q, v):
        """Position and speed of the centre of mass, and position of the foot, forward."""
        self._place(q, v)
        mj.mj_subtreeVel(self._model, self._data)
        d = self._data
        return np.array([d.subtree_com[0][0], d.subtree_linvel[0][0], d.geom_xpos[self._foot][0]])

    def _step(self, time):
        """The number of the stance at a time, and a fraction in the flight after it."""
        gait = self.gait
        hop, phase = divmod(max(time - gait.pause, 0.0) / gait.period, 1)
        return hop + float(np.clip((phase * gait.period - (gait.period - gait.flight) / 2) / gait.flight, 0, 1))

    def _nominal(self, time):
        """Without shifts. The hops begin in the middle of a stance, and grow from rest in 0.2 s."""
        since, step = time - self.gait.pause, 0.005
        before, after = (self._position(since + side) for side in (-step, step))
        return self._position(since), (after - before) / (2 * step)

    def _position(self, since):
        if since <= 0:
            return self.rest
        hop, phase = divmod(since / self.gait.period, 1)
        at = phase * self.gait.samples
        k = min(int(at), self.gait.samples - 1)
        part, before = min(1.0, (hop + 1) / (self.gait.ramp + 1)), min(hop, self.gait.ramp)
        table = part * self._table[k:k + 2] + (1 - part) * self._on_the_spot[k:k + 2]
        q = table[0] + (at - k) * (table[1] - table[0])
        way = before * (before + 1) / (2 * (self.gait.ramp + 1)) + hop - before  # in hops at full speed
        q[0] += way * self.gait.speed * self.gait.period
        return self.rest + min(1.0, since / 0.2) * (q - self.rest)

    def _hop(self, speed):
        """Configurations of a hop from one middle of a stance to the next one."""
        made = [self.rest]
        for k in range(self.gait.samples + 1):
            made.append(self._configuration(made[-1], self._outputs(k * self.gait.period / self.gait.samples, speed)))
        return np.array(made[1:])

    def _outputs(self, phase, speed):
        """At a time in [0, period] since the middle of a stance."""
        gait = self.gait
        half, way = (gait.period - gait.flight) / 2, speed * gait.period
        upwards = GRAVITY * gait.flight / 2  # at lift-off
        push = upwards / half
        low = self._height - upwards * half / 2
        if half < phase < half + gait.flight:
            since = phase - half
            z = self._height + upwards * since - GRAVITY * since**2 / 2
            part = since / gait.flight
            foot = way * part**2 * (3 - 2 * part), self._radius + gait.clearance * np.sin(np.pi * part) ** 2
        else:
            to_middle = min(phase, gait.period - phase)
            z = low + push * to_middle**2 / 2
            foot = 0.0 if phase <= half else way, self._radius
        return np.array([gait.offset + speed * phase, z, *foot, 0, gait.posture[0]])

    def _configuration(self, q, outputs):
        """By Newton's method from q."""
        q = q.copy()
        for _ in range(60):
            self._place(q)
            d = self._data
            error = outputs - [*d.subtree_com[0][[0, 2]], *d.geom_xpos[self._foot][[0, 2]], q[2] - q[3:].sum(), q[2]]
            if np.abs(error).max() < 1e-11:
                return q
            q += np.clip(np.linalg.solve(self._jacobian(), error), -0.2, 0.2)
        raise ValueError(f"the hopper cannot reach {outputs.round(3)}")

    def _jacobian(self):
        """Of the outputs, (6, 6), where the model was placed."""
        m, d, centre, foot, turn = self._model, self._data, *np.zeros((3, 3, 6))
        mj.mj_jacSubtreeCom(m, d, centre, 0)
        mj.mj_jacGeom(m, d, foot, turn, self._foot)
        return np.array([*centre[[0, 2]], *foot[[0, 2]], turn[1], np.eye(6)[2]])

    def _place(self, q, v=0.0):
        self._data.qpos[:], self._data.qvel[:] = q, v
        mj.mj_forward(self._model, self._data)
