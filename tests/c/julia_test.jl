# The Julia package as a program sees it: answers, faults, a session.
using Marble, SparseArrays, Test

corner = (Q=sparse([2.0 0; 0 2]), L=sparse([1.0 0]), l=[0.0], R=sparse([0.0 1]), r=[0.0])

@testset "Marble" begin
    answer = solve([-2.0, -4.0]; corner...)
    @test answer.status == "solved" && answer.objective ≈ -4 && answer.z ≈ [0, 2]
    @test solve([-2.0, -4.0]; corner..., path="paper").numbers["iterations"] > 0
    fault = try solve([-2.0, NaN]; corner...) catch error; error end
    @test fault isa Marble.Fault && fault.field == "g" && fault.index == 2 && fault.code == "invalid_argument"
    session = Session([-2.0, -4.0]; corner...)
    @test update!(session).objective ≈ -4
    @test update!(session; g=[-6.0, -4.0]).z ≈ [3, 0]
    close(session)
    # z[1] = 1 and z[2] = 1 where z[1] z[2] = 0; z[2] <= 3 can be met.
    rows = (A=sparse([1.0 0; 0 1]), b=[-1.0, -1.0], C=sparse([0.0 -1]), d=[3.0])
    @test solve([-2.0, -4.0]; corner..., rows...).conflict === nothing
    conflict = solve([-2.0, -4.0]; corner..., rows..., explain=true).conflict
    @test conflict.equalities == [1, 2] && conflict.complementarities == [1]
    @test isempty(conflict.inequalities) && isempty(conflict.left_sides) && isempty(conflict.right_sides)
    @test conflict.minimal && !isempty(conflict.detail)
end
