% parts = marble_parts(problem): matrices sparse, vectors columns, as marble_mex takes them; empty ones are left out.
function parts = marble_parts(problem)
  parts = struct();
  for name = fieldnames(problem)'
    value = problem.(name{1});
    if isempty(value) && ~strcmp(name{1}, 'g')
      continue
    end
    if any(strcmp(name{1}, {'Q', 'A', 'C', 'L', 'R'}))
      parts.(name{1}) = sparse(double(value));
    else
      parts.(name{1}) = full(double(value(:)));
    end
  end
end
