% answer = marble_solve(problem, options)
%
%   min 1/2 z'Qz + g'z + c0   s.t.   A z + b = 0,   C z + d >= 0,   0 <= L z + l  complements  R z + r >= 0
%
% problem: a struct with g and what there is of Q, A, b, C, d, L, l, R, r, c0, and z0 to start from. options: a struct of
% the solver's options. answer: a struct with status, detail, objective, z, y, nu, xi, eta and more. It solves where the
% environment's MARBLE_SERVER says, and in this process where that says nothing.
%
% With the option explain, answer.conflict of a problem that is proved to be infeasible is a struct of parts that no point
% meets together: rows of A in equalities and of C in inequalities, pairs by the sign of a side in left_sides and
% right_sides, and pairs that need a side at zero in complementarities, all counted from 1. minimal is true where without
% any one of them the others have a point, detail says what was proved. Else answer.conflict is [].
function answer = marble_solve(problem, options)
  if nargin < 2
    options = struct();
  end
  answer = marble_mex('solve', marble_parts(problem), options);
end
