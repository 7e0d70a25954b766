% session = marble_session(problem, options), as marble_solve takes them.
%
% answer = session.solve(changes): a struct of what changed, of vectors all, of matrices the values in the order in which
% the problem had them, or a sparse matrix with its pattern; struct() of nothing. It starts from the last answer.
% session.close() ends it.
function session = marble_session(problem, options)
  if nargin < 2
    options = struct();
  end
  parts = marble_parts(problem);
  handle = marble_mex('open', parts, options);
  session.solve = @(changes) marble_mex('update', handle, numbers_of(changes, parts));
  session.close = @() marble_mex('close', handle);
end

function numbers = numbers_of(changes, parts)
  if ~isstruct(changes) || ~isscalar(changes)
    error('marble:invalid_argument', 'changes must be one struct');
  end
  numbers = struct();
  for name = fieldnames(changes)'
    value = marble_numbers(changes.(name{1}), name{1});
    if issparse(value) && any(strcmp(name{1}, {'Q', 'A', 'C', 'L', 'R'}))
      if ~isfield(parts, name{1}) || ~isequal(value ~= 0, parts.(name{1}) ~= 0)
        error('marble:invalid_argument', '%s: must have the pattern of the problem''s', name{1});
      end
      value = nonzeros(value);
    end
    numbers.(name{1}) = full(value(:));
  end
end
