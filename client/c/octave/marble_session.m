% session = marble_session(problem, options), as marble_solve takes them.
%
% answer = session.solve(changes): a struct of what changed, of vectors all, of matrices the values in the order in which
% the problem had them; struct() of nothing. It starts from the last answer. session.close() ends it.
function session = marble_session(problem, options)
  if nargin < 2
    options = struct();
  end
  handle = marble_mex('open', marble_parts(problem), options);
  session.solve = @(changes) marble_mex('update', handle, changes);
  session.close = @() marble_mex('close', handle);
end
