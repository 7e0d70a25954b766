% parts = marble_parts(problem): matrices sparse, vectors columns, as marble_mex takes them; empty ones are left out.
function parts = marble_parts(problem)
  if ~isstruct(problem) || ~isscalar(problem)
    error('marble:invalid_argument', 'the problem must be one struct');
  end
  parts = struct();
  for name = fieldnames(problem)'
    value = problem.(name{1});
    if isempty(value) && ~strcmp(name{1}, 'g')
      continue
    end
    if any(strcmp(name{1}, {'Q', 'A', 'C', 'L', 'R'}))
      parts.(name{1}) = sparse(marble_numbers(value, name{1}));
    else
      numbers = marble_numbers(value, name{1});
      parts.(name{1}) = full(numbers(:));
    end
  end
end
