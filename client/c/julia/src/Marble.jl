"""
Marble for Julia, by `ccall` of libmarble.so (the C interface, marble.h).

    min ½ zᵀQz + gᵀz + c₀   s.t.   A z + b = 0,   C z + d ≥ 0,   0 ≤ L z + l  ⊥  R z + r ≥ 0

`MARBLE_LIBRARY` names the library where the loader does not find it by itself.
"""
module Marble

using SparseArrays

export Session, Solution, solve, update!

const LIBRARY = get(ENV, "MARBLE_LIBRARY", "libmarble.so.1")
const VECTORS = (:g, :b, :d, :l, :r)
const MATRICES = (:Q, :A, :C, :L, :R)

"""What was wrong: `field`, `index` from 1 (0: the field as a whole), `value` and the rule that it broke, `bound`."""
struct Fault <: Exception
    code::String
    field::String
    index::Int64
    value::String
    bound::String
    message::String
end
Base.showerror(io::IO, fault::Fault) = print(io, "marble: ", fault.message)

# marble_error, by the offsets of its members.
const ERROR_BYTES = 1488
text(bytes, from, size) = unsafe_string(pointer(bytes, from + 1), something(findfirst(iszero, view(bytes, from+1:from+size)), size + 1) - 1)

# Runs `call(error)`, which returns a code, and throws what it says.
function checked(call)
    error = zeros(UInt8, ERROR_BYTES)
    code = GC.@preserve error call(pointer(error))
    code == 0 && return nothing
    GC.@preserve error begin
        name = unsafe_string(ccall((:marble_error_name, LIBRARY), Cstring, (Int32,), code))
        index = unsafe_load(Ptr{Int64}(pointer(error, 9)))
        throw(Fault(name, text(error, 16, 128), index + 1, text(error, 144, 64), text(error, 208, 512), text(error, 720, 768)))
    end
end

"""
Why a problem is infeasible: parts that no point meets together, whatever the others are. `equalities` are rows of A,
`inequalities` rows of C, `left_sides` and `right_sides` pairs whose L z + l ≥ 0 or R z + r ≥ 0 takes part, and
`complementarities` pairs that take part by having a side at zero. Indices start at 1 and ascend. `minimal`: without any
one of these parts the others have a point; false where a limit came first. `detail`: what was proved, or which limit.
"""
struct Conflict
    equalities::Vector{Int}
    inequalities::Vector{Int}
    left_sides::Vector{Int}
    right_sides::Vector{Int}
    complementarities::Vector{Int}
    minimal::Bool
    detail::String
end

"""An answer, solved or not: see `status`. With Qz + g + Aᵀy − Cᵀν − Lᵀξ − Rᵀη = 0 at a solution."""
struct Solution
    status::String
    detail::String
    objective::Float64
    z::Vector{Float64}
    y::Vector{Float64}
    nu::Vector{Float64}
    xi::Vector{Float64}
    eta::Vector{Float64}
    certificate::Vector{Float64}
    numbers::Dict{String,Float64}  # all that marble_solution_number returns: bound, gap, iterations, violations, times, …
    conflict::Union{Conflict,Nothing}  # with option explain, of a problem that is proved to be infeasible
end

function vector(handle, name)
    values, count = Ref{Ptr{Float64}}(C_NULL), Ref{Int64}(0)
    checked(error -> ccall((:marble_solution_vector, LIBRARY), Int32,
                           (Ptr{Cvoid}, Cstring, Ref{Ptr{Float64}}, Ref{Int64}, Ptr{UInt8}), handle, name, values, count, error))
    return count[] == 0 ? Float64[] : copy(unsafe_wrap(Array, values[], count[]))
end

function number(handle, name)
    value = Ref{Float64}(0.0)
    checked(error -> ccall((:marble_solution_number, LIBRARY), Int32, (Ptr{Cvoid}, Cstring, Ref{Float64}, Ptr{UInt8}),
                           handle, name, value, error))
    return value[]
end

# The names of all numbers of a solution.
function number_names()
    names = String[]
    while true
        name = unsafe_string(ccall((:marble_solution_number_name, LIBRARY), Cstring, (Int32,), length(names)))
        isempty(name) && return names
        push!(names, name)
    end
end

function conflict_part(handle, part)
    indices, count = Ref{Ptr{Int32}}(C_NULL), Ref{Int64}(0)
    checked(error -> ccall((:marble_solution_conflict, LIBRARY), Int32,
                           (Ptr{Cvoid}, Cstring, Ref{Ptr{Int32}}, Ref{Int64}, Ptr{UInt8}), handle, part, indices, count, error))
    return count[] == 0 ? Int[] : Int.(unsafe_wrap(Array, indices[], count[])) .+ 1
end

function conflict_of(handle)
    kind = number(handle, "conflict")
    kind == 0 && return nothing
    parts = ("equalities", "inequalities", "left_sides", "right_sides", "complementarities")
    detail = ccall((:marble_solution_conflict_detail, LIBRARY), Cstring, (Ptr{Cvoid},), handle)
    return Conflict((conflict_part(handle, part) for part in parts)..., kind == 2, unsafe_string(detail))
end

# Copies the answer and destroys the handle.
function taken(handle)
    try
        status = ccall((:marble_solution_status, LIBRARY), Int32, (Ptr{Cvoid},), handle)
        return Solution(unsafe_string(ccall((:marble_status_name, LIBRARY), Cstring, (Int32,), status)),
                        unsafe_string(ccall((:marble_solution_detail, LIBRARY), Cstring, (Ptr{Cvoid},), handle)),
                        ccall((:marble_solution_objective, LIBRARY), Float64, (Ptr{Cvoid},), handle),
                        (vector(handle, name) for name in ("z", "y", "nu", "xi", "eta", "certificate"))...,
                        Dict(name => number(handle, name) for name in number_names()), conflict_of(handle))
    finally
        ccall((:marble_solution_destroy, LIBRARY), Cvoid, (Ptr{Cvoid},), handle)
    end
end

function set_vector(problem, part, values)
    numbers = convert(Vector{Float64}, vec(collect(values)))
    checked(error -> ccall((:marble_problem_set_vector, LIBRARY), Int32,
                           (Ptr{Cvoid}, Cstring, Ptr{Float64}, Int64, Ptr{UInt8}), problem, part, numbers, length(numbers), error))
end

function set_matrix(problem, part, given)
    m = SparseMatrixCSC{Float64,Int32}(sparse(given))
    checked(error -> ccall((:marble_problem_set_matrix, LIBRARY), Int32,
                           (Ptr{Cvoid}, Cstring, Int32, Int32, Ptr{Int32}, Int64, Ptr{Int32}, Ptr{Float64}, Ptr{UInt8}),
                           problem, part, size(m, 1), size(m, 2), m.colptr .- Int32(1), nnz(m), m.rowval .- Int32(1), m.nzval,
                           error))
end

# Calls `use(problem)` with a handle of the parts.
function with_problem(use, g, parts)
    problem = Ref{Ptr{Cvoid}}(C_NULL)
    checked(error -> ccall((:marble_problem_create, LIBRARY), Int32, (Int32, Ref{Ptr{Cvoid}}, Ptr{UInt8}),
                           length(g), problem, error))
    try
        set_vector(problem[], "g", g)
        for (name, given) in parts
            given === nothing && continue
            name in MATRICES ? set_matrix(problem[], String(name), given) : set_vector(problem[], String(name), given)
        end
        return use(problem[])
    finally
        ccall((:marble_problem_destroy, LIBRARY), Cvoid, (Ptr{Cvoid},), problem[])
    end
end

function with_options(use, given)
    options = Ref{Ptr{Cvoid}}(C_NULL)
    checked(error -> ccall((:marble_options_create, LIBRARY), Int32, (Ref{Ptr{Cvoid}}, Ptr{UInt8}), options, error))
    try
        for (name, value) in given
            checked(error -> ccall((:marble_options_set, LIBRARY), Int32, (Ptr{Cvoid}, Cstring, Cstring, Ptr{UInt8}),
                                   options[], String(name), string(value), error))
        end
        return use(options[])
    finally
        ccall((:marble_options_destroy, LIBRARY), Cvoid, (Ptr{Cvoid},), options[])
    end
end

"""
    solve(g; Q, A, b, C, d, L, l, R, r, c0, options...)

Solves where the environment's `MARBLE_SERVER` says, and in this process where that says nothing. What is left out is
zero or absent; options are the solver's, by name: with `explain=true` the solution of an infeasible problem has a
`conflict`. Throws a `Fault` that names the part that is wrong.
"""
function solve(g; Q=nothing, A=nothing, b=nothing, C=nothing, d=nothing, L=nothing, l=nothing, R=nothing, r=nothing,
               c0=0.0, options...)
    parts = (:Q => Q, :A => A, :b => b, :C => C, :d => d, :L => L, :l => l, :R => R, :r => r, :c0 => [c0])
    with_problem(g, parts) do problem
        with_options(options) do chosen
            solution = Ref{Ptr{Cvoid}}(C_NULL)
            checked(error -> ccall((:marble_solve, LIBRARY), Int32,
                                   (Ptr{Cvoid}, Ptr{Cvoid}, Ptr{Cvoid}, Ptr{Cvoid}, Ref{Ptr{Cvoid}}, Ptr{UInt8}),
                                   C_NULL, problem, chosen, C_NULL, solution, error))
            taken(solution[])
        end
    end
end

"""
    Session(g; parts and options as of solve)

A problem that is set up once. `update!(session; g=…)` solves it with new numbers, from the last answer on.
"""
mutable struct Session
    handle::Ptr{Cvoid}
    function Session(g; Q=nothing, A=nothing, b=nothing, C=nothing, d=nothing, L=nothing, l=nothing, R=nothing, r=nothing,
                     c0=0.0, options...)
        parts = (:Q => Q, :A => A, :b => b, :C => C, :d => d, :L => L, :l => l, :R => R, :r => r, :c0 => [c0])
        handle = Ref{Ptr{Cvoid}}(C_NULL)
        with_problem(g, parts) do problem
            with_options(options) do chosen
                checked(error -> ccall((:marble_session_open, LIBRARY), Int32,
                                       (Ptr{Cvoid}, Ptr{Cvoid}, Ptr{Cvoid}, Ptr{Cvoid}, Ref{Ptr{Cvoid}}, Ptr{UInt8}),
                                       C_NULL, problem, chosen, C_NULL, handle, error))
            end
        end
        return finalizer(close, new(handle[]))
    end
end

function Base.close(session::Session)
    ccall((:marble_session_destroy, LIBRARY), Cvoid, (Ptr{Cvoid},), session.handle)
    session.handle = C_NULL
    return nothing
end

"""
    update!(session; numbers...)

Takes new numbers by the letters of the equation (of a sparse matrix all of its values, in their order) and solves.
"""
function update!(session::Session; numbers...)
    for (part, given) in numbers
        values = convert(Vector{Float64}, given isa Number ? [given] : given isa SparseMatrixCSC ? given.nzval : vec(collect(given)))
        checked(error -> ccall((:marble_session_set, LIBRARY), Int32,
                               (Ptr{Cvoid}, Cstring, Ptr{Float64}, Int64, Ptr{UInt8}),
                               session.handle, String(part), values, length(values), error))
    end
    solution = Ref{Ptr{Cvoid}}(C_NULL)
    checked(error -> ccall((:marble_session_solve, LIBRARY), Int32, (Ptr{Cvoid}, Ref{Ptr{Cvoid}}, Ptr{UInt8}),
                           session.handle, solution, error))
    return taken(solution[])
end

end
