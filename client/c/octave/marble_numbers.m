% numbers = marble_numbers(value, name): as doubles; texts, cells and structs are no numbers.
function numbers = marble_numbers(value, name)
  if ~(isnumeric(value) || islogical(value)) || ~isreal(value)
    error('marble:invalid_argument', '%s: must be real numbers', name);
  end
  numbers = double(value);
end
