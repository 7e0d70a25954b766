% What marble_solve, marble_session and LCQPow promise. hopper() is a problem of `marble example hopper`.
function octave_test()
  p = struct('Q', 2 * eye(2), 'g', [-2; -4], 'L', [1, 0], 'l', 0, 'R', [0, 1], 'r', 0);
  answer = marble_solve(p);
  assert(answer.status, 'solved');
  assert(answer.objective, -4, 1e-9);
  assert(answer.z, [0; 2], 1e-9);
  assert(strcmp(marble_solve(p, struct('path', 'paper', 'starts', 2)).status, 'solved'));

  session = marble_session(p);
  assert(session.solve(struct()).objective, -4, 1e-9);
  assert(session.solve(struct('g', [-8; -4], 'z0', [4; 0])).objective, -16, 1e-9);
  refused(@() session.solve(struct('g', [1; NaN])), 'marble:invalid_argument', 'g\[1\] = nan');
  session.close();
  refused(@() session.solve(struct()), 'marble:invalid_argument', 'not open');
  refused(@() marble_solve(setfield(p, 'l', [0; 0])), 'marble:invalid_argument', 'l');
  refused(@() marble_solve(p, struct('starts', 0)), 'marble:invalid_argument', 'starts');

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
