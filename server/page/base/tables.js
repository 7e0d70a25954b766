// What the contract's words mean. Made by proto/generate from contract.def; not to be edited.

/** tone: good, soft (an answer that is not solved, or less than asked), bad. */
export const STATUSES = {
  solved: {
    tone: "good",
    means: "All tolerances are met.",
    advice: "",
  },
  solved_reduced: {
    tone: "soft",
    means: "Feasible to 100 times the tolerances, but no further progress was possible.",
    advice: "Use it if that is enough. Else look at which violation is largest and scale those rows, or loosen that tolerance.",
  },
  iteration_limit: {
    tone: "soft",
    means: "max_iterations was reached, or with option global node_limit; this is the best iterate.",
    advice: "If the curves still fall, raise max_iterations. If they are flat, another start (x0, or starts above 1) helps more than more iterations. Where nodes are open, raise node_limit.",
  },
  time_limit: {
    tone: "soft",
    means: "time_limit_s was reached; this is the best iterate.",
    advice: "Look at where the time went: raise time_limit_s, lower local_search_budget, or start warm in a session.",
  },
  cancelled: {
    tone: "soft",
    means: "The solve was told to end, by its client, by cancel or by a server that shuts down; this is the best iterate.",
    advice: "Send it again if nobody meant to end it.",
  },
  infeasible: {
    tone: "bad",
    means: "No point meets the constraints. The certificate in the answer proves it even without complementarity; where it is empty, every branch of the pairs was refuted.",
    advice: "The problem contradicts itself: check signs and offsets of A, b, C, d, l and r. Option explain=true, or marble explain, names a smallest set of rows and pairs that clash.",
  },
  locally_infeasible: {
    tone: "bad",
    means: "The search ended where the violation cannot be lowered any further; no feasible point is near. Others may exist elsewhere.",
    advice: "Where the detail names ill-conditioned rows, remove one of them. Else raise feasibility_budget, or start elsewhere (x0). If it happens with every start, suspect the data of the largest violation.",
  },
  unbounded: {
    tone: "bad",
    means: "The objective falls without end along a feasible direction, which is the certificate in the answer.",
    advice: "A bound or a cost is missing: the entries of that direction name the variables.",
  },
  numerical_failure: {
    tone: "bad",
    means: "No acceptable step was found within the bounded number of tries.",
    advice: "Mostly a matter of scale: bring the data nearer to 1, avoid nearly equal rows, keep scaling_passes above 0, or try path = paper.",
  },
};

/** By google.rpc.Code. */
export const ERRORS = {
  1: {
    name: "cancelled",
    means: "The caller gave it up, or it was ended before there was an answer.",
    advice: "Send it again if nobody meant to end it.",
  },
  3: {
    name: "invalid_argument",
    means: "The input breaks a documented rule; field and index say where.",
    advice: "Mend what the field and the index name.",
  },
  4: {
    name: "deadline_exceeded",
    means: "Its deadline passed before there was an answer.",
    advice: "Allow more time, or send it with a higher priority.",
  },
  5: {
    name: "not_found",
    means: "What it names is not here, or not any more.",
    advice: "Look for the name, or whether it is kept long enough.",
  },
  7: {
    name: "permission_denied",
    means: "The caller lacks the role or the priority for it.",
    advice: "Ask whoever runs the server for the role.",
  },
  8: {
    name: "resource_exhausted",
    means: "A limit of the server or a quota of the client was reached.",
    advice: "Try again later, with less, or raise the limit.",
  },
  9: {
    name: "failed_precondition",
    means: "It does not fit what came before it: an update of another shape, an answer that is not there yet.",
    advice: "Ask again once its state fits.",
  },
  10: {
    name: "aborted",
    means: "The server ended it by a rule of its own: a session without an update for too long.",
    advice: "Set the session up again.",
  },
  13: {
    name: "internal",
    means: "A bug in Marble.",
    advice: "The server's log tells more under the job's id; please report it.",
  },
  14: {
    name: "unavailable",
    means: "The server cannot be reached, is draining, or is no Marble server.",
    advice: "It is safe to send it again, here later or elsewhere.",
  },
  16: {
    name: "unauthenticated",
    means: "The caller showed no token or certificate that is known.",
    advice: "Give a token or a certificate that the server knows.",
  },
};
