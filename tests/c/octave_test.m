% What marble_solve, marble_session and LCQPow promise. hopper() is a problem of `marble example hopper`.
function octave_test()
  p = struct('Q', 2 * eye(2), 'g', [-2; -4], 'L', [1, 0], 'l', 0, 'R', [0, 1], 'r', 0);
  answer = marble_solve(p);
  assert(answer.status, 'solved');
  assert(answer.objective, -4, 1e-9);
  assert(answer.z, [0; 2], 1e-9);
  assert(strcmp(marble_solve(p, struct('path', 'paper', 'num_starts', 2)).status, 'solved'));

  session = marble_session(p);
  assert(session.solve(struct()).objective, -4, 1e-9);
  assert(session.solve(struct('g', [-8; -4], 'z0', [4; 0])).objective, -16, 1e-9);
  refused(@() session.solve(struct('g', [1; NaN])), 'marble:invalid_argument', 'g\[1\] = nan');
  session.close();
  refused(@() session.solve(struct()), 'marble:invalid_argument', 'not open');
  refused(@() marble_solve(setfield(p, 'l', [0; 0])), 'marble:invalid_argument', 'l');
  refused(@() marble_solve(p, struct('num_starts', 0)), 'marble:invalid_argument', 'num_starts');

  an_infeasible_problem_is_explained(p);
  wrong_arguments_are_refused(p);
  a_closed_session_stays_closed(p);

  % Its orders: without A, with the bounds of x alone, with A, with params.
  L = [1, 0];
  R = [0, 1];
  check_lcqpow(p.Q, p.g, L, R, {}, -4);
  check_lcqpow(p.Q, p.g, L, R, {0, [], 0, [], [-1; -1], [5; 1]}, -3);
  check_lcqpow(p.Q, p.g, L, R, {0, [], 0, 1}, -3);
  check_lcqpow(p.Q, p.g, L, R, {-1, [], [], [], [0, 1], 0.5, 0.5}, 0.25 - 2 + 3);
  check_lcqpow(p.Q, p.g, L, R, {[], [], [], [], [1, 1], -inf, 1, [], [], struct('x0', [0; 1], 'printLevel', 0)}, -3);
  refused(@() LCQPow(p.Q, p.g, L, R, 0), 'marble:invalid_argument', 'no call');

  % jr1 of MacMPEC: (z2 - 1)^2 + z1^2, 0 <= z2 complements z2 - z1 >= 0; at best 1/2.
  [x, ~, stats] = LCQPow(2 * eye(2), [0; -2], [0, 1], [-1, 1], [], [], [], []);
  assert(stats.exit_flag, 0);
  assert(stats.marble.objective + 1, 0.5, 1e-9);
  assert(x, [0.5; 0.5], 1e-9);

  % A hopper: the bits of the program.
  printf('%s ', num2cell(num2hex(marble_solve(hopper()).z), 2){:});
end

% z1 = 1 and z2 = 1 where z1 z2 = 0; z2 <= 3 can be met.
function an_infeasible_problem_is_explained(p)
  p.A = eye(2);
  p.b = [-1; -1];
  p.C = [0, -1];
  p.d = 3;
  assert(isempty(marble_solve(p).conflict));
  answer = marble_solve(p, struct('explain', true));
  assert(answer.status, 'infeasible');
  assert(answer.conflict.equalities, [1; 2]);
  assert(answer.conflict.complementarities, 1);
  for part = {'inequalities', 'left_sides', 'right_sides'}
    assert(isempty(answer.conflict.(part{1})));
  end
  assert(answer.conflict.minimal, true);
  assert(~isempty(answer.conflict.detail));
end

function wrong_arguments_are_refused(p)
  session = marble_session(p);
  for wrong = {'ab', {1, 2}, [1i; 2], struct('a', 1), [NaN; 1], @sin}
    refused(@() marble_solve(setfield(p, 'g', wrong{1})), 'marble:invalid_argument', 'g');
    refused(@() session.solve(setfield(struct(), 'g', wrong{1})), 'marble:invalid_argument', 'g');
  end
  for wrong = {5, [p, p], struct('g', {}), {}, 'text'}
    refused(@() marble_solve(wrong{1}), 'marble:invalid_argument', 'struct');
    refused(@() marble_solve(p, wrong{1}), 'marble:invalid_argument', 'struct');
    refused(@() session.solve(wrong{1}), 'marble:invalid_argument', 'struct');
    refused(@() marble_mex('solve', wrong{1}, struct()), 'marble:invalid_argument', 'struct');
    refused(@() marble_mex('update', 1, wrong{1}), 'marble:invalid_argument', '');
  end
  for wrong = {sparse(0), 2i, {1}, [1, 2], zeros(0, 1), struct()}
    refused(@() marble_solve(p, setfield(struct(), 'num_starts', wrong{1})), 'marble:invalid_argument', 'option');
  end
  refused(@() marble_mex(), 'marble:invalid_argument', '');
  refused(@() marble_mex('solve', struct('g', [1; 2], 'z0', sparse(2, 1)), struct()), 'marble:invalid_argument', 'full');

  % The numbers of another pattern would count in the wrong places.
  refused(@() session.solve(struct('L', sparse([0, 1]))), 'marble:invalid_argument', 'L: .*pattern');
  refused(@() session.solve(struct('A', sparse([0, 1]))), 'marble:invalid_argument', 'A: .*pattern');
  assert(session.solve(struct('g', sparse([0; -4]))).objective, -4, 1e-9);
  assert(session.solve(struct('Q', sparse([4, 0; 0, 4]))).objective, -2, 1e-9);
  session.close();
end

function a_closed_session_stays_closed(p)
  first = marble_session(p);
  first.close();
  second = marble_session(setfield(p, 'g', [-2; -8]));
  refused(@() first.solve(struct()), 'marble:invalid_argument', 'not open');
  refused(@() first.close(), 'marble:invalid_argument', 'not open');
  for handle = {0, 0.5, -1, NaN, Inf, 1e300, sparse(1), '1', {}, [1, 2]}
    refused(@() marble_mex('update', handle{1}, struct()), 'marble:invalid_argument', 'not open');
  end
  assert(second.solve(struct()).objective, -16, 1e-9);
  second.close();
end

function check_lcqpow(Q, g, L, R, rest, objective)
  [x, y, stats] = LCQPow(Q, g, L, R, rest{:});
  assert(stats.exit_flag, 0);
  assert(0.5 * x' * Q * x + g' * x, objective, 1e-7);
  A = zeros(0, 2);
  if numel(rest) >= 7
    A = rest{5};
  end
  assert(Q * x + g, [eye(2); A; L; R]' * y, 1e-6);
end

function refused(call, identifier, pattern)
  try
    call();
  catch fault
    assert(fault.identifier, identifier);
    assert(isempty(pattern) || ~isempty(regexp(fault.message, pattern, 'once')), fault.message);
    return
  end
  error('nothing was refused');
end
