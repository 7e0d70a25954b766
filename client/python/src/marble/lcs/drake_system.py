"""A controller as a system of a Drake diagram. Needs drake (1.51 was tried)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import marble
from marble.errors import InvalidArgument
from marble.lcs.controller import Controller
from marble.lcs.statistics import ControlStatistics
from marble.lcs.task import Task
from marble.model.optional import optional

_framework: Any = optional("pydrake.systems.framework", "drake", "ControllerSystem")


class ControllerSystem(_framework.LeafSystem):  # type: ignore[misc]
    """Plans at the task's rate; connect it to the plant that is simulated::

        controller = builder.AddSystem(ControllerSystem(model_plant, model_diagram, task))
        builder.Connect(plant.get_state_output_port(), controller.get_input_port())
        builder.Connect(controller.get_output_port(), plant.get_actuation_input_port())

    plant, diagram: a model of the robot of its own, and the built diagram of it and its SceneGraph; not those that are
    simulated, since the state is written into its context. task, server, options: as in Controller.
    Input port "state": (nq + nv,). Output port "actuation": (nu,), as of Controller.input; 0 before the first step. The
    state is discrete: time of the last step, and its inputs.

    InvalidArgument of "diagram" if it does not contain the plant. For one simulation at a time; `controller.reset()`
    before another one, `controller.close()` at the end.
    """

    def __init__(self, plant: Any, diagram: Any, task: Task, *,
                 server: str | Sequence[str] | marble.Client | None = None, options: Mapping[str, Any] | None = None,
                 **more_options: Any) -> None:
        super().__init__()
        self.controller: Controller = Controller(plant, task, server=server, options=options, **more_options)
        self._root = diagram.CreateDefaultContext()
        try:
            self._own = plant.GetMyMutableContextFromRoot(self._root)
        except (RuntimeError, TypeError) as error:
            raise InvalidArgument("diagram", f"must contain the plant ({error})") from None
        self._plant, self._nu, self._is_begun = plant, plant.num_actuators(), False
        self.DeclareVectorInputPort("state", plant.num_multibody_states())
        self.DeclareDiscreteState(1 + self._nu)
        self.DeclarePeriodicDiscreteUpdateEvent(task.period_s, 0.0, self._update)
        self._feeds_back = bool(np.any(np.asarray(task.kp)) or np.any(np.asarray(task.kd)))
        tickets = {self.xd_ticket(), self.time_ticket()}
        if self._feeds_back:
            tickets.add(self.all_input_ports_ticket())
        self.DeclareVectorOutputPort("actuation", self._nu, self._actuation, tickets)

    @property
    def statistics(self) -> ControlStatistics:
        """The controller's."""
        return self.controller.statistics

    def _measured(self, context: Any) -> Any:
        self._plant.SetPositionsAndVelocities(self._own, self.get_input_port().Eval(context))
        return self._own

    def _update(self, context: Any, discrete: Any) -> None:
        u = self.controller.step(self._measured(context)).u
        self._is_begun = True
        discrete.set_value(np.concatenate([[context.get_time()], u]))

    def _actuation(self, context: Any, output: Any) -> None:
        values = context.get_discrete_state_vector().value()
        elapsed = context.get_time() - values[0]
        if not self._is_begun or elapsed < 0:
            output.SetFromVector(values[1:])
            return
        state = self._measured(context) if self._feeds_back else self._own
        output.SetFromVector(self.controller.input(state, elapsed))
