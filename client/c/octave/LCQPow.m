% [x, y, stats] = LCQPow(Q, g, L, R, lbL, ubL, lbR, ubR, A, lbA, ubA, lb, ub, params), solved by Marble
%
% Its argument order, the shorter ones too: without A; without params; with the bounds of x alone in the place of A. Of
% params count x0, stationarityTolerance, complementarityTolerance, and `marble`, a struct of Marble's options; what else
% it has tunes LCQPow's own algorithm. y has the signs of Qx + g = y_box + A'y_A + L'y_L + R'y_R, in this order.
% stats.exit_flag is 0 of a solved problem; of one that is almost solved too, with the warning marble:almost_solved.
function [x, y, stats] = LCQPow(Q, g, L, R, varargin)
  params = struct();
  if ~isempty(varargin) && isstruct(varargin{end})
    params = varargin{end};
    varargin(end) = [];
  end
  given = numel(varargin);
  if ~any(given == [0, 4, 6, 7, 9])
    error('marble:invalid_argument', 'LCQPow: %d arguments are no call that it knows', nargin);
  end
  if given == 6
    varargin = [varargin(1:4), {[], [], []}, varargin(5:6)];
  end
  varargin(end + 1:9) = {[]};
  [lbL, ubL, lbR, ubR, A, lbA, ubA, lb, ub] = varargin{:};
  n = numel(g);
  pairs = size(L, 1);
  lbL = filled(lbL, zeros(pairs, 1));
  lbR = filled(lbR, zeros(pairs, 1));

  rows = [speye(n); sparse(reshape(A, [], n)); sparse(L); sparse(R)];
  low = [filled(lb, -inf(n, 1)); filled(lbA, -inf(size(A, 1), 1)); -inf(2 * pairs, 1)];
  high = [filled(ub, inf(n, 1)); filled(ubA, inf(size(A, 1), 1)); filled(ubL, inf(pairs, 1)); filled(ubR, inf(pairs, 1))];
  same = find(low == high);
  below = find(low > -inf & low ~= high);
  above = find(high < inf & low ~= high);

  p = struct('Q', sparse(Q), 'g', g, 'A', rows(same, :), 'b', -low(same), 'C', [rows(below, :); -rows(above, :)], ...
             'd', [-low(below); high(above)], 'L', sparse(L), 'l', -lbL, 'R', sparse(R), 'r', -lbR);
  options = struct();
  if isfield(params, 'marble')
    options = params.marble;
  end
  for name = {'stationarity', 'complementarity'}
    if isfield(params, [name{1}, 'Tolerance'])
      options.([name{1}, '_tolerance']) = params.([name{1}, 'Tolerance']);
    end
  end
  if isfield(params, 'x0')
    p.z0 = params.x0;
  end
  answer = marble_solve(p, options);
  if strcmp(answer.status, 'almost_solved')
    warning('marble:almost_solved', 'LCQPow: almost solved: %s', answer.detail);
  end

  x = answer.z;
  y = zeros(size(rows, 1), 1);
  y(same) = -answer.y;
  y(below) = y(below) + answer.nu(1:numel(below));
  y(above) = y(above) - answer.nu(numel(below) + 1:end);
  sides = n + size(A, 1) + (1:2 * pairs)';
  y(sides) = y(sides) + [answer.xi; answer.eta];
  stats = struct('iters_total', answer.iterations, 'elapsed_time', answer.total_s, ...
                 'exit_flag', double(~any(strcmp(answer.status, {'solved', 'almost_solved'}))), 'marble', answer);
end

function value = filled(value, default)
  if isempty(value)
    value = default;
  end
  value = full(value(:));
end
